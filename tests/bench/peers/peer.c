/* A model that `sysdyn compile` wrote, by SUNDIALS IDA (any index form) or CVODE (index form 0): the peer of race.py.
 *
 *     peer ida|bdf|adams dense|klu SUPPRESS EPCON DELTACJ T_END SECONDS [HALVES]
 *
 * One line a tolerance (half decades, 1e-2 to 1e-13; HALVES: that one alone, once): rtol, flag, steps, CPU seconds (least of some), outputs at T_END.
 * Absolute tolerances are rtol times the model's own magnitudes; what is algebraic counts loosely in them where it is
 * suppressed, for multipliers in the error test are what stops IDA on constrained systems. */
#include "sysdyn_model.h"

#include <cvode/cvode.h>
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

#define V(v) N_VGetArrayPointer(v)
#define STEPS 200000
#define AGAIN 0.02 /* seconds for which a short run is repeated */

static double *p, *zero, *entries;
static int klu;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int residual(realtype t, N_Vector y, N_Vector yd, N_Vector r, void *none)
{
    (void)none;
    return sd_residual(t, V(y), V(yd), p, V(r));
}

/* entries by columns into the matrix, times `sign` */
static void put(SUNMatrix J, double sign)
{
    if (klu) {
        sunindextype *pointer = SUNSparseMatrix_IndexPointers(J), *row = SUNSparseMatrix_IndexValues(J);
        double *value = SUNSparseMatrix_Data(J);
        for (int k = 0; k <= sd_n_unknowns; k++)
            pointer[k] = sd_colptr[k];
        for (int e = 0; e < sd_n_entries; e++) {
            row[e] = sd_rowind[e];
            value[e] = sign * entries[e];
        }
        return;
    }
    SUNMatZero(J);
    for (int k = 0; k < sd_n_unknowns; k++)
        for (int e = sd_colptr[k]; e < sd_colptr[k + 1]; e++)
            SUNDenseMatrix_Column(J, k)[sd_rowind[e]] = sign * entries[e];
}

static int jacobian(realtype t, realtype cj, N_Vector y, N_Vector yd, N_Vector r, SUNMatrix J, void *none, N_Vector a,
                    N_Vector b, N_Vector c)
{
    (void)r, (void)none, (void)a, (void)b, (void)c;
    int bad = sd_jacobian(t, V(y), V(yd), cj, p, entries);
    put(J, 1.0);
    return bad;
}

/* index form 0: r = yd - F(t, y) */
static int slopes(realtype t, N_Vector y, N_Vector f, void *none)
{
    (void)none;
    int bad = sd_residual(t, V(y), zero, p, V(f));
    for (int k = 0; k < sd_n_unknowns; k++)
        V(f)[k] = -V(f)[k];
    return bad;
}

static int slopes_jacobian(realtype t, N_Vector y, N_Vector f, SUNMatrix J, void *none, N_Vector a, N_Vector b, N_Vector c)
{
    (void)f, (void)none, (void)a, (void)b, (void)c;
    int bad = sd_jacobian(t, V(y), zero, 0.0, p, entries);
    put(J, -1.0);
    return bad;
}

int main(int number, char **argument)
{
    if (number < 8)
        return 2;
    int ida = !strcmp(argument[1], "ida"), adams = !strcmp(argument[1], "adams"), suppress = atoi(argument[3]);
    double epcon = atof(argument[4]), delta = atof(argument[5]), end = atof(argument[6]), seconds = atof(argument[7]);
    int n = sd_n_unknowns;
    klu = !strcmp(argument[2], "klu");
    p = malloc((size_t)(sd_n_parameters + 1) * sizeof *p);
    memcpy(p, sd_p0, (size_t)sd_n_parameters * sizeof *p);
    zero = calloc((size_t)n + 1, sizeof *zero);
    entries = calloc((size_t)sd_n_entries + 1, sizeof *entries);
    double *w = calloc((size_t)sd_n_outputs + 1, sizeof *w), began = now();
    int one = number > 8 ? atoi(argument[8]) : 0;
    for (int half = one ? one : 4; half <= (one ? one : 26); half++) {
        double rtol = pow(10.0, -0.5 * half), least = INFINITY, spent = 0.0;
        long steps = 0;
        int flag = 0;
        for (int again = 0; again < (one ? 1 : 5) && (again == 0 || spent < AGAIN) && flag >= 0; again++) {
            SUNContext context;
            SUNContext_Create(NULL, &context);
            N_Vector y = N_VNew_Serial(n, context), yd = N_VClone(y), id = N_VClone(y), atol = N_VClone(y);
            for (int k = 0; k < n; k++) {
                double size = sd_scale[k] > 0.0 ? sd_scale[k] : 1.0;
                V(y)[k] = sd_y0[k];
                V(yd)[k] = sd_yd0[k];
                V(id)[k] = sd_differential[k];
                V(atol)[k] = size * (ida && suppress && !sd_differential[k] ? fmax(rtol, 1e-2) : rtol);
            }
            SUNMatrix J = klu ? SUNSparseMatrix(n, n, sd_n_entries, CSC_MAT, context) : SUNDenseMatrix(n, n, context);
            SUNLinearSolver linear = klu ? SUNLinSol_KLU(y, J, context) : SUNLinSol_Dense(y, J, context);
            SUNNonlinearSolver fixed = NULL;
            void *solver = ida ? IDACreate(context) : CVodeCreate(adams ? CV_ADAMS : CV_BDF, context);
            double t = sd_t0, from = now();
            if (ida) {
                IDAInit(solver, residual, sd_t0, y, yd);
                IDASVtolerances(solver, rtol, atol);
                IDASetId(solver, id);
                IDASetSuppressAlg(solver, suppress);
                IDASetMaxNumSteps(solver, STEPS);
                IDASetLinearSolver(solver, linear, J);
                IDASetJacFn(solver, jacobian);
                IDASetNonlinConvCoef(solver, epcon);
                IDASetDeltaCjLSetup(solver, delta);
                IDASetErrFile(solver, NULL);
                IDASetStopTime(solver, end);
                flag = IDASolve(solver, end, &t, y, yd, IDA_NORMAL);
                IDAGetNumSteps(solver, &steps);
            } else {
                CVodeInit(solver, slopes, sd_t0, y);
                CVodeSVtolerances(solver, rtol, atol);
                CVodeSetMaxNumSteps(solver, STEPS);
                CVodeSetErrFile(solver, NULL);
                CVodeSetStopTime(solver, end);
                if (adams) {
                    fixed = SUNNonlinSol_FixedPoint(y, 0, context);
                    CVodeSetNonlinearSolver(solver, fixed);
                } else {
                    CVodeSetLinearSolver(solver, linear, J);
                    CVodeSetJacFn(solver, slopes_jacobian);
                }
                flag = CVode(solver, end, y, &t, CV_NORMAL);
                CVodeGetNumSteps(solver, &steps);
            }
            double took = now() - from;
            spent += took;
            least = fmin(least, took);
            if (flag >= 0) {
                memset(V(yd), 0, ida ? 0 : (size_t)n * sizeof(double));
                if (!ida) { /* outputs may read slopes */
                    sd_residual(t, V(y), zero, p, V(yd));
                    for (int k = 0; k < n; k++)
                        V(yd)[k] = -V(yd)[k];
                }
                sd_outputs(t, V(y), V(yd), p, w);
            }
            ida ? IDAFree(&solver) : CVodeFree(&solver);
            if (fixed)
                SUNNonlinSolFree(fixed);
            SUNLinSolFree(linear);
            SUNMatDestroy(J);
            N_VDestroy(y), N_VDestroy(yd), N_VDestroy(id), N_VDestroy(atol);
            SUNContext_Free(&context);
        }
        printf("%.17g %d %ld %.9g", rtol, flag, steps, least);
        for (int k = 0; k < sd_n_outputs; k++)
            printf(" %.17g", w[k]);
        printf("\n");
        fflush(stdout);
        if (now() - began > seconds)
            break;
    }
    return 0;
}
