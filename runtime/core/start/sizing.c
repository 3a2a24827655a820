#include "start/sizing.h"

#include "linear/linear.h"
#include "linear/tuning.h"
#include "start/response.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CANCELLED (64.0 * DBL_EPSILON) /* of a slope beside it: one that terms which cancel have left */
#define ROUND_OFF SD_CANCELS /* of the largest of the same unit: smaller ones are what is left of a zero */
#define NOTHING 1e-18 /* of the largest of the same kind and unit: less was written as a zero (starts clean what they leave) */
#define FRESH SD_SAME /* of what a rate makes of a quantity in the time scale so far: a start below it is round-off */
#define INLYING SD_SMALL /* of what a state that begins at zero gets to: its like, if they are no larger, say nothing of it */
#define UNKNOWN 1.0 /* magnitude of what is zero with all that could size it (scales.py) */
#define GROUP SD_SMALL /* of their like: the least that zeros count as (scales.py) */
#define PART 1e-2 /* of the span: the time scale at most */
#define NEVER SD_SAME /* of what a run confirmed: a content that was never larger is zero, and its size is not known */
#define NOISE SD_UNSEEN /* values below this part of what balances their rows are round-off, or zero by chance */
#define QUIET SD_SAME /* efforts below this part of (largest energy) / q are round-off, and flows of their like */
#define TINY (DBL_MIN * 1e30) /* less is no magnitude */

/* The motion linearised at a start: entries of dF/dy, dF/dyd, rates (NULL: none of it is known), order of columns. */
typedef struct sd_motion {
    const double *jy, *jyd, *rate;
    const sd_order *order;
} sd_motion;

static double named(const sd_sizing *s, int32_t k)
{
    return s->nominal ? s->nominal[k] : 0.0;
}

/* most [kinds] := the largest of each kind and unit */
static void group_largest(const sd_balance *b, const double *x, double *most)
{
    memset(most, 0, (size_t)b->kinds * sizeof *most);
    for (int32_t k = 0; k < b->unknowns; k++)
        most[b->kind[k]] = sd_larger(most[b->kind[k]], x[k]);
}

int sd_relaxed(const sd_system *system, const sd_order *order, int32_t rungs, const double *rung, const double *jy,
               const double *jyd, const double *yd, double tau, double *far)
{
    int32_t n = system->unknowns, rows = system->rows, entries = system->entries, still = 1;
    for (int32_t k = 0; k < n; k++) {
        far[k] = tau * fabs(yd[k]);
        still &= yd[k] == 0.0;
    }
    if (still || sd_first_bad(entries, jy) >= 0 || sd_first_bad(entries, jyd) >= 0)
        return 0;
    double *memory = calloc(2 * (size_t)rows + (size_t)n + 1, sizeof(double));
    sd_linear *linear = sd_linear_ordered(n, system->column, system->row, order);
    if (!memory || !linear) {
        free(memory);
        sd_linear_free(linear);
        return -1;
    }
    double *push = memory, *step = push + rows, *moved = step + rows, *values = linear->scaled;
    int told = 0;
    for (int32_t j = 0; j < n; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            push[system->row[e]] += jyd[e] * yd[j];
    for (int32_t k = 0; k < rungs; k++) {
        double h = tau * rung[k];
        for (int32_t e = 0; e < entries; e++)
            values[e] = jy[e] + jyd[e] / h;
        if (sd_linear_factor(linear, values, NULL) == 0) {
            memcpy(step, push, (size_t)rows * sizeof *step);
            sd_linear_solve(linear, step);
            for (int32_t i = 0; i < n; i++)
                moved[i] = fmax(moved[i], fabs(step[i]));
            told = 1;
        }
    }
    for (int32_t i = 0; i < n && told; i++)
        far[i] = isfinite(moved[i]) ? sd_smaller(moved[i], far[i]) : far[i];
    sd_linear_free(linear);
    free(memory);
    return 0;
}

/* size [n] := the largest |y| of the like of each unknown; of a state that is zero, and gets 1 / INLYING times as far within
 * `time`, how far that is (reach, by the motion linearised: sd_relaxed).  most [kinds]: room.  0; -1: no memory */
static int like_sizes(const sd_sizing *s, const sd_system *system, double time, const double *y, const double *yd,
                      const sd_motion *motion, double *size, double *reach, double *most)
{
    const sd_balance *b = s->balance;
    int outlying = 0;
    for (int32_t k = 0; k < b->unknowns; k++)
        size[k] = fabs(y[k]);
    group_largest(b, size, most);
    for (int32_t k = 0; k < b->unknowns; k++) {
        double like = most[b->kind[k]];
        int far = motion->rate && (s->kind[k] & SD_STATE) && size[k] <= NOTHING * like && like < INLYING * fabs(yd[k]) * time;
        outlying |= far;
        size[k] = far ? -like : like;
    }
    if (outlying &&
        sd_relaxed(system, motion->order, s->rungs, s->rung, motion->jy, motion->jyd, motion->rate, time, reach))
        return -1;
    for (int32_t k = 0; k < b->unknowns && outlying; k++)
        if (size[k] < 0.0)
            size[k] = INLYING * reach[k] > -size[k] ? reach[k] : -size[k];
    return 0;
}

/* rate [n] := how fast unknowns move by what their rows gain (jyd yd): nodes that stores only tie together have a rate in
 * common that moves nothing, and may be any where a leak grounds them.  jyd NULL: as yd says.  0; -1: no memory */
static int carried_rates(const sd_system *system, const double *jyd, const double *yd, double *rate)
{
    double *gain = calloc((size_t)system->rows + 1, sizeof *gain);
    if (!gain)
        return -1;
    for (int32_t j = 0; j < system->unknowns && jyd; j++)
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            gain[system->row[e]] += jyd[e] * yd[j];
    for (int32_t j = 0; j < system->unknowns; j++) {
        double most = -1.0;
        for (int32_t e = system->column[j]; e < system->column[j + 1] && jyd; e++)
            if (jyd[e] != 0.0)
                most = sd_larger(most, fabs(gain[system->row[e]] / jyd[e]));
        rate[j] = most >= 0.0 && most < fabs(yd[j]) ? most : fabs(yd[j]);
    }
    free(gain);
    return 0;
}

/* the shortest of: a part of the span, y / y', sqrt(q / f'), what moves with t; size, reach [n], most [kinds]: room; -1: no
 * memory */
static double time_scale(const sd_sizing *s, const sd_system *system, double span, double quick, const double *y,
                         const double *yd, const sd_motion *motion, double *size, double *reach, double *most)
{
    const sd_balance *b = s->balance;
    double found = sd_smaller(PART * span, quick), least = INFINITY;
    if (like_sizes(s, system, found, y, yd, motion, size, reach, most) ||
        carried_rates(system, motion->rate ? motion->jyd : NULL, yd, reach))
        return -1.0;
    for (int32_t k = 0; k < b->unknowns; k++) {
        double rate = reach[k];
        /* values that are nothing beside what their rate makes of them are round-off */
        if ((s->kind[k] & SD_STATE) && size[k] > FRESH * rate * found && rate > 0.0)
            least = sd_smaller(least, size[k] / rate);
    }
    found = least < found ? least : found;
    least = INFINITY;
    for (int32_t k = 0; k < system->kinematics; k++) {
        double q = size[system->k_q[k]], rate = reach[system->k_f[k]];
        if (q > 0.0 && rate > 0.0)
            least = sd_smaller(least, sqrt(q / rate));
    }
    return least < found ? least : found;
}

/* own [n] := the largest |value| among the entries of each unknown */
static void own_entries(const sd_sizing *s, int which, const double *value, double *own)
{
    const sd_balance *b = s->balance;
    memset(own, 0, (size_t)b->unknowns * sizeof *own);
    for (int32_t k = 0; k < s->owns[which]; k++) {
        int32_t e = s->own[which][k], c = b->column[e];
        own[c] = sd_larger(own[c], fabs(value[e]));
    }
}

/* sd_compliance; room [3 n + kinds] */
static void compliance(const sd_sizing *s, const double *jy, const double *jyd, double *divisor, double *room)
{
    const sd_balance *b = s->balance;
    int32_t n = b->unknowns;
    double *inertia = room, *one = inertia + n, *other = one + n, *plain = other + n;
    own_entries(s, 0, jyd, inertia);
    own_entries(s, 2, jy, one);
    own_entries(s, 3, jy, other);
    for (int32_t k = 0; k < n; k++)
        if ((s->kind[k] & SD_MOMENTUM) && s->partner[k] >= 0) {
            int32_t f = s->partner[k];
            inertia[f] = sd_larger(inertia[f], other[k] > 0.0 ? one[f] / other[k] : 0.0);
        }
    own_entries(s, 1, jy, one); /* stiffness */
    memset(plain, 0, (size_t)b->kinds * sizeof *plain);
    for (int32_t k = 0; k < n; k++) {
        int moved = s->kind[k] & SD_DISPLACEMENT, carried = (s->kind[k] & SD_MOMENTUM) && s->partner[k] >= 0;
        divisor[k] = moved ? 1.0 / one[k] : carried ? inertia[s->partner[k]] : 1.0;
        if ((moved || carried) && !(divisor[k] > 0.0 && isfinite(divisor[k])))
            plain[b->kind[k]] = 1.0;
    }
    for (int32_t k = 0; k < n; k++)
        divisor[k] = plain[b->kind[k]] > 0.0 ? 1.0 : divisor[k];
}

int sd_compliance(const sd_sizing *s, const double *jy, const double *jyd, double *divisor)
{
    double *room = malloc((3 * (size_t)s->balance->unknowns + (size_t)s->balance->kinds + 1) * sizeof *room);
    if (!room)
        return -1;
    compliance(s, jy, jyd, divisor, room);
    free(room);
    return 0;
}

/* flows at rest, and not accelerated but by round-off: a small part of what would move their q in the span; least
 * [kinematics]: room */
static void flows(const sd_system *system, double span, double *found, double *least)
{
    for (int32_t k = 0; k < system->kinematics; k++) {
        least[k] = 0.1 * found[system->k_q[k]] / (span != 0.0 ? span : 1.0);
        least[k] = found[system->k_f[k]] < NOISE * least[k] ? GROUP * least[k] : -1.0;
    }
    for (int32_t k = 0; k < system->kinematics; k++)
        if (least[k] >= 0.0)
            found[system->k_f[k]] = least[k];
}

/* what is not zero at the start counts as it is, zeros as what they move, GROUP of their like at least */
static void known_sizes(const sd_sizing *s, const sd_system *system, const double *y, const double *divisor,
                        double *moves, double *known, double *most)
{
    const sd_balance *b = s->balance;
    int32_t n = b->unknowns;
    for (int32_t k = 0; k < n; k++)
        known[k] = sd_larger(fabs(y[k]), moves[k]);
    group_largest(b, known, most);
    for (int32_t k = 0; k < system->kinematics; k++) { /* rates that are round-off */
        int32_t f = system->k_f[k];
        if (fabs(y[f]) < QUIET * sd_larger(known[f], GROUP * most[b->kind[f]]))
            moves[system->k_q[k]] = 0.0;
    }
    for (int32_t k = 0; k < n; k++)
        known[k] = sd_larger(fabs(y[k]), moves[k]) / divisor[k];
    group_largest(b, known, most);
    for (int32_t k = 0; k < n; k++) {
        double largest = divisor[k] * most[b->kind[k]], own = sd_larger(fabs(y[k]), moves[k]);
        known[k] = fabs(y[k]) > NOTHING * largest ? own : sd_larger(own, GROUP * largest);
        known[k] = named(s, k) > 0.0 ? named(s, k) : known[k];
    }
}

/* excited [rows] := at least the effort that counts in each row of dynamics, by what stands in the row [rows] */
static void efforts(const sd_sizing *s, const double *found, const double *row, double *excited)
{
    double most = 0.0;
    for (int32_t k = 0; k < s->efforts; k++)
        most = sd_larger(most, row[s->effort[k]] * found[s->moved[k]]);
    for (int32_t k = 0; k < s->efforts; k++) {
        double q = found[s->moved[k]];
        excited[s->effort[k]] = sd_larger(excited[s->effort[k]], QUIET * most / (q > 0.0 ? q : INFINITY));
    }
}

/* found [n]: what is too small beside what balances the rows is taken from these, but what its rate brings no farther (of
 * told, in tau, where it is no round-off: a momentum that a resistance takes at once); size [entries], excited [rows];
 * bearing: where laws are steep, or NULL; kept [n], balanced [n]: room */
static int balanced_sizes(const sd_sizing *s, const int32_t *carries, const double *told, double tau, const double *size,
                          double *excited, const sd_bearing *bearing, double *found, double *kept, double *balanced)
{
    const sd_balance *b = s->balance;
    int32_t n = b->unknowns;
    /* what round-off leaves of a zero is nothing beside what the sources will make of it */
    memset(balanced, 0, (size_t)n * sizeof *balanced);
    char *small = sd_small(b, size);
    if (!small)
        return -1;
    int failed = sd_propagate_beside(b, size, small, excited, NULL, bearing, SD_CAPPED, balanced);
    for (int32_t k = 0; k < n; k++)
        found[k] = carries[k] && found[k] < ROUND_OFF * balanced[k] ? balanced[k] : found[k];
    /* momenta and dynamic variables are balanced against flows, what follows from the state against all of it */
    for (int32_t k = 0; k < n; k++)
        balanced[k] = carries[k] && (s->kind[k] & (SD_DISPLACEMENT | SD_FLOW)) ? found[k] : 0.0;
    failed |= sd_propagate_beside(b, size, small, excited, NULL, bearing, SD_LARGEST | SD_CAPPED, balanced);
    for (int32_t k = 0; k < n; k++) {
        double rated = told ? tau * fabs(told[k]) : 0.0;
        int relaxed = rated > NOISE * balanced[k] && found[k] > ROUND_OFF * rated;
        int whole = !(s->kind[k] & (SD_MOMENTUM | SD_DYNAMIC)) || found[k] > NOISE * balanced[k] || relaxed;
        found[k] = whole ? found[k] : balanced[k];
        balanced[k] = kept[k] = carries[k] ? found[k] : 0.0;
    }
    double *row = malloc(((size_t)b->rows + 1) * sizeof *row);
    if (!row) {
        free(small);
        return -1;
    }
    memcpy(row, excited, (size_t)b->rows * sizeof *row);
    for (int32_t e = 0; e < b->entries; e++)
        row[b->row[e]] = sd_larger(row[b->row[e]], size[e] * kept[b->column[e]]);
    efforts(s, found, row, excited);
    free(row);
    failed |= sd_propagate_beside(b, size, small, excited, NULL, bearing, SD_CAPPED, balanced);
    free(small);
    for (int32_t k = 0; k < n; k++)
        found[k] = found[k] > NOISE * balanced[k] ? found[k] : balanced[k];
    return failed;
}

/* which unknowns carry the state: of flows those with inertia, or a momentum */
static void carriers(const sd_sizing *s, const double *jyd, int32_t *carries)
{
    const sd_balance *b = s->balance;
    for (int32_t k = 0; k < b->unknowns; k++)
        carries[k] = (s->kind[k] & SD_STATE) && (!(s->kind[k] & SD_FLOW) || (s->kind[k] & SD_OF_MOMENTUM));
    for (int32_t e = 0; e < b->entries; e++)
        if (jyd[e] != 0.0 && (s->kind[b->column[e]] & SD_STATE))
            carries[b->column[e]] = 1;
}

/* open [n] := what round-off of the terms of its rows makes of a rate in the time tau, and of a displacement its flow's; of a
 * step of that length at (t, y, yd).  0; -1: no memory */
static int left_open(const sd_sizing *s, sd_system *system, double t, double tau, const double *y, const double *yd,
                     double *open)
{
    const sd_balance *b = s->balance;
    size_t entries = (size_t)b->entries;
    double *jy = calloc(2 * entries + (size_t)b->rows + 1, sizeof *jy), *jyd = jy + entries, *row = jyd + entries;
    if (!jy)
        return -1;
    sd_jacobian(system, t, y, yd, NULL, jy, jyd);
    for (int32_t e = 0; e < b->entries; e++)
        row[b->row[e]] = sd_larger(row[b->row[e]], fabs(jy[e] * y[b->column[e]]));
    memset(open, 0, (size_t)b->unknowns * sizeof *open);
    for (int32_t e = 0; e < b->entries; e++)
        if (jyd[e] != 0.0) {
            double *own = open + b->column[e];
            *own = sd_larger(*own, DBL_EPSILON * row[b->row[e]] / (fabs(jy[e]) + fabs(jyd[e]) / tau));
        }
    for (int32_t k = 0; k < system->kinematics; k++) {
        double *q = open + system->k_q[k];
        *q = sd_larger(*q, tau * open[system->k_f[k]]);
    }
    free(jy);
    return 0;
}

/* found [n]: zeros of which no rate says how far they get lie between what moves with t plainly makes of them, or GROUP of
 * their like, and what it would make of them if it stayed there for the span, and are no less than round-off makes of
 * them in tau; least, most [n], largest [kinds]: room */
static int bounded(const sd_sizing *s, sd_system *system, const sd_order *order, double t0, double quick, double span,
                   double tau, const double *y, const double *yd, const double *moves, const int32_t *carries,
                   const double *divisor, double *found, double *least, double *most, double *largest)
{
    const sd_balance *b = s->balance;
    int32_t n = b->unknowns, zeros = 0;
    for (int32_t k = 0; k < n; k++)
        zeros += carries[k] && y[k] == 0.0 && moves[k] == 0.0 && named(s, k) == 0.0;
    if (!zeros || !isfinite(quick))
        return 0;
    int answered = sd_response(b, system, order, t0, quick, span, y, found, least, most);
    if (answered <= 0)
        return answered;
    double *bound[] = {least, most};
    for (int side = 0; side < 2; side++) {
        for (int32_t k = 0; k < n; k++)
            bound[side][k] /= divisor[k];
        group_largest(b, bound[side], largest);
        for (int32_t k = 0; k < n; k++)
            bound[side][k] = divisor[k] * sd_larger(bound[side][k], GROUP * largest[b->kind[k]]);
    }
    for (int32_t k = 0; k < n; k++)
        if (carries[k] && y[k] == 0.0 && moves[k] == 0.0 && named(s, k) == 0.0 && most[k] > 0.0)
            found[k] = sd_larger(sd_smaller(found[k], most[k]), least[k]);
    if (left_open(s, system, t0, tau, y, yd, least))
        return -1;
    for (int32_t k = 0; k < n; k++)
        if (carries[k] && y[k] == 0.0 && moves[k] == 0.0 && named(s, k) == 0.0)
            found[k] = sd_larger(found[k], least[k]);
    return 0;
}

/* slope [entries] := 0 where it is round-off beside others of its row and of its column alike: a crank at its dead centre moves
 * its slider by 1e-17 m/rad, and what that would balance has no bound.  1: no memory */
static int clear_round_off(const sd_system *system, double *slope)
{
    double *largest = calloc((size_t)system->rows + 1, sizeof *largest); /* of each row */
    if (!largest)
        return 1;
    for (int32_t e = 0; e < system->entries; e++)
        largest[system->row[e]] = sd_larger(largest[system->row[e]], fabs(slope[e]));
    for (int32_t j = 0; j < system->unknowns; j++) {
        double most = 0.0;
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            most = sd_larger(most, fabs(slope[e]));
        for (int32_t e = system->column[j]; e < system->column[j + 1]; e++)
            if (fabs(slope[e]) <= CANCELLED * fmin(most, largest[system->row[e]]))
                slope[e] = 0.0;
    }
    free(largest);
    return 0;
}

int sd_magnitudes(const sd_sizing *s, sd_system *system, double t0, double span, const double *y, const double *yd,
                  double *jy, double *jyd, const double *rate, const sd_order *order, int spent, double *found,
                  double *tau)
{
    const sd_balance *b = s->balance;
    size_t n = (size_t)b->unknowns, rows = (size_t)b->rows, entries = (size_t)b->entries, kinds = (size_t)b->kinds;
    double *first = calloc(n + rows + kinds + 1, sizeof *first), *like = calloc(n + 1, sizeof *like);
    if (!first || !like) {
        free(first);
        free(like);
        return -1;
    }
    double *moves = first, *excited = moves + n, *most = excited + rows;
    double quick = sd_excitation(system, t0, t0 + span - t0, y, yd, s->part, s->parts, NOISE, excited);
    *tau = time_scale(s, system, span, quick, y, yd, &(sd_motion){jy, jyd, rate, order}, like, moves, most);
    free(like);
    int failed = quick < 0.0 || *tau < 0.0;
    if (rate && !failed)
        failed |= sd_relaxed(system, order, s->rungs, s->rung, jy, jyd, rate, *tau, moves);
    /* of a large system the room counts: what factors do not need follows them, and what matrices held serves again */
    size_t borne = system->scales > 0 ? 2 * n + rows + entries + SD_LANES : 0, own = spent ? 0 : 2 * entries + 2;
    size_t within = entries >= 2 * n ? 0 : 2 * n;
    double *memory = calloc(n + own + borne + within + 1, sizeof *memory);
    int32_t *carries = calloc(n + 1, sizeof *carries);
    double *divisor = memory, *behind = divisor + n;
    double *own_jy = spent ? jy : behind, *own_jyd = spent ? jyd : own_jy + entries + 1, *size = own_jy;
    double *kept = within ? behind + own + borne : own_jyd, *balanced = kept + n;
    int none = !memory || !carries;
    if (!none) {
        sd_jacobian(system, t0, y, yd, NULL, own_jy, own_jyd);
        none = clear_round_off(system, own_jy);
        carriers(s, own_jyd, carries);
        none |= sd_compliance(s, own_jy, own_jyd, divisor);
    }
    if (none) {
        free(first);
        free(memory);
        free(carries);
        return -1;
    }
    for (size_t k = 0; k < n; k++)
        moves[k] = !carries[k] ? 0.0 : rate ? moves[k] : *tau * fabs(yd[k]);
    known_sizes(s, system, y, divisor, moves, found, most);
    for (size_t e = 0; e < entries; e++) {
        size[e] = fabs(own_jy[e]) + fabs(own_jyd[e]) / *tau;
        size[e] = isfinite(size[e]) ? size[e] : 0.0;
    }
    flows(system, span, found, kept);
    sd_bearing bearing = {system, t0, y, yd, behind + own};
    failed |= balanced_sizes(s, carries, rate, *tau, size, excited, borne ? &bearing : NULL, found, kept, balanced);
    group_largest(b, found, most);
    for (size_t k = 0; k < n; k++)
        found[k] = found[k] == 0.0 ? most[b->kind[k]] : found[k];
    for (int32_t k = 0; k < system->kinematics; k++)
        if (found[system->k_q[k]] == 0.0)
            found[system->k_q[k]] = *tau * found[system->k_f[k]];
    for (size_t k = 0; k < n; k++)
        found[k] = found[k] > TINY ? found[k] : UNKNOWN;
    if (rate)
        failed |= bounded(s, system, order, t0, quick, span, *tau, y, yd, moves, carries, divisor, found, kept, balanced, most);
    free(first);
    free(memory);
    free(carries);
    return failed ? -1 : 0;
}

static int guessed(const sd_sizing *s, int32_t k)
{
    return (s->kind[k] & SD_STATE) && named(s, k) == 0.0;
}

int sd_confirmed(const sd_sizing *s, const sd_system *system, double span, const double *met, const double *magnitude,
                 double *found)
{
    const sd_balance *b = s->balance;
    double *most = calloc((size_t)b->kinds + (size_t)system->kinematics + 1, sizeof *most);
    if (!most)
        return -1;
    group_largest(b, met, most);
    for (int32_t k = 0; k < b->unknowns; k++)
        found[k] = sd_larger(met[k], GROUP * most[b->kind[k]]);
    flows(system, span, found, most + b->kinds);
    for (int32_t k = 0; k < b->unknowns; k++)
        found[k] = guessed(s, k) ? sd_smaller(sd_larger(found[k], NOISE * magnitude[k]), magnitude[k]) : magnitude[k];
    free(most);
    return 0;
}

void sd_ceiling(const sd_sizing *s, int blocks, const double *met, double *found)
{
    for (int32_t k = 0; k < s->balance->unknowns; k++) {
        int told = guessed(s, k) && !(blocks && (s->kind[k] & SD_FLOW)) && met[k] > NEVER * found[k];
        found[k] = told ? sd_larger(met[k], GROUP * found[k]) : INFINITY;
    }
}
