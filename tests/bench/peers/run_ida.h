/* What ladder.c and grid.c share: IDA with KLU from 0 to 1 s on a residual and a Jacobian of n unknowns.
 *
 * One line: steps, CPU seconds of the integration; the last unknown at 0.1, 0.2 ... 1 s, of the same steps once more. */
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <time.h>

#define V(v) N_VGetArrayPointer(v)
#define INSTANTS 10

static double source(double t)
{
    return sin(4.0 * acos(0.0) * 2.0 * t);
}

/* entries: of a column of the Jacobian at most; deltacj: change of cj that it refactors for (0.25 by default) */
static int run(int n, int entries, double rtol, double deltacj, IDAResFn residual, IDALsJacFn jacobian)
{
    SUNContext context;
    SUNContext_Create(NULL, &context);
    N_Vector y = N_VNew_Serial(n, context), yd = N_VClone(y);
    N_VConst(0.0, y);
    N_VConst(0.0, yd);
    double t = 0.0;
    void *ida = IDACreate(context);
    IDAInit(ida, residual, 0.0, y, yd);
    IDASStolerances(ida, rtol, rtol);
    SUNMatrix J = SUNSparseMatrix(n, n, entries * n, CSC_MAT, context);
    SUNLinearSolver linear = SUNLinSol_KLU(y, J, context);
    IDASetLinearSolver(ida, linear, J);
    IDASetJacFn(ida, jacobian);
    IDASetDeltaCjLSetup(ida, deltacj);
    IDASetMaxNumSteps(ida, 1000000);
    IDASetMaxStep(ida, 0.05);
    IDASetStopTime(ida, 1.0);
    clock_t began = clock();
    int flag = IDASolve(ida, 1.0, &t, y, yd, IDA_NORMAL);
    double seconds = (double)(clock() - began) / CLOCKS_PER_SEC;
    long steps = 0;
    IDAGetNumSteps(ida, &steps);
    printf("%ld %.9g", flag < 0 ? -1L : steps, seconds);
    N_VConst(0.0, y);
    N_VConst(0.0, yd);
    IDAReInit(ida, 0.0, y, yd);
    IDASetStopTime(ida, 1.0);
    t = 0.0;
    for (int i = 1; i <= INSTANTS && flag >= 0;) {
        flag = IDASolve(ida, 1.0, &t, y, yd, IDA_ONE_STEP);
        for (; i <= INSTANTS && (double)i / INSTANTS <= t; i++) {
            IDAGetDky(ida, (double)i / INSTANTS, 0, y);
            printf(" %.17g", V(y)[n - 1]);
        }
    }
    printf("\n");
    return 0;
}
