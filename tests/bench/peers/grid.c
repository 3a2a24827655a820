/* The grid of steps.py with one unknown a node, written by hand for SUNDIALS IDA with KLU.
 *
 *     grid N RTOL DELTACJ
 *
 * One line as ladder.c. */
#include "run_ida.h"

static int n, side;

/* The neighbours of node k, number of them: nodes count from the one behind the source, -1 is the source. */
static int neighbours(int k, int *found)
{
    int i = (k + 1) / side, j = (k + 1) % side, m = 0;
    if (i > 0)
        found[m++] = k - side;
    if (j > 0)
        found[m++] = k - 1;
    if (j + 1 < side)
        found[m++] = k + 1;
    if (i + 1 < side)
        found[m++] = k + side;
    return m;
}

/* C v' = sum of the neighbours' v - v with R = 1 ohm, C = 1 F / N^2 */
static int residual(realtype t, N_Vector y, N_Vector yd, N_Vector r, void *none)
{
    (void)none;
    const double *v = V(y), *vd = V(yd);
    double *out = V(r), c = 1.0 / ((double)side * side), fed = source(t);
    for (int k = 0; k < n; k++) {
        int near[4], m = neighbours(k, near);
        double sum = c * vd[k];
        for (int e = 0; e < m; e++)
            sum += v[k] - (near[e] < 0 ? fed : v[near[e]]);
        out[k] = sum;
    }
    return 0;
}

static int jacobian(realtype t, realtype cj, N_Vector y, N_Vector yd, N_Vector r, SUNMatrix J, void *none, N_Vector a,
                    N_Vector b, N_Vector d)
{
    (void)t, (void)y, (void)yd, (void)r, (void)none, (void)a, (void)b, (void)d;
    sunindextype *start = SUNSparseMatrix_IndexPointers(J), *row = SUNSparseMatrix_IndexValues(J), e = 0;
    double *value = SUNSparseMatrix_Data(J), c = 1.0 / ((double)side * side);
    for (int k = 0; k < n; k++) {
        int near[4], m = neighbours(k, near), own = 0;
        start[k] = e;
        for (int l = 0; l < m; l++) {
            if (!own && near[l] > k) {
                row[e] = k;
                value[e++] = cj * c + m;
                own = 1;
            }
            if (near[l] >= 0) {
                row[e] = near[l];
                value[e++] = -1.0;
            }
        }
        if (!own) {
            row[e] = k;
            value[e++] = cj * c + m;
        }
    }
    start[n] = e;
    return 0;
}

int main(int number, char **argument)
{
    if (number < 4)
        return 2;
    side = atoi(argument[1]);
    n = side * side - 1;
    return run(n, 5, atof(argument[2]), atof(argument[3]), residual, jacobian);
}
