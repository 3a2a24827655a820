/* Integrals of powers over the last step: see quadratures.h. */
#include "run/meters/quadratures.h"

#include <string.h>

void sd_run_audit(const sd_run *run, double t, const double *y, const double *yd, double *out)
{
    memset(out, 0, (size_t)run->audited * sizeof *out);
    if (run->audit)
        run->audit->rows(&run->audit->frame, t, y, yd, out);
}

/* run->sample [audited]: the same, energies but for those that come with powers */
static void powers(sd_run *run, double t, const double *y, const double *yd)
{
    memset(run->sample, 0, (size_t)run->audited * sizeof(double));
    run->powers->rows(&run->powers->frame, t, y, yd, run->sample);
}

/* run->integral += weight * run->sample */
static void weigh(sd_run *run, double weight)
{
    for (int32_t k = 2; k < run->audited; k++)
        run->integral[k] += weight * run->sample[k];
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

/* share [nodes + 1]: int_0^to of the polynomials of degree `nodes` that are 1 at the step's start, at each node, and 0 at
 * the others, by Gauss's rule of degree 3 or 7 */
static void shares(const sd_stepper *stepper, double to, double *share)
{
    static const double gauss[2][4] = {{-0.28867513459481288225, 0.28867513459481288225},
                                       {-0.43056815579702628761, -0.16999052179242812840, 0.16999052179242812840,
                                        0.43056815579702628761}};
    static const double weight[2][4] = {{0.5, 0.5},
                                        {0.17392742256872692869, 0.32607257743127307131, 0.32607257743127307131,
                                         0.17392742256872692869}};
    int high = stepper->nodes > 3, points = stepper->nodes + 1;
    double node[SD_NODES + 1] = {0.0};
    memcpy(node + 1, stepper->node, (size_t)stepper->nodes * sizeof *node);
    for (int k = 0; k < points; k++)
        share[k] = 0.0;
    for (int p = 0; p < (high ? 4 : 2); p++) {
        double s = to * (0.5 + gauss[high][p]), before = weight[high][p], behind[SD_NODES + 2];
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
    run->noded = stepper->collocated;
    if (part < 1.0) { /* the whole step takes nothing of its start */
        shares(stepper, part, share);
        memcpy(run->sample, run->power, (size_t)run->audited * sizeof(double));
        weigh(run, h * share[0]);
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
        powers(run, from + stepper->node[k] * h, y, stepper->show ? run->point_d : stepper->node_yd[k]);
        weigh(run, h * weight);
        if (stepper->collocated)
            memcpy(run->node_power[k], run->sample + 2, sizeof run->node_power[k]);
    }
    for (int32_t k = 2; stepper->moves && k < run->audited; k++)
        run->integral[k] += stepper->moves[k];
}

int sd_run_integrate(sd_run *run, double to)
{
    static const double inner = 0.44721359549995793928; /* 1/sqrt(5) */
    const sd_stepper *stepper = run->stepper;
    double from = run->t_from, half = 0.5 * (to - from), middle = 0.5 * (to + from);
    memset(run->integral, 0, (size_t)run->audited * sizeof(double));
    run->sampled = 0;
    if (!run->audit || half == 0.0)
        return 0;
    if (stepper->nodes && (to == stepper->ivp->t || stepper->collocated)) {
        integrate_nodes(run, to == stepper->ivp->t ? 1.0 : (to - from) / (stepper->ivp->t - from));
        return 0;
    }
    if (stepper->part_y) {
        stepper->dense(stepper->self, to, run->point, run->point_d);
        for (int32_t k = 0; k < stepper->nodes; k++) {
            powers(run, from + stepper->node[k] * (to - from), stepper->part_y[k], stepper->part_yd[k]);
            weigh(run, (to - from) * stepper->node_weight[k]);
        }
        for (int32_t k = 2; stepper->part_moves && k < run->audited; k++)
            run->integral[k] += stepper->part_moves[k];
        return 1;
    }
    memcpy(run->sample, run->power, (size_t)run->audited * sizeof(double));
    weigh(run, half / 6.0);
    for (int k = -1; k <= 1; k += 2) {
        double t = middle + k * inner * half;
        look(run, t);
        powers(run, t, run->point, run->point_d);
        weigh(run, 5.0 * half / 6.0);
    }
    run->sampled = to == stepper->ivp->t;
    if (run->sampled)
        look(run, to);
    else
        stepper->dense(stepper->self, to, run->point, run->point_d);
    sd_run_audit(run, to, run->point, run->point_d, run->sample);
    weigh(run, half / 6.0);
    return !run->sampled;
}

int sd_run_sum(sd_run *run, double to, double sum[2])
{
    const sd_stepper *stepper = run->stepper;
    if (!run->noded) {
        int there = sd_run_integrate(run, to);
        memcpy(sum, run->integral + 2, 2 * sizeof *sum);
        return there;
    }
    double share[SD_NODES + 1], h = length_of(run);
    shares(stepper, (to - run->t_from) / (stepper->ivp->t - run->t_from), share);
    for (int i = 0; i < 2; i++) {
        sum[i] = share[0] * run->power[2 + i];
        for (int32_t k = 0; k < stepper->nodes; k++)
            sum[i] += share[k + 1] * run->node_power[k][i];
        sum[i] = h * sum[i] + (stepper->moves ? stepper->moves[2 + i] : 0.0);
    }
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
        powers(run, t, run->point, run->point_d);
        weigh(run, half * weight[high][k]);
    }
}
