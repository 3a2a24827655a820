/* Networks of capacitors, coils, resistors, sources and electronic switches by backward Euler: every node has a capacitor
 * to ground, what conducts is a conductance of CLOSED, what does not is none.  Error of the order of the step. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { DIODE, SWITCH, THYRISTOR, MOSFET, MOST = 8, SETS = 1 << MOST, ROUNDS = 60, AT_ONCE = 8 };
static const double CLOSED = 1e6, FORWARD = 0.7; /* S; V of a body diode */

typedef struct branch {
    int32_t a, b; /* nodes; as many as there are: ground */
    double r, l;  /* in series; l 0: a resistor */
} branch;

typedef struct source {
    int32_t node;
    double r, amplitude, frequency, phase;
} source;

typedef struct valve {
    int32_t kind, a, b;
    double r, delay, period, width; /* in series (of a MOSFET: its channel); gate */
} valve;

typedef struct net {
    int32_t nodes, branches, sources, valves;
    double c[MOST]; /* F */
    branch branch[MOST];
    source source[MOST];
    valve valve[MOST];
} net;

static int gate(const valve *v, double t)
{
    double since = fmod(t - v->delay, v->period);
    return (since < 0.0 ? since + v->period : since) < v->width;
}

static void add(const net *n, int size, double *m, int a, int b, double g)
{
    if (a < n->nodes)
        m[a * size + a] += g;
    if (b < n->nodes)
        m[b * size + b] += g;
    if (a < n->nodes && b < n->nodes) {
        m[a * size + b] -= g;
        m[b * size + a] -= g;
    }
}

static void invert(int n, double *m, double *inverse)
{
    memset(inverse, 0, (size_t)(n * n) * sizeof *m);
    for (int i = 0; i < n; i++)
        inverse[i * n + i] = 1.0;
    for (int i = 0; i < n; i++) {
        int p = i;
        for (int k = i; k < n; k++)
            p = fabs(m[k * n + i]) > fabs(m[p * n + i]) ? k : p;
        double pivot = m[p * n + i];
        for (int j = 0; j < n; j++) {
            double x = m[i * n + j], y = inverse[i * n + j];
            m[i * n + j] = m[p * n + j] / pivot;
            inverse[i * n + j] = inverse[p * n + j] / pivot;
            if (p != i) {
                m[p * n + j] = x;
                inverse[p * n + j] = y;
            }
        }
        for (int k = 0; k < n; k++) {
            double factor = m[k * n + i];
            for (int j = 0; j < n && k != i; j++) {
                m[k * n + j] -= factor * m[i * n + j];
                inverse[k * n + j] -= factor * inverse[i * n + j];
            }
        }
    }
}

/* The inverse for the valves (bits of `channels`) and diodes (bits of `diodes`) that conduct. */
static double *inverse_of(const net *n, int size, double h, uint32_t channels, uint32_t diodes)
{
    double m[4 * MOST * MOST] = {0.0}, *found = malloc((size_t)(size * size) * sizeof(double));
    for (int i = 0; i < n->nodes; i++)
        m[i * size + i] += n->c[i] / h;
    for (int k = 0; k < n->sources; k++)
        add(n, size, m, n->source[k].node, n->nodes, 1.0 / n->source[k].r);
    for (int k = 0, i = n->nodes; k < n->branches; k++) {
        const branch *b = &n->branch[k];
        if (b->l == 0.0) {
            add(n, size, m, b->a, b->b, 1.0 / b->r);
            continue;
        }
        m[i * size + i] += b->l / h + b->r;
        for (int side = -1; side <= 1; side += 2) {
            int node = side > 0 ? b->a : b->b;
            if (node < n->nodes) {
                m[node * size + i] += side;
                m[i * size + node] -= side;
            }
        }
        i++;
    }
    for (int k = 0; k < n->valves; k++) {
        const valve *v = &n->valve[k];
        if (channels >> k & 1)
            add(n, size, m, v->a, v->b, 1.0 / (v->r + 1.0 / CLOSED));
        if (v->kind == MOSFET && diodes >> k & 1)
            add(n, size, m, v->a, v->b, CLOSED);
    }
    invert(size, m, found);
    return found;
}

static double across(const net *n, const valve *v, const double *x)
{
    return (v->a < n->nodes ? x[v->a] : 0.0) - (v->b < n->nodes ? x[v->b] : 0.0);
}

/* Rows [rows + 1][nodes + coils] of equal distance; returned: steps without a set of diodes that fits. */
int converter(const net *n, double span, int64_t steps, int32_t rows, double *out)
{
    int size = n->nodes, without = 0;
    for (int k = 0; k < n->branches; k++)
        size += n->branch[k].l != 0.0;
    double h = span / (double)steps, x[2 * MOST] = {0.0}, next[2 * MOST], right[2 * MOST];
    double **inverse = calloc((size_t)SETS * SETS, sizeof *inverse);
    uint32_t on = 0, diodes = 0; /* valves whose gate lets them; diodes that conduct */
    for (int k = 0; k < n->valves; k++)
        on |= (uint32_t)(n->valve[k].kind == DIODE || gate(&n->valve[k], 0.0)) << k;
    memcpy(out, x, (size_t)size * sizeof *x);
    for (int64_t s = 1; s <= steps; s++) {
        double t = (double)s * h;
        for (int k = 0; k < n->valves; k++) {
            const valve *v = &n->valve[k];
            int open = v->kind == DIODE || gate(v, t - 1e-3 * h);
            if (open)
                on |= 1u << k;
            else if (v->kind != THYRISTOR)
                on &= ~(1u << k);
        }
        int round = 0;
        for (; round < ROUNDS; round++) {
            uint32_t channels = on, want = diodes;
            for (int k = 0; k < n->valves; k++)
                if (n->valve[k].kind == DIODE || n->valve[k].kind == THYRISTOR)
                    channels &= ~(1u << k) | diodes;
            double **known = &inverse[channels * SETS + diodes];
            if (!*known)
                *known = inverse_of(n, size, h, channels, diodes);
            for (int i = 0; i < n->nodes; i++)
                right[i] = n->c[i] / h * x[i];
            for (int k = 0, i = n->nodes; k < n->branches; k++)
                if (n->branch[k].l != 0.0) {
                    right[i] = n->branch[k].l / h * x[i];
                    i++;
                }
            for (int k = 0; k < n->sources; k++) {
                const source *u = &n->source[k];
                right[u->node] += u->amplitude * sin(u->frequency * t + u->phase) / u->r;
            }
            for (int k = 0; k < n->valves; k++)
                if (n->valve[k].kind == MOSFET && diodes >> k & 1) {
                    if (n->valve[k].b < n->nodes)
                        right[n->valve[k].b] += CLOSED * FORWARD;
                    if (n->valve[k].a < n->nodes)
                        right[n->valve[k].a] -= CLOSED * FORWARD;
                }
            for (int i = 0; i < size; i++) {
                next[i] = 0.0;
                for (int j = 0; j < size; j++)
                    next[i] += (*known)[i * size + j] * right[j];
            }
            for (int k = 0; k < n->valves; k++) {
                const valve *v = &n->valve[k];
                double u = across(n, v, next);
                int conducts = v->kind == MOSFET ? -u > FORWARD : v->kind != SWITCH && on >> k & 1 && u > 0.0;
                want = (want & ~(1u << k)) | (uint32_t)conducts << k;
            }
            if (want == diodes)
                break;
            uint32_t changed = want ^ diodes;
            diodes ^= round < AT_ONCE ? changed : changed & (~changed + 1u);
        }
        without += round == ROUNDS;
        for (int k = 0; k < n->valves; k++)
            if (n->valve[k].kind == THYRISTOR && !(diodes >> k & 1) && !gate(&n->valve[k], t))
                on &= ~(1u << k);
        memcpy(x, next, sizeof x);
        if (s % (steps / rows) == 0)
            memcpy(out + (size_t)(s / (steps / rows)) * (size_t)size, x, (size_t)size * sizeof *x);
    }
    for (size_t k = 0; k < (size_t)SETS * SETS; k++)
        free(inverse[k]);
    free(inverse);
    return without;
}
