/* Integrates an exported model with SUNDIALS IDA and prints its outputs, one line an instant.
 *
 * Arguments: a file of rtol; number, and place and value of each changed parameter; a factor, number and places of unknowns
 * whose tolerance is that part of their scale; instants.  Algebraic unknowns are out of the error test.  Line 0 of the output: the codes of sd_follow and sd_start. */
#include "sysdyn_model.h"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#define V(v) N_VGetArrayPointer(v)

static int residual(realtype t, N_Vector y, N_Vector yd, N_Vector r, void *p)
{
    return sd_residual(t, V(y), V(yd), p, V(r));
}

static double *values;

static int jacobian(realtype t, realtype cj, N_Vector y, N_Vector yd, N_Vector r, SUNMatrix J, void *p, N_Vector a, N_Vector b,
                    N_Vector c)
{
    (void)r, (void)a, (void)b, (void)c;
    int code = sd_jacobian(t, V(y), V(yd), cj, p, values);
    SUNMatZero(J);
    for (int32_t k = 0; k < sd_n_unknowns; k++)
        for (int32_t e = sd_colptr[k]; e < sd_colptr[k + 1]; e++)
            SM_ELEMENT_D(J, sd_rowind[e], k) = values[e];
    return code;
}

int main(int argc, char **argv)
{
    FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
    double rtol, *p = malloc((size_t)sd_n_parameters * sizeof *p + 8), value;
    int number, place;
    if (!file || fscanf(file, "%lf %d", &rtol, &number) != 2)
        return 2;
    memcpy(p, sd_p0, (size_t)sd_n_parameters * sizeof *p);
    long first = ftell(file);
    int codes[2] = {0, 0};
    for (int pass = 0; pass < 2; pass++) { /* what follows is written anew, what was given stays */
        fseek(file, first, SEEK_SET);
        for (int k = 0; k < number; k++) {
            if (fscanf(file, "%d %lf", &place, &value) != 2)
                return 2;
            p[place] = value;
        }
        if (pass == 0)
            codes[0] = sd_follow(p);
    }
    SUNContext context;
    SUNContext_Create(NULL, &context);
    N_Vector y = N_VNew_Serial(sd_n_unknowns, context), yd = N_VClone(y), id = N_VClone(y), atol = N_VClone(y);
    codes[1] = sd_start(p, V(y), V(yd));
    printf("%d %d\n", codes[0], codes[1]);
    values = malloc((size_t)sd_n_entries * sizeof *values + 8);
    for (int32_t k = 0; k < sd_n_unknowns; k++) {
        V(id)[k] = sd_differential[k];
        V(atol)[k] = rtol * 1e-2 * sd_scale[k];
    }
    /* Newton's test must not ask of a multiplier what a small step cannot give: it follows from the state */
    for (int loose = fscanf(file, "%lf %d", &value, &number) == 2 ? number : 0; loose > 0; loose--)
        if (fscanf(file, "%d", &place) == 1)
            V(id)[place] = 0.0, V(atol)[place] = value * sd_scale[place];
    void *ida = IDACreate(context);
    SUNMatrix J = SUNDenseMatrix(sd_n_unknowns, sd_n_unknowns, context);
    IDAInit(ida, residual, sd_t0, y, yd);
    IDASVtolerances(ida, rtol, atol);
    IDASetUserData(ida, p);
    IDASetId(ida, id);
    IDASetSuppressAlg(ida, 1);
    IDASetMaxNumSteps(ida, 2000000);
    IDASetLinearSolver(ida, SUNLinSol_Dense(y, J, context), J);
    IDASetJacFn(ida, jacobian);
    double *w = calloc((size_t)sd_n_outputs + 1, sizeof *w), t, at;
    int code = 0;
    while (code >= 0 && fscanf(file, "%lf", &t) == 1) {
        at = t;
        if (t > sd_t0)
            code = IDASolve(ida, t, &at, y, yd, IDA_NORMAL);
        if (code < 0)
            return 3;
        if (sd_outputs(at, V(y), V(yd), p, w))
            return 4;
        for (int32_t k = 0; k < sd_n_outputs; k++)
            printf("%.17g ", w[k]);
        printf("\n");
    }
    return 0;
}
