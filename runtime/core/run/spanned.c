/* Points of the polynomial through settled ones: see spanned.h. */
#include "run/spanned.h"
#include "linear/lanes.h"
#include "system/settle_shown.h"

#include <math.h>
#include <string.h>

#define FEWEST 16   /* rows within a step from which on: nodes and looks are 11 */
#define DOUBLED 40  /* ... where nodes may be twice as many */
#define LOOKS 2     /* points between nodes at which it is tried */
#define APART 1e-4  /* of the tolerance: how far it may be off there, in magnitudes, and */
#define CLOSE 1e-7  /* no more than this */
#define PATIENCE 6  /* steps of which this many could not be told: one in 2^(this) is tried at most */

/* Chebyshev's points of the second kind, (1 - cos(k pi / 16)) / 2, as parts of a step; every second one: those of 8 */
static const double node[SD_SPANNING] = {
    0.0, 0.009607359798384785, 0.03806023374435663, 0.08426519384872738, 0.1464466094067262, 0.22221488349019886,
    0.3086582838174551, 0.40245483899193585, 0.5, 0.5975451610080641, 0.6913417161825448, 0.777785116509801,
    0.8535533905932737, 0.9157348061512727, 0.9619397662556434, 0.9903926402016152, 1.0};
/* parts of a step between nodes of either kind: of angles 4.5 and 10.5 */
static const double look[LOOKS] = {0.1828033579181773, 0.7356983684129988};

/* share [nodes]: of each node in the polynomial at the part x of the step (Berrut & Trefethen, Barycentric Lagrange
 * interpolation, 5.4: of these points 1/2, -1, 1, ..., 1/2) */
static void shares(int32_t nodes, double x, double *share)
{
    const int32_t last = nodes - 1, stride = (SD_SPANNING - 1) / last;
    double sum = 0.0;
    for (int32_t k = 0; k <= last; k++) {
        const double apart = x - node[k * stride], half = k == 0 || k == last ? 0.5 : 1.0;
        if (apart == 0.0) {
            memset(share, 0, (size_t)nodes * sizeof *share);
            share[k] = 1.0;
            return;
        }
        share[k] = (k % 2 ? -half : half) / apart;
        sum += share[k];
    }
    for (int32_t k = 0; k <= last; k++)
        share[k] /= sum;
}

/* numbers of a point, in whole lanes: unknowns of the settler, their rates */
static int32_t width(const sd_run *run)
{
    return 2 * sd_whole_lanes(run->settle->unknowns);
}

/* point [n] := the sum of so many nodes [n], `step` numbers from one to the next, each times its share */
static inline __attribute__((always_inline)) void sum_up(const double *first, const int32_t nodes, size_t step,
                                                         const double *share, int32_t n, double *point)
{
    for (int32_t i = 0; i < n; i += SD_LANES) {
        const double *from = first + i;
        sd_lanes sum = {0.0};
        for (int32_t k = 0; k < nodes; k++)
            sum += share[k] * SD_FROM(from, (size_t)k * step);
        SD_AT(point, i) = sum;
    }
}

/* point [width] := that of the polynomial at the part x of the step */
SD_WIDE static void interpolate(const sd_run *run, double x, double *point)
{
    const int32_t n = width(run);
    double share[SD_SPANNING];
    shares(run->spanned, x, share);
    if (run->spanned == SD_SPANNING)
        sum_up(run->spanning, SD_SPANNING, (size_t)n, share, n, point);
    else
        sum_up(run->spanning, SD_SPANNING / 2 + 1, 2 * (size_t)n, share, n, point);
}

/* point [width] := the settled one at the part x of the step; 1: it does not settle */
static int settle(sd_run *run, double x, double *point)
{
    sd_settle *settle = run->settle;
    const double t = x < 1.0 ? run->t_from + x * (run->t_to - run->t_from) : run->t_to, enough = settle->enough;
    const int64_t failures = settle->failures;
    double *rate = point + width(run) / 2;
    run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
    settle->enough = 0.0; /* of a draft too: what is left open of nodes is in all rows */
    if (!settle->system->left)
        sd_run_settle(run, t);
    sd_settle_take_point(settle, run->point, run->point_d, point, rate);
    if (settle->system->left)
        sd_settle_kept(settle, t, point, rate);
    settle->enough = enough;
    return settle->failures > failures;
}

/* how far two points are apart, in magnitudes */
static double apart(const sd_settle *settle, const double *a, const double *b, int32_t n)
{
    double most = 0.0;
    for (int32_t j = 0; j < settle->unknowns; j++)
        most = fmax(most, fabs(a[j] - b[j]) / settle->scale[j]);
    for (int32_t k = 0; k < settle->rates; k++) {
        const int32_t j = n + settle->rate[k];
        most = fmax(most, fabs(a[j] - b[j]) / settle->scale[settle->unknowns + k]);
    }
    return most;
}

/* whether the polynomial through so many nodes is where it should be at points between them, `looked`; more: there might be
 * more of them, and its rows are to hold there too */
static int serves(sd_run *run, int32_t nodes, const double *looked, int more)
{
    const int32_t n = width(run);
    const double enough = fmin(CLOSE, APART * run->stepper->ivp->rtol);
    double *point = run->spanning + (size_t)(SD_SPANNING + LOOKS) * (size_t)n;
    run->spanned = nodes;
    for (int32_t k = 0; k < LOOKS; k++) {
        interpolate(run, look[k], point);
        if (!(apart(run->settle, point, looked + (size_t)k * (size_t)n, n / 2) <= enough))
            return 0;
        const double t = run->t_from + look[k] * (run->t_to - run->t_from);
        if (more && !sd_settle_between(run->settle, t, point, point + n / 2, run->point, run->point_d))
            return 0;
    }
    return 1;
}

/* nodes of the last step, as many as serve of 9 and, where there are rows for it, 17; 0: none do */
static int32_t find_nodes(sd_run *run, int32_t rows)
{
    const int32_t n = width(run), last = SD_SPANNING - 1;
    double *looked = run->spanning + (size_t)SD_SPANNING * (size_t)n;
    for (int32_t k = 0; k <= last; k += 2)
        if (settle(run, node[k], run->spanning + (size_t)k * (size_t)n))
            return 0;
    for (int32_t k = 0; k < LOOKS; k++)
        if (settle(run, look[k], looked + (size_t)k * (size_t)n))
            return 0;
    if (serves(run, SD_SPANNING / 2 + 1, looked, rows >= DOUBLED))
        return SD_SPANNING / 2 + 1;
    for (int32_t k = 1; k < last && rows >= DOUBLED; k += 2)
        if (settle(run, node[k], run->spanning + (size_t)k * (size_t)n))
            return 0;
    return rows >= DOUBLED && serves(run, SD_SPANNING, looked, 0) ? SD_SPANNING : 0;
}

/* rows of the trace within the last step that are still to be written */
static int32_t rows_left(const sd_run *run)
{
    int32_t k = run->next, most = run->next + DOUBLED;
    while (k < run->instants && k < most && run->instant[k] < run->t_to)
        k++;
    return k - run->next + 1; /* one is being written */
}

/* whether nodes are to be looked for: not in each step where they told nothing of late */
static int tries(sd_run *run)
{
    const int32_t often = run->strayed < PATIENCE ? run->strayed : PATIENCE;
    return run->spanning && !run->least_norm && run->audit_at[6] < 0 && !run->stepper->part_y
        && ++run->skipped >= (1 << often);
}

int sd_run_spans(sd_run *run, int32_t kind)
{
    if (run->spanned || !(kind & SD_TRACE))
        return run->spanned > 0;
    const int32_t rows = rows_left(run);
    run->spanned = -1;
    if (rows < FEWEST || !tries(run))
        return 0;
    run->skipped = 0;
    const int32_t nodes = find_nodes(run, rows);
    run->strayed = nodes ? 0 : run->strayed + 1;
    run->spanned = nodes ? nodes : -1;
    return nodes > 0;
}

int sd_run_span(sd_run *run, double t)
{
    const int32_t n = width(run);
    double *point = run->spanning + (size_t)(SD_SPANNING + LOOKS) * (size_t)n;
    interpolate(run, (t - run->t_from) / (run->t_to - run->t_from), point);
    return sd_settle_between(run->settle, t, point, point + n / 2, run->point, run->point_d);
}
