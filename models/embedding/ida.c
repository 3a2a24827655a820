/* A pendulum by SUNDIALS IDA:
 *     sysdyn compile models/seed/pendulum.sd --scene reference -o pendulum
 *     cc -I pendulum models/embedding/ida.c pendulum/residual.c pendulum/binding.c -lsundials_ida -lsundials_nvecserial \
 *        -lsundials_sunlinsoldense -lsundials_sunmatrixdense -lm */
#include "sysdyn_model.h"

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <sunlinsol/sunlinsol_dense.h>

#define V(v) N_VGetArrayPointer(v)

static int residual(realtype t, N_Vector y, N_Vector yd, N_Vector r, void *p)
{
    return sd_residual(t, V(y), V(yd), p, V(r));
}

int main(void)
{
    double p[256], w[64], t = sd_t0; /* sd_n_parameters, sd_n_outputs of them are used */
    for (int k = 0; k < sd_n_parameters; k++)
        p[k] = sd_p0[k];
    p[1] = 1.2; /* l in m: "place" of binding.json */
    SUNContext context;
    SUNContext_Create(NULL, &context);
    N_Vector y = N_VNew_Serial(sd_n_unknowns, context), yd = N_VClone(y), id = N_VClone(y), atol = N_VClone(y);
    if (sd_follow(p) || sd_start(p, V(y), V(yd)))
        return 1;
    for (int k = 0; k < sd_n_unknowns; k++) { /* multipliers follow from the state: they are not in the error test */
        V(id)[k] = sd_differential[k];
        V(atol)[k] = sd_scale[k] * (sd_differential[k] ? 1e-9 : 1.0);
    }
    void *ida = IDACreate(context);
    SUNMatrix J = SUNDenseMatrix(sd_n_unknowns, sd_n_unknowns, context);
    IDAInit(ida, residual, t, y, yd);
    IDASVtolerances(ida, 1e-8, atol);
    IDASetUserData(ida, p);
    IDASetId(ida, id);
    IDASetSuppressAlg(ida, 1);
    IDASetMaxNumSteps(ida, 100000);
    IDASetLinearSolver(ida, SUNLinSol_Dense(y, J, context), J);
    if (IDASolve(ida, 4.0, &t, y, yd, IDA_NORMAL) < 0 || sd_outputs(t, V(y), V(yd), p, w))
        return 1;
    printf("%.9f %.9f\n", w[0], w[1]); /* q1 and q2 in m */
    return 0;
}
