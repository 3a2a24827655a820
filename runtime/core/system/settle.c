/* Least change onto the equations and their hidden derivatives: see settle.h. */
#include "system/settle.h"
#include "system/condensed.h"
#include "system/settle_basis.h"
#include "system/settle_room.h"
#include "system/settle_saddle.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define ITERATIONS 6
#define PATIENT 40      /* of the last attempt: an exponential is climbed down a step at a time */
#define EXACT 4e-15     /* scaled residual that counts as round-off */
#define FINE SD_BY_FACTORS /* ... and that with which old factors have done what they can, or twice what fresh ones could, */
#define COARSE SD_DEPENDENT /* but no more than this */
#define CLOSE SD_SAME /* scaled residual with which one may live */
#define SMALL SD_SLIGHT /* move of the unknowns that follow, in magnitudes: it drags the state by WEIGHT of that */
#define CALM SD_SAME /* the same of a point whose rows are FINE, behind which the next move is none */
#define STILL SD_CANCELS /* move of the state, in magnitudes, that is none */
#define REFUSALS 3      /* of the basis in a row, behind which it is tried once in AGAIN points alone, and */
#define AGAIN 16        /* behind SD_BASIS_OUT of them not any more */
#define BEYOND 1e3      /* times the point that was found, from which a magnitude was that of an iterate */
#define CONTRACTS 0.02  /* old factors are kept while one step reduces the residual to this part */

/* the basis at (t, y, yd), an iterate */
static int choose(sd_settle *settle, double t, const double *y, const double *yd)
{
    int failed = !sd_settle_slopes(settle, t, y, yd, 0) || sd_settle_choose(settle);
    sd_settle_leave_slopes(settle);
    return failed;
}

/* Whether a rate has moved by more than its unknown may within the step: where something relaxes at once, errors that are
 * small in states are rates without bound, and the potentials that follow from these are any.  Events read them; of runs
 * without, `determined` is 0: rows are compared. */
static int races(const sd_settle *settle, const double *yd)
{
    const int read = settle->determined && settle->hold == 1.0 && settle->within > 0.0;
    for (int32_t k = 0; k < settle->rates && read; k++) {
        const double moved = yd[settle->rate[k]] - settle->x0[settle->unknowns + k];
        if (fabs(moved) * settle->within > settle->scale[settle->rate[k]])
            return 1;
    }
    return 0;
}

/* The iteration within the basis from (y, yd) = x0: 1 where it settled and the state stayed, the residual in `best`;
 * else the point is as it was. */
static int follow(sd_settle *settle, double t, double *y, double *yd, double *best)
{
    double limit = fmax(EXACT, settle->enough), still = fmax(STILL, settle->slack), state = 0.0, moved = INFINITY;
    /* near a law's flat place round-off leaves much; of steep ones the saddle-point matrix makes more */
    const int steep = settle->system->scales > 0;
    double bound = steep ? FINE : CLOSE;
    int fresh = settle->ready != SD_BY_BASIS, failed = fresh && !sd_settle_slopes(settle, t, y, yd, 1);
    double before = failed ? INFINITY : sd_settle_measure(settle, t, y, yd);
    settle->drift = settle->constraints;
    if (fresh && !failed) {
        /* a point that holds as it comes asks for none, but of a large one the next shall: within a step room is scarce */
        failed = (before > limit || sd_settle_large(settle)) && sd_settle_choose(settle);
        sd_settle_leave_slopes(settle);
    }
    for (int m = 0; m < ITERATIONS && !failed && !*settle->system->stop; m++) {
        if (before <= limit && (m == 0 || moved < SMALL || !(steep || settle->determined)))
            break;
        double pulled = 0.0;
        moved = sd_settle_move_basic(settle, y, yd, &pulled);
        if (!settle->system->left) /* as the point will be left: what is measured of it then stays */
            sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
        state += pulled;
        double now = sd_settle_measure(settle, t, y, yd);
        failed = !isfinite(now) || state > still;
        const int stays = moved < SMALL && now > 0.5 * before && now <= (fresh ? bound : FINE);
        if (!failed && (stays || (moved < CALM && now <= FINE && !settle->determined))) {
            before = now; /* round-off is what is left, in the rows and in what follows from them */
            break;
        }
        if (!failed && now > CONTRACTS * before && now > fmax(FINE, limit)) {
            failed = choose(settle, t, y, yd);
            fresh = 1;
        }
        before = now;
    }
    *best = before;
    if (!failed && before <= fmax(bound, settle->enough) && !races(settle, yd)) {
        settle->refused = 0;
        return 1;
    }
    settle->basis->pivoted = 0; /* another one may do */
    settle->refused++;
    settle->ready = SD_BY_NONE;
    return 0;
}

/* x := (y, chosen yd) */
static void take(const sd_settle *settle, const double *y, const double *yd, double *x)
{
    memcpy(x, y, (size_t)settle->unknowns * sizeof *y);
    for (int32_t k = 0; k < settle->rates; k++)
        x[settle->unknowns + k] = yd[settle->rate[k]];
}

/* (y, chosen yd) := x */
static void put(const sd_settle *settle, const double *x, double *y, double *yd)
{
    memcpy(y, x, (size_t)settle->unknowns * sizeof *y);
    for (int32_t k = 0; k < settle->rates; k++)
        yd[settle->rate[k]] = x[settle->unknowns + k];
}

/* The iteration from (y, yd) towards what is nearest to x0; the best point met, its residual in `best`, is left in x. */
static void iterate(sd_settle *settle, double t, double *y, double *yd, int most, double *best)
{
    int fresh = settle->ready != SD_BY_MATRIX, failed = fresh && sd_settle_factorise(settle, t, y, yd);
    double moved = 0.0, pulled = 0.0, drag = 0.0, before = failed ? INFINITY : sd_settle_measure(settle, t, y, yd);
    double still = settle->hold == 1.0 ? settle->still : 0.0; /* one that is held stays where it is */
    *best = before;
    settle->drift = settle->constraints;
    take(settle, y, yd, settle->x);
    for (int m = 0; m < most && !failed && !*settle->system->stop; m++) {
        if ((moved < SMALL || pulled < still) && before <= fmax(EXACT, settle->enough))
            break;
        moved = sd_settle_move(settle, y, yd, &pulled);
        double now = sd_settle_measure(settle, t, y, yd);
        if (!(now <= CLOSE))
            settle->contracted = fmax(settle->contracted, before > 0.0 && isfinite(now) ? now / before : INFINITY);
        /* between residuals of round-off the later point is the better one: the state is back where it came from */
        if (now < *best || now <= EXACT || (now <= FINE && drag >= SMALL)) {
            *best = now;
            drag = moved;
            take(settle, y, yd, settle->x);
        }
        int stays = now > 0.5 * before && moved < SMALL;
        if (fresh && m > 0 && stays && now < 0.5 * COARSE)
            settle->floor = fmax(settle->floor, 2.0 * now);
        if (!isfinite(now) || (stays && now < (fresh && m > 0 ? CLOSE : fmax(FINE, settle->floor))))
            break;
        if (fresh && m > 0 && stays && moved < STILL) /* what is left no move takes away: the next would be the same */
            break;
        if (now > CONTRACTS * before && now > fmax(EXACT, settle->enough)) {
            failed = sd_settle_factorise(settle, t, y, yd);
            fresh = 1;
        }
        before = now;
    }
}

/* met := what follows from the state: few unknowns, and most rates */
static void note_met(const sd_settle *settle, const double *y, const double *yd)
{
    const char *state = settle->state, *end = state + settle->unknowns;
    double *next = settle->met; /* without a branch: either is as often */
    for (int32_t j = 0; j < settle->unknowns; j++) {
        *next = y[j];
        next += !state[j];
    }
    for (int32_t k = 0; k < settle->rates; k++) {
        *next = yd[settle->rate[k]];
        next += !end[k];
    }
}

/* (y, chosen yd): the state as in x0, what follows from it as at the last point that settled */
static void put_near(const sd_settle *settle, double *y, double *yd)
{
    const double *next = settle->met;
    put(settle, settle->x0, y, yd);
    for (int32_t j = 0; j < settle->unknowns + settle->rates; j++)
        if (!settle->state[j])
            *(j < settle->unknowns ? &y[j] : &yd[settle->rate[j - settle->unknowns]]) = *next++;
}

/* what the point makes of other unknowns, and its residuals; measured: those of the point as it comes are known; 0 */
static int finish(sd_settle *settle, double t, double *y, double *yd, int done, int measured)
{
    int stays = measured;
    if (done)
        note_met(settle, y, yd);
    for (int32_t i = 0; done && i < settle->system->held; i++) {
        double *open = &y[settle->system->held_unknown[i]];
        stays &= *open == 0.0;
        *open = 0.0; /* not nearly: relative errors are taken of it */
    }
    for (int32_t k = 0; k < settle->k_spans && stays && settle->rates && !settle->system->left; k++) {
        const int32_t *span = settle->k_span + 4 * (size_t)k;
        for (int32_t i = 0; i < span[0]; i++)
            stays &= yd[span[2] + i] == y[span[3] + i];
    }
    if (!settle->system->left)
        sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
    if (!stays)
        sd_settle_measure(settle, t, y, yd);
    return 0;
}

/* 1: magnitudes that the iteration left far beyond the point (y, yd) are those of the motion and of this point again: of
 * rates, which a step of no time may have had, and of steep laws, whose polynomial may be anywhere between steps */
static int shrunk(sd_settle *settle, const double *y, const double *yd)
{
    const int32_t n = settle->unknowns, number = settle->system->scales > 0 ? n : 0;
    int found = 0;
    for (int32_t j = 0; j < number; j++) {
        const double now = fabs(y[j]), size = now > settle->usual[j] ? now : settle->usual[j];
        if (settle->scale[j] > BEYOND * size && size > 0.0) {
            settle->scale[j] = size;
            found = 1;
        }
    }
    for (int32_t k = 0; k < settle->rates; k++) {
        double size = sd_settle_rate(settle, k, yd);
        if (settle->scale[n + k] > BEYOND * size) {
            settle->scale[n + k] = size;
            found = 1;
        }
    }
    return found;
}

/* Whether the rows hold at (y, yd) as far as `limit`, or its own do, in magnitudes that the iteration has not left far
 * beyond the point. */
static int holds(sd_settle *settle, double t, const double *y, const double *yd, double best, double limit)
{
    if (shrunk(settle, y, yd)) {
        if (!sd_settle_slopes(settle, t, y, yd, 0))
            return 0;
        sd_settle_leave_slopes(settle);
        best = sd_settle_measure(settle, t, y, yd);
    }
    return best <= limit || (sd_settle_measure(settle, t, y, yd), settle->own <= limit);
}

/* whether the state is further from where it was than it may be */
static int strays(const sd_settle *settle)
{
    if (settle->most <= 0.0)
        return 0;
    for (int32_t j = 0; j < settle->unknowns; j++)
        if (settle->state[j] == SD_CARRIES && fabs(settle->x[j] - settle->x0[j]) > settle->most * settle->scale[j])
            return 1;
    for (int32_t k = 0; k < settle->pairs; k++)
        if (fabs(sd_settle_parted(settle, k, settle->x, settle->x0)) > settle->most)
            return 1;
    return 0;
}

/* Whether the point holds as it comes, by the scales of the last slopes. */
static int holds_by_old(sd_settle *settle, double t, double *y, double *yd, double limit)
{
    if (!(sd_settle_measure(settle, t, y, yd) <= fmax(limit, settle->enough)))
        return 0;
    settle->drift = settle->constraints;
    finish(settle, t, y, yd, 1, 1);
    return 1;
}

/* sd_settle_point with the unknowns of the system itself; the rows are measured once more where q' = f */
static int settle_unknowns(sd_settle *settle, double t, double *y, double *yd)
{
    const double close = fmax(CLOSE, settle->enough);
    double best;
    settle->calls++;
    settle->contracted = 0.0;
    if (settle->ready == SD_BY_NONE && settle->calls - 1 > settle->failures && holds_by_old(settle, t, y, yd, EXACT))
        return 0; /* it asks for no slopes */
    take(settle, y, yd, settle->x0);
    const size_t steep = settle->system->scales > 0 ? (size_t)settle->unknowns * sizeof(double) : 0;
    memcpy(settle->usual, settle->scale, steep);
    int tried = settle->refused < REFUSALS || (settle->refused < SD_BASIS_OUT && settle->calls % AGAIN == 0);
    if (settle->basis && (settle->hold == 1.0 || settle->determined) && tried) {
        if (follow(settle, t, y, yd, &best) && holds(settle, t, y, yd, best, close))
            return finish(settle, t, y, yd, 1, 1);
        put(settle, settle->x0, y, yd);
    }
    if (!sd_settle_provide_best(settle)) {
        settle->failures++;
        return 1;
    }
    int plain = settle->hold == 1.0; /* else factors are of another weight, and serve once */
    settle->ready = plain ? settle->ready : SD_BY_NONE;
    iterate(settle, t, y, yd, ITERATIONS, &best);
    if (best > close) { /* near a square root's zero a move of the state is the cheaper way to change a rate */
        put(settle, settle->x0, y, yd);
        settle->hold = SD_HELD;
        settle->ready = 0;
        iterate(settle, t, y, yd, ITERATIONS, &best);
        settle->hold = 1.0;
        settle->ready = 0;
    }
    settle->ready = plain ? settle->ready : SD_BY_NONE;
    int done = 0;
    if (best <= close) {
        put(settle, settle->x, y, yd);
        done = holds(settle, t, y, yd, best, close);
        if (!done) { /* from here on, in magnitudes of this point */
            iterate(settle, t, y, yd, ITERATIONS, &best);
            put(settle, settle->x, y, yd);
            done = best <= close && holds(settle, t, y, yd, best, close);
        }
    }
    if (!done && settle->calls - 1 > settle->failures) { /* steep laws: between steps a polynomial may be far off */
        if (steep) {
            memcpy(settle->scale, settle->usual, steep);
            settle->ready = SD_BY_NONE;
        }
        put_near(settle, y, yd);
        iterate(settle, t, y, yd, PATIENT, &best);
    }
    /* the best point met, or the given one; a rate may have no bound */
    put(settle, settle->x, y, yd);
    done = (done || holds(settle, t, y, yd, best, close)) && !strays(settle);
    if (!done)
        put(settle, settle->x0, y, yd);
    settle->failures += !done;
    finish(settle, t, y, yd, done, 0);
    return !done;
}

void sd_settle_take_point(const sd_settle *settle, const double *y, const double *yd, double *z, double *zd)
{
    const sd_condensed *left = (const sd_condensed *)settle->system->left;
    if (left) {
        sd_condensed_gather(left, y, z);
        sd_condensed_gather(left, yd, zd);
    } else {
        memcpy(z, y, (size_t)settle->unknowns * sizeof *z);
        memcpy(zd, yd, (size_t)settle->unknowns * sizeof *zd);
    }
}

/* y, yd := what the kept unknowns z, zd make of all */
static void follow_kept(const sd_settle *settle, const double *z, const double *zd, double *y, double *yd)
{
    const sd_condensed *condensed = (const sd_condensed *)settle->system->left;
    sd_condensed_expand(condensed, z, y, 0);
    sd_condensed_put(condensed, zd, yd);
    sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
    sd_condensed_complete(condensed, yd, 1); /* what follows from displacements follows them in its rate */
}

/* the same for a point with all unknowns of the system that this one is condensed from */
static int settle_whole(sd_settle *settle, double t, double *y, double *yd)
{
    if (!sd_settle_provide_point(settle))
        return 1;
    if (!settle->system->left)
        return settle_unknowns(settle, t, y, yd);
    double *z = settle->room, *zd = z + settle->unknowns + 8;
    sd_settle_take_point(settle, y, yd, z, zd);
    int failed = settle_unknowns(settle, t, z, zd);
    follow_kept(settle, z, zd, y, yd);
    return failed;
}

int sd_settle_holds(sd_settle *settle, double t, double *y, double *yd)
{
    if (settle->calls == settle->failures || settle->seen || settle->system->left || !sd_settle_provide_point(settle))
        return 0;
    return holds_by_old(settle, t, y, yd, FINE);
}

int sd_settle_point(sd_settle *settle, double t, double *y, double *yd)
{
    if (!settle->seen)
        return settle_whole(settle, t, y, yd);
    double *whole = settle->seen->y, *whole_d = settle->seen->yd; /* taken before its rows are evaluated there, made behind them */
    sd_condensed_expand(settle->seen, y, whole, 0);
    sd_condensed_expand(settle->seen, yd, whole_d, 1);
    int failed = settle_whole(settle, t, whole, whole_d);
    sd_condensed_gather(settle->seen, whole, y);
    sd_condensed_gather(settle->seen, whole_d, yd);
    return failed;
}
