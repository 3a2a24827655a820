/* Integrals of powers over the last step: see quadratures.h. */
#include "run/meters/quadratures.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "linear/lanes.h"

/* Of the tolerance, and of the powers themselves: what the last term may be.  A balance is judged by ten tolerances at least, and
 * what is left behind the last term is less by as much again: sums over a run are off by 0.001 to 0.007 tolerances (a grid, a
 * ladder).  With a tenth every second step needs two points more. */
#define LITTLE 1.0
/* Rows within a step from which on the powers at SD_NODES of its points tell all their sums: a row of its own takes two to four */
#define MANY 4
enum { POINTS = SD_PAST + 3 }; /* at which powers are known where steps before tell */
#define PLAIN 5 /* nodes up to which their polynomial is known by the factors of s^k, s the part of the step */

/* inner points of Lobatto's rule of eight, and the end; its weights behind that of the start, which is that of the end */
static const double lobatto[SD_NODES] = {0.06412992574519594, 0.2041499092834289, 0.39535039104876046, 0.6046496089512394,
                                         0.7958500907165711, 0.9358700742548041, 1.0};
static const double lobatto_weight[SD_NODES] = {0.10535211357175306, 0.1705613462417522, 0.20622939732935197, 0.20622939732935197,
                                                0.1705613462417522, 0.10535211357175306, 1.0 / 56.0};

void sd_run_audit(const sd_run *run, double t, const double *y, const double *yd, double *out)
{
    memset(out, 0, (size_t)run->audited * sizeof *out);
    if (run->audit)
        run->audit->rows(&run->audit->frame, t, y, yd, out);
}

/* out [audited]: the same, energies but for those that come with powers */
static void powers(sd_run *run, double t, const double *y, const double *yd, double *out)
{
    memset(out, 0, (size_t)run->audited * sizeof(double));
    run->powers->rows(&run->powers->frame, t, y, yd, out);
}

/* run->integral += weight * values */
static void weigh(sd_run *run, const double *values, double weight)
{
    for (int32_t k = 2; k < run->audited; k++)
        run->integral[k] += weight * values[k];
}

/* point at t within the last step, and point_d where what is audited reads it */
static void look(sd_run *run, double t)
{
    const sd_stepper *stepper = run->stepper;
    if (stepper->values && !run->rated)
        stepper->values(stepper->self, t, run->point);
    else
        stepper->dense(stepper->self, t, run->point, run->point_d);
}

/* the same at the end of what is integrated, all of it where that is not the end of the step */
static void look_at_end(sd_run *run, double to)
{
    if (run->sampled)
        look(run, to);
    else
        run->stepper->dense(run->stepper->self, to, run->point, run->point_d);
}

/* Gauss's rules on -1/2 .. 1/2, of two and of four points: polynomials of degree 3 and 7 are integrated exactly */
static const double gauss[2][4] = {{-0.28867513459481288225, 0.28867513459481288225},
                                   {-0.43056815579702628761, -0.16999052179242812840, 0.16999052179242812840,
                                    0.43056815579702628761}};
static const double gauss_weight[2][4] = {{0.5, 0.5},
                                          {0.17392742256872692869, 0.32607257743127307131, 0.32607257743127307131,
                                           0.17392742256872692869}};

/* share [nodes + 1]: int_0^to of the polynomials of degree `nodes` that are 1 at the step's start, at each node place
 * [nodes], and 0 at the others, by Gauss's rule of degree 3 or 7 */
static void shares(int32_t nodes, const double *place, double to, double *share)
{
    int high = nodes > 3, points = nodes + 1;
    double node[SD_NODES + 1] = {0.0};
    memcpy(node + 1, place, (size_t)nodes * sizeof *node);
    for (int k = 0; k < points; k++)
        share[k] = 0.0;
    for (int p = 0; p < (high ? 4 : 2); p++) {
        double s = to * (0.5 + gauss[high][p]), before = gauss_weight[high][p], behind[SD_NODES + 2];
        behind[points] = 1.0;
        for (int k = points - 1; k > 0; k--)
            behind[k] = behind[k + 1] * (s - node[k]);
        for (int k = 0; k < points; k++) {
            share[k] += before * behind[k + 1];
            before *= s - node[k];
        }
    }
    for (int k = 0; k < points; k++) {
        double own = 1.0;
        for (int j = 0; j < points; j++)
            own *= j == k ? 1.0 : node[k] - node[j];
        share[k] *= to / own;
    }
}

/* length of the last step */
static double length_of(const sd_run *run)
{
    return run->stepper->length ? *run->stepper->length : run->stepper->ivp->t - run->t_from;
}

/* the method's own quadrature over the part `part` of the last step */
static void integrate_nodes(sd_run *run, double part)
{
    const sd_stepper *stepper = run->stepper;
    double from = run->t_from, h = length_of(run), share[SD_NODES + 1];
    run->noded = stepper->collocated ? stepper->nodes : 0;
    memcpy(run->node, stepper->node, (size_t)run->noded * sizeof *run->node);
    if (part < 1.0) { /* the whole step takes nothing of its start */
        shares(stepper->nodes, stepper->node, part, share);
        weigh(run, run->power, h * share[0]);
    }
    for (int32_t k = 0; k < stepper->nodes; k++) {
        double weight = part < 1.0 ? share[k + 1] : stepper->node_weight[k];
        if (weight == 0.0) {
            run->noded = 0;
            continue;
        }
        if (stepper->show)
            stepper->show(stepper->self, k, run->point, run->point_d);
        const double *y = stepper->show ? run->point : stepper->node_y[k];
        powers(run, from + stepper->node[k] * h, y, stepper->show ? run->point_d : stepper->node_yd[k],
               run->sample);
        weigh(run, run->sample, h * weight);
        if (stepper->collocated)
            memcpy(run->node_power[k], run->sample + 2, sizeof run->node_power[k]);
    }
    for (int32_t k = 2; stepper->moves && k < run->audited; k++)
        run->integral[k] += stepper->moves[k];
}

/* rows dissipated and supplied, of all and of each ledger: what the past leaves open of both is little of the sums */
static int sure(const sd_run *run, const double *open)
{
    const double little = LITTLE * run->stepper->ivp->rtol;
    for (int32_t k = 2; k + 1 < run->audited; k += k == 2 ? SD_LEDGER_ROWS - 1 : SD_LEDGER_ROWS) {
        const double *sum = run->integral + k, *left = open + k;
        if (!(fabs(left[0]) + fabs(left[1]) <= little * (fabs(sum[0]) + fabs(sum[1]))))
            return 0;
    }
    return 1;
}

/* sum, left [audited], in whole lanes, := rows times their two weights; energies, which come first, have no integral */
static SD_WIDE void weigh_all(int32_t audited, const double *const rows[POINTS], const double own[POINTS],
                              const double last[POINTS], double *sum, double *left)
{
    for (int32_t k = 0; k < audited; k += SD_LANES) {
        sd_lanes a = {0.0}, b = {0.0};
        for (int i = 0; i < POINTS; i++) {
            const sd_lanes row = SD_FROM(rows[i], k);
            a += own[i] * row;
            b += last[i] * row;
        }
        SD_AT(sum, k) = a;
        SD_AT(left, k) = b;
    }
    sum[0] = sum[1] = 0.0;
}

/* By the polynomial through powers at the ends and in the middle of the step, and at the starts p of those before it: Simpson's rule
 * and, in parts s of the step, w = s (s - 1/2) (s - 1),
 *     int w (s - p_1) ds f[0, 1/2, 1, p_1, p_2] + int w (s - p_1) (s - p_2) ds f[0, 1/2, 1, p_1, p_2, p_3],
 * where int w = int w (s - 1/2)^2 = 0, int w (s - 1/2) = -1/120.  0: the last term is not little, or there is none. */
static int integrate_past(sd_run *run, double to)
{
    static const double simpson[POINTS] = {1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0};
    const double *rows[POINTS] = {run->power, run->middle, run->sample}, from = run->t_from, h = to - from;
    double at[POINTS] = {0.0, 0.5, 1.0}, *open = run->work;
    if (run->pasts < SD_PAST)
        return 0;
    for (int k = 0; k < SD_PAST; k++) {
        at[3 + k] = (run->t_past[k] - from) / h;
        rows[3 + k] = run->past[k];
    }
    const double higher = (at[3] + at[4] - 1.0) / 120.0 * h, lower = -h / 120.0;
    double own[POINTS], last[POINTS];
    for (int i = 0; i < POINTS; i++) {
        double product = i < 3 ? 0.5 * (i == 1 ? -0.5 : 1.0) : at[i] * (at[i] - 0.5) * (at[i] - 1.0);
        for (int j = 3; j < POINTS; j++)
            product *= i == j ? 1.0 : at[i] - at[j];
        if (!(fabs(product) >= DBL_MIN)) /* steps below the resolution of time share an instant */
            return 0;
        const double difference = 1.0 / product;
        last[i] = higher * difference;
        own[i] = h * simpson[i] + lower * (at[i] - at[POINTS - 1]) * difference + last[i];
    }
    weigh_all(run->audited, rows, own, last, run->integral, open);
    return sure(run, open);
}

/* by Lobatto's rule of five points, two more than are known */
static void integrate_lobatto(sd_run *run, double to)
{
    static const double inner = 0.32732683535398857190; /* sqrt(21) / 14 */
    double from = run->t_from, h = to - from;
    memset(run->integral, 0, (size_t)run->audited * sizeof(double));
    for (int k = -1; k <= 1; k += 2) {
        double t = from + (0.5 + k * inner) * h;
        look(run, t);
        powers(run, t, run->point, run->point_d, run->work);
        weigh(run, run->work, 49.0 / 180.0 * h);
    }
    weigh(run, run->power, 0.05 * h);
    weigh(run, run->middle, 16.0 / 45.0 * h);
    weigh(run, run->sample, 0.05 * h);
}

int sd_run_integrate(sd_run *run, double to)
{
    const sd_stepper *stepper = run->stepper;
    double from = run->t_from, middle = 0.5 * (to + from);
    memset(run->integral, 0, (size_t)run->audited * sizeof(double));
    run->sampled = 0;
    if (!run->audit || to == from)
        return 0;
    if (stepper->nodes && (to == stepper->ivp->t || stepper->collocated)) {
        integrate_nodes(run, to == stepper->ivp->t ? 1.0 : (to - from) / (stepper->ivp->t - from));
        return 0;
    }
    if (stepper->part_y) {
        stepper->dense(stepper->self, to, run->point, run->point_d);
        for (int32_t k = 0; k < stepper->nodes; k++) {
            powers(run, from + stepper->node[k] * (to - from), stepper->part_y[k], stepper->part_yd[k], run->sample);
            weigh(run, run->sample, (to - from) * stepper->node_weight[k]);
        }
        for (int32_t k = 2; stepper->part_moves && k < run->audited; k++)
            run->integral[k] += stepper->part_moves[k];
        return 1;
    }
    look(run, middle);
    powers(run, middle, run->point, run->point_d, run->middle);
    run->sampled = to == stepper->ivp->t;
    look_at_end(run, to);
    sd_run_audit(run, to, run->point, run->point_d, run->sample);
    const int known = integrate_past(run, to);
    run->by_past = known && run->sampled;
    if (!known) {
        integrate_lobatto(run, to);
        look_at_end(run, to);
    }
    return !run->sampled;
}

/* whether the nodes of the method are those of the powers within the last step (of none it has slopes there: radau_dense.c) */
static int has_own(const sd_stepper *stepper)
{
    return stepper->collocated && stepper->nodes;
}

/* whether as many rows stand within the last step, all of which counts, of a method that has no polynomial of its own */
static int is_crowded(const sd_run *run)
{
    const sd_stepper *stepper = run->stepper;
    int32_t last = run->next + MANY - 2; /* the first of them is being written */
    return run->audit && !has_own(stepper) && !stepper->part_y && run->t_to == stepper->ivp->t && last < run->instants
        && run->instant[last] < run->t_to;
}

/* Powers at Lobatto's points of the last step, of which the integrals over it are known.  0: they miss these by more than what
 * they are judged by, as where a law has a corner within the step */
static int look_within(sd_run *run)
{
    const double from = run->t_from, h = run->t_to - from;
    double missed[2], size[2];
    for (int i = 0; i < 2; i++) {
        missed[i] = h * lobatto_weight[SD_NODES - 1] * run->power[2 + i] - run->integral[2 + i];
        size[i] = fabs(run->integral[2 + i]);
    }
    memcpy(run->node, lobatto, sizeof lobatto);
    for (int32_t k = 0; k < SD_NODES; k++) {
        const double *values = run->after;
        if (k < SD_NODES - 1) {
            look(run, from + lobatto[k] * h);
            powers(run, from + lobatto[k] * h, run->point, run->point_d, run->work);
            values = run->work;
        }
        for (int i = 0; i < 2; i++) {
            run->node_power[k][i] = values[2 + i];
            missed[i] += h * lobatto_weight[k] * values[2 + i];
        }
    }
    return fabs(missed[0]) + fabs(missed[1]) <= LITTLE * run->stepper->ivp->rtol * (size[0] + size[1]);
}

/* Powers at the middle and the end of the last step and at the starts of those before it: the polynomial by which its integrals
 * are known, and within the step is off by no more than there. */
static void look_back(sd_run *run)
{
    const double from = run->t_from, h = run->t_to - from;
    run->node[0] = 0.5;
    run->node[1] = 1.0;
    memcpy(run->node_power[0], run->middle + 2, sizeof run->node_power[0]);
    memcpy(run->node_power[1], run->after + 2, sizeof run->node_power[1]);
    for (int k = 0; k < SD_PAST; k++) {
        run->node[2 + k] = (run->t_past[k] - from) / h;
        memcpy(run->node_power[2 + k], run->past[k] + 2, sizeof run->node_power[2 + k]);
    }
}

/* so many powers within or around the last step tell the sums up to its rows; -1: none do */
static int32_t find_powers(sd_run *run)
{
    if (run->by_past && run->t_to == run->stepper->ivp->t) {
        look_back(run);
        return 2 + SD_PAST;
    }
    return is_crowded(run) && look_within(run) ? SD_NODES : -1;
}

/* The divided differences of the powers at the start and the nodes; of few of these what they are as factors of s^k instead,
 * s the part of the step, by which a sum takes a tenth of the time. */
static void divide(sd_run *run)
{
    const double *node = run->node;
    double (*difference)[2] = run->difference;
    memcpy(difference[0], run->power + 2, sizeof difference[0]);
    memcpy(difference[1], run->node_power[0], (size_t)run->noded * sizeof difference[0]);
    for (int32_t order = 1; order <= run->noded; order++)
        for (int32_t k = run->noded; k >= order; k--) {
            const double apart = 1.0 / (node[k - 1] - (k > order ? node[k - order - 1] : 0.0));
            for (int i = 0; i < 2; i++)
                difference[k][i] = (difference[k][i] - difference[k - 1][i]) * apart;
        }
    for (int32_t from = run->noded - 1; from > 0 && run->noded <= PLAIN; from--)
        for (int32_t k = from; k < run->noded; k++)
            for (int i = 0; i < 2; i++)
                difference[k][i] -= node[from - 1] * difference[k + 1][i];
    run->divided = 1;
}

/* sum := int_0^part of the polynomial of few nodes, over part */
static void sum_plainly(const sd_run *run, double part, double sum[2])
{
    static const double inverse[PLAIN + 1] = {1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0};
    double a = 0.0, b = 0.0;
    for (int32_t k = run->noded; k >= 0; k--) {
        a = a * part + run->difference[k][0] * inverse[k];
        b = b * part + run->difference[k][1] * inverse[k];
    }
    sum[0] = a;
    sum[1] = b;
}

/* the same of many, by Gauss's rule */
static void sum_by_gauss(const sd_run *run, double part, double sum[2])
{
    sum[0] = sum[1] = 0.0;
    for (int p = 0; p < 4; p++) {
        const double s = part * (0.5 + gauss[1][p]);
        double power[2] = {run->difference[run->noded][0], run->difference[run->noded][1]};
        for (int32_t k = run->noded - 1; k >= 0; k--) { /* each is that from node k on */
            const double apart = k > 0 ? s - run->node[k - 1] : s;
            power[0] = power[0] * apart + run->difference[k][0];
            power[1] = power[1] * apart + run->difference[k][1];
        }
        sum[0] += gauss_weight[1][p] * power[0];
        sum[1] += gauss_weight[1][p] * power[1];
    }
}

int sd_run_sum(sd_run *run, double to, double sum[2])
{
    const sd_stepper *stepper = run->stepper;
    if (!run->noded)
        run->noded = find_powers(run);
    if (run->noded > 0 && !run->divided)
        divide(run);
    if (run->noded < 0) {
        int there = sd_run_integrate(run, to);
        memcpy(sum, run->integral + 2, 2 * sizeof *sum);
        return there;
    }
    const double *moves = has_own(stepper) ? stepper->moves : NULL;
    const double part = (to - run->t_from) / (stepper->ivp->t - run->t_from);
    (run->noded <= PLAIN ? sum_plainly : sum_by_gauss)(run, part, sum);
    for (int i = 0; i < 2; i++)
        sum[i] = part * length_of(run) * sum[i] + (moves ? moves[2 + i] : 0.0);
    return 0;
}

void sd_run_integrate_cut(sd_run *run, double to)
{
    static const double node[2][5] = {{-0.77459666924148337704, 0.0, 0.77459666924148337704},
                                      {-0.90617984593866399280, -0.53846931010568309104, 0.0, 0.53846931010568309104,
                                       0.90617984593866399280}};
    static const double weight[2][5] = {{5.0 / 9.0, 8.0 / 9.0, 5.0 / 9.0},
                                        {0.23692688505618908751, 0.47862867049936646804, 0.56888888888888888889,
                                         0.47862867049936646804, 0.23692688505618908751}};
    int high = run->stepper->nodes > 3;
    double half = 0.5 * (to - run->t_from), middle = 0.5 * (to + run->t_from);
    memset(run->integral, 0, (size_t)run->audited * sizeof(double));
    for (int k = 0; k < (high ? 5 : 3) && run->audit && half > 0.0; k++) {
        double t = middle + node[high][k] * half;
        run->stepper->dense(run->stepper->self, t, run->point, run->point_d);
        sd_run_settle(run, t);
        powers(run, t, run->point, run->point_d, run->sample);
        weigh(run, run->sample, half * weight[high][k]);
    }
}
