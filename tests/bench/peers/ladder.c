/* The RC ladder of models/benchmark with one unknown a node, written by hand for SUNDIALS IDA with KLU: the peer of steps.py.
 *
 *     ladder N RTOL DELTACJ
 *
 * One line: steps, CPU seconds of the integration from 0 to 1 s, voltage of the last node at ten instants.  Residual and
 * Jacobian cost next to nothing here: what is left is IDA.  DELTACJ: change of cj that it refactors for (0.25 by default). */
#include "run_ida.h"

static int n;

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
    return run(n, 3, atof(argument[2]), atof(argument[3]), residual, jacobian);
}
