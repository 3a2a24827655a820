/* The RC ladder of models/benchmark with one unknown a node, written by hand for SUNDIALS IDA with KLU: the peer of steps.py.
 *
 *     ladder N RTOL DELTACJ
 *
 * One line: steps, CPU seconds of the integration from 0 to 1 s, voltage of the last node.  Residual and Jacobian cost next
 * to nothing here: what is left is IDA.  DELTACJ: change of cj that it refactors for (0.25 by default). */
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <time.h>

#define V(v) N_VGetArrayPointer(v)

static int n;

static double source(double t)
{
    return sin(4.0 * acos(0.0) * 2.0 * t);
}

/* C v' = (v[i-1] - v[i])/R - (v[i] - v[i+1])/R with R = C = 1/n */
static int residual(realtype t, N_Vector y, N_Vector yd, N_Vector r, void *none)
{
    (void)none;
    const double *v = V(y), *vd = V(yd);
    double *out = V(r), g = (double)n, c = 1.0 / n;
    for (int i = 0; i < n; i++) {
        double before = i > 0 ? v[i - 1] : source(t);
        out[i] = c * vd[i] - g * (before - v[i]) + (i + 1 < n ? g * (v[i] - v[i + 1]) : 0.0);
    }
    return 0;
}

static int jacobian(realtype t, realtype cj, N_Vector y, N_Vector yd, N_Vector r, SUNMatrix J, void *none, N_Vector a,
                    N_Vector b, N_Vector d)
{
    (void)t, (void)y, (void)yd, (void)r, (void)none, (void)a, (void)b, (void)d;
    sunindextype *start = SUNSparseMatrix_IndexPointers(J), *row = SUNSparseMatrix_IndexValues(J), e = 0;
    double *value = SUNSparseMatrix_Data(J), g = (double)n;
    for (int i = 0; i < n; i++) {
        start[i] = e;
        for (int k = i > 0 ? i - 1 : 0; k <= i + 1 && k < n; k++) {
            row[e] = k;
            value[e++] = k == i ? cj / n + (i + 1 < n ? 2.0 : 1.0) * g : -g;
        }
    }
    start[n] = e;
    return 0;
}

int main(int number, char **argument)
{
    if (number < 4)
        return 2;
    n = atoi(argument[1]);
    double rtol = atof(argument[2]), t = 0.0;
    SUNContext context;
    SUNContext_Create(NULL, &context);
    N_Vector y = N_VNew_Serial(n, context), yd = N_VClone(y);
    N_VConst(0.0, y);
    N_VConst(0.0, yd);
    void *ida = IDACreate(context);
    IDAInit(ida, residual, 0.0, y, yd);
    IDASStolerances(ida, rtol, rtol);
    SUNMatrix J = SUNSparseMatrix(n, n, 3 * n, CSC_MAT, context);
    SUNLinearSolver linear = SUNLinSol_KLU(y, J, context);
    IDASetLinearSolver(ida, linear, J);
    IDASetJacFn(ida, jacobian);
    IDASetDeltaCjLSetup(ida, atof(argument[3]));
    IDASetMaxNumSteps(ida, 1000000);
    IDASetMaxStep(ida, 0.05);
    IDASetStopTime(ida, 1.0);
    clock_t began = clock();
    int flag = IDASolve(ida, 1.0, &t, y, yd, IDA_NORMAL);
    double seconds = (double)(clock() - began) / CLOCKS_PER_SEC;
    long steps = 0;
    IDAGetNumSteps(ida, &steps);
    printf("%ld %.9g %.17g\n", flag < 0 ? -1L : steps, seconds, V(y)[n - 1]);
    return 0;
}
