/* Shafts with springs and dampers, dry friction, ratchets, walls with restitution and latches, by Moreau's time stepping:
 * the smooth part by the midpoint, the impulses of a step by projected Gauss-Seidel.  Error of the order of the step. */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { FRICTION, RATCHET, WALL, LATCH, MOST = 8 };

typedef struct contact {
    int32_t kind;
    double along[MOST]; /* of the speeds */
    double a, b, c;     /* friction: bound a (1 + b sin c t); wall: position a, restitution b; latch: closed from a on */
} contact;

static void invert(int n, double m[MOST][2 * MOST])
{
    for (int i = 0; i < n; i++) {
        double pivot = m[i][i];
        for (int j = 0; j < 2 * n; j++)
            m[i][j] /= pivot;
        for (int k = 0; k < n; k++) {
            double factor = m[k][i];
            for (int j = 0; j < 2 * n && k != i; j++)
                m[k][j] -= factor * m[i][j];
        }
    }
}

/* what an impulse becomes in one sweep */
static double pushed(const contact *c, double impulse, double bound)
{
    if (c->kind == FRICTION)
        return fmax(-bound, fmin(bound, impulse));
    return c->kind == LATCH ? impulse : fmax(impulse, 0.0);
}

/* q, v [n] from the start to T in equal steps; rows [count, 2 n] at equal times; load [n, 3]: amplitude, frequency, phase
 * kick: step, shaft and speed that is given there */
void shafts(int n, int number, const double *M, const double *K, const double *C, const double *load,
            const contact *contacts, const double *kick, double T, int steps, int count, double *q, double *v, double *rows)
{
    double h = T / steps, m[MOST][2 * MOST], across[16][MOST], G[16][16], impulse[16] = {0};
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            m[i][j] = M[i * n + j] + h / 2 * C[i * n + j] + h * h / 4 * K[i * n + j];
            m[i][n + j] = i == j;
        }
    invert(n, m);
    for (int c = 0; c < number; c++)
        for (int i = 0; i < n; i++) {
            across[c][i] = 0.0;
            for (int j = 0; j < n; j++)
                across[c][i] += m[i][n + j] * contacts[c].along[j];
        }
    for (int c = 0; c < number; c++)
        for (int d = 0; d < number; d++) {
            G[c][d] = 0.0;
            for (int i = 0; i < n; i++)
                G[c][d] += contacts[c].along[i] * across[d][i];
        }
    for (int s = 0; s < steps; s++) {
        double t = s * h, r[MOST], next[MOST], u[16], bound[16];
        int open[16];
        if (s == (int)kick[0])
            v[(int)kick[1]] = kick[2];
        for (int i = 0; i < n; i++) {
            r[i] = h * load[3 * i] * sin(load[3 * i + 1] * (t + h / 2) + load[3 * i + 2]);
            for (int j = 0; j < n; j++)
                r[i] += M[i * n + j] * v[j] - h * (K[i * n + j] * (q[j] + h / 4 * v[j]) + C[i * n + j] / 2 * v[j]);
        }
        for (int i = 0; i < n; i++) {
            next[i] = 0.0;
            for (int j = 0; j < n; j++)
                next[i] += m[i][n + j] * r[j];
        }
        for (int c = 0; c < number; c++) {
            double gap = -contacts[c].a, before = 0.0;
            u[c] = 0.0;
            for (int i = 0; i < n; i++) {
                gap += contacts[c].along[i] * (q[i] + h / 2 * v[i]);
                before += contacts[c].along[i] * v[i];
                u[c] += contacts[c].along[i] * next[i];
            }
            bound[c] = h * contacts[c].a * (1 + contacts[c].b * sin(contacts[c].c * (t + h / 2)));
            open[c] = (contacts[c].kind == WALL && gap > 0) || (contacts[c].kind == LATCH && t < contacts[c].a - 1e-12);
            impulse[c] = open[c] ? 0.0 : impulse[c];
            u[c] += contacts[c].kind == WALL && !open[c] ? contacts[c].b * fmin(before, 0.0) : 0.0;
        }
        for (int c = 0; c < number; c++)
            for (int d = 0; d < number; d++)
                u[c] += G[c][d] * impulse[d];
        for (int k = 0; k < 20000; k++) {
            double change = 0.0, largest = 1e-300;
            for (int c = 0; c < number; c++) {
                double now = open[c] ? 0.0 : pushed(&contacts[c], impulse[c] - u[c] / G[c][c], bound[c]);
                double moved = now - impulse[c];
                impulse[c] = now;
                for (int d = 0; d < number && moved != 0.0; d++)
                    u[d] += G[d][c] * moved;
                change = fmax(change, fabs(moved));
                largest = fmax(largest, fabs(now));
            }
            if (change < 1e-13 * largest || change < 1e-18)
                break;
        }
        for (int i = 0; i < n; i++) {
            for (int c = 0; c < number; c++)
                next[i] += across[c][i] * impulse[c];
            q[i] += h / 2 * (v[i] + next[i]);
            v[i] = next[i];
        }
        if ((s + 1) % (steps / count) == 0) {
            double *row = rows + ((s + 1) / (steps / count) - 1) * 2 * n;
            memcpy(row, q, (size_t)n * sizeof *q);
            memcpy(row + n, v, (size_t)n * sizeof *v);
        }
    }
}
