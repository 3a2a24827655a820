/* Slopes and projection of the underlying equation: see underlying.h. */
#include "steppers/explicit/underlying.h"

#include "steppers/stepper.h"
#include "linear/tuning.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ITERATIONS 12   /* of Newton for implicit efforts */
#define SLOW 0.1        /* contraction above which the factors are taken anew */
#define MOVES 6         /* of a projection */
#define EXACT 1e-16     /* next move, in magnitudes, that is not worth making */
#define CLOSE SD_CANCELS /* move with which a projection, or an iteration, that stagnates is content */
#define FRESH SD_SAME /* the same by factors of this very point, which contract: round-off of what is nearly zero */
#define STAGNANT 0.3
#define BORNE 1e3       /* of multipliers: slopes are solved for once, nothing corrects their digits */

sd_underlying *sd_underlying_new(sd_system *system, sd_linear *linear)
{
    sd_underlying *u = calloc(1, sizeof *u);
    if (!u)
        return NULL;
    size_t nnz = (size_t)system->entries + 1;
    size_t n = (size_t)(system->rows > system->unknowns ? system->rows : system->unknowns) + 1;
    u->memory = calloc(2 * (size_t)linear->entries + 1 + 2 * n, sizeof(double));
    u->place_y = calloc(2 * nnz, sizeof(int32_t));
    if (!u->memory || !u->place_y) {
        sd_underlying_free(u);
        return NULL;
    }
    u->place_yd = u->place_y + nnz;
    u->system = system;
    u->linear = linear;
    sd_linear_replayed(linear);
    if (linear->elimination) {
        linear->elimination->growth = BORNE;
        linear->elimination->orders = 1;
    }
    u->n = system->unknowns;
    u->first = system->kinematics;
    u->solved = linear->n;
    u->step = u->memory;
    u->rest = u->step + n;
    u->values = u->rest + n;
    u->factored = u->values + linear->entries + 1;
    u->factored_at = -1;
    return u;
}

void sd_underlying_free(sd_underlying *underlying)
{
    if (!underlying)
        return;
    free(underlying->place_y);
    free(underlying->r);
    free(underlying->list);
    free(underlying->from);
    free(underlying->memory);
    free(underlying);
}

/* A list of entries that a block of the matrix writes, behind those of the lists before. */
struct sd_written {
    sd_entries *block;
    const sd_frame *frame;
    double *to;
};

/* number of entries that the blocks of the matrix write */
static int32_t written_by(const sd_system *system)
{
    int32_t n = 0;
    for (const sd_call *call = system->call, *end = call + system->calls; call < end; call++)
        n += call->n_dy + call->n_dyd;
    return n;
}

/* Notes a list of n entries that is written to *to, and moves that on; they come to these places, where the first to come is
 * copied and others are added; none: where nothing has come yet. */
static void note_list(sd_underlying *u, sd_entries *block, const sd_frame *frame, int32_t n, const int32_t *slot,
                      const int32_t *place, int32_t none, double **to)
{
    const int32_t entries = u->linear->entries, at = (int32_t)(*to - u->written);
    if (n == 0)
        return;
    u->list[u->lists++] = (sd_written){block, frame, *to};
    for (int32_t e = 0; e < n; e++) {
        int32_t there = place[slot[e]];
        if (there < entries && u->from[there] == none) {
            u->from[there] = at + e;
        } else if (there < entries) {
            u->more[2 * u->mores] = there;
            u->more[2 * u->mores++ + 1] = at + e;
        }
    }
    *to += n;
}

/* Where the entries of the system stand in the matrix, and which of what the blocks write makes each: behind that there
 * is a zero.  0 or SD_MEMORY. */
static int find_places(sd_underlying *u)
{
    const sd_system *system = u->matrix;
    const int32_t none = written_by(system), entries = u->linear->entries;
    u->r = calloc((size_t)(u->system->rows + 2 + none), sizeof *u->r);
    u->from = malloc(((size_t)entries + 2 * (size_t)none + 1) * sizeof *u->from);
    u->list = malloc((2 * (size_t)system->calls + 1) * sizeof *u->list);
    if (!u->r || !u->from || !u->list)
        return SD_MEMORY;
    u->written = u->r + u->system->rows + 1;
    u->more = u->from + entries;
    for (int32_t e = 0; e < system->entries; e++)
        u->place_y[e] = u->place_yd[e] = entries;
    for (int32_t e = 0; e < entries; e++) {
        (u->from_rate[e] ? u->place_yd : u->place_y)[u->source[e]] = e;
        u->from[e] = none;
    }
    double *to = u->written;
    for (const sd_call *call = system->call, *end = call + system->calls; call < end; call++) {
        note_list(u, call->dy, &call->frame, call->n_dy, call->slot_dy, u->place_y, none, &to);
        note_list(u, call->dyd, &call->frame, call->n_dyd, call->slot_dyd, u->place_yd, none, &to);
    }
    u->flows = 0;
    for (int32_t i = 0; i < u->system->kinematics; i++)
        u->flows |= !u->rate[u->column[u->system->k_f[i]]];
    u->placed = 1;
    return SD_FINE;
}

static inline void write_entries(const sd_underlying *u, double t, const double *y, const double *yd)
{
    for (const sd_written *list = u->list, *end = list + u->lists; list < end; list++)
        list->block(list->frame, t, y, yd, list->to);
}

/* u->values := the matrix at (t, y, yd) */
static void evaluate_matrix(sd_underlying *u, double t, const double *y, const double *yd)
{
    const sd_system *system = u->matrix;
    double *const values = u->values, *const written = u->written;
    write_entries(u, t, y, yd);
    const int32_t *const from = u->from, *const more = u->more, entries = u->linear->entries;
    for (int32_t e = 0; e < entries; e++)
        values[e] = written[from[e]];
    for (int32_t k = 0; k < u->mores; k++)
        values[more[2 * k]] += written[more[2 * k + 1]];
    for (int32_t i = 0; i < system->clear; i++)
        values[u->place_y[system->cleared[i]]] = values[u->place_yd[system->cleared[i]]] = 0.0;
    for (int32_t i = 0; i < system->held; i++) {
        int32_t slot = system->held_slot[i];
        values[u->place_y[slot]] = values[u->place_yd[slot]] = 0.0;
        values[(system->held_rate[i] ? u->place_yd : u->place_y)[slot]] = 1.0;
    }
}

/* Whether the factors are those of these very values, as where the inertia is constant */
static int is_factored(sd_underlying *u)
{
    const size_t size = (size_t)u->linear->entries * sizeof *u->values;
    if (u->factored_at == u->linear->factorisations && !memcmp(u->values, u->factored, size))
        return 1;
    memcpy(u->factored, u->values, size);
    return 0;
}

static int factorise(sd_underlying *u, double t, const double *y, const double *yd)
{
    u->ready = 0;
    u->matrix->jacobian_evaluations++;
    evaluate_matrix(u, t, y, yd);
    if (*u->system->stop)
        return SD_STOPPED;
    if (!sd_finite(u->linear->entries, u->values)) {
        u->bad_row = u->first + u->linear->row[sd_first_bad(u->linear->entries, u->values)];
        return SD_NONFINITE;
    }
    if (is_factored(u))
        return u->ready = 1, SD_FINE;
    int failed = sd_linear_factor(u->linear, u->values, NULL);
    u->factored_at = failed ? -1 : u->linear->factorisations;
    if (failed) {
        u->bad_row = u->first + u->linear->bad_row;
        u->bad_column = u->linear->bad_column >= 0 ? u->unknown[u->linear->bad_column] : 0;
        return failed == 2 ? SD_MEMORY : SD_SINGULAR;
    }
    u->ready = 1;
    return SD_FINE;
}

/* The rows r solved for what they are off by, in their place.  NULL: something of it is no number. */
static const double *solve(sd_underlying *u)
{
    double *off = u->r + u->first;
    sd_linear_solve(u->linear, off);
    return sd_finite(u->solved, off) ? off : NULL;
}

/* z moved by the solution; the largest move of what is undifferentiated, in magnitudes */
static double correct(sd_underlying *u, double *y, double *yd)
{
    const double *off = solve(u);
    double size = off ? 0.0 : INFINITY;
    for (int32_t j = 0; j < u->solved && off; j++) {
        int32_t k = u->unknown[j];
        if (u->rate[j]) {
            yd[k] -= off[j];
        } else {
            y[k] -= off[j];
            size = fmax(size, fabs(off[j]) / (u->magnitude[k] + fabs(y[k])));
        }
    }
    return size;
}

/* q' = f: f may be among what is solved for */
static int kinematics(const sd_underlying *u, const double *y, double *yd)
{
    for (int32_t i = 0; i < u->system->kinematics; i++)
        yd[u->system->k_q[i]] = y[u->system->k_f[i]];
    return SD_FINE;
}

/* the cause where the slopes are no numbers: the residual first */
static int no_number(sd_underlying *u, double t, const double *y, const double *yd, int cause)
{
    if (!cause) /* the solution stands where the rows stood */
        sd_residual(u->direct ? u->applied : u->system, t, y, yd, u->r);
    int32_t bad = sd_first_bad(u->system->rows, u->r);
    u->bad_row = bad >= 0 ? bad : u->bad_row;
    return bad >= 0 || !cause ? SD_NONFINITE : cause;
}

/* z := 0, and q' = f */
static void clear(const sd_underlying *u, double *y, double *yd)
{
    double *const of[] = {y, yd};
    for (int32_t j = 0; j < u->solved; j++)
        of[u->rate[j] > 0][u->unknown[j]] = 0.0;
    kinematics(u, y, yd);
}

/* slopes where z is linear: of the rows at z = 0 */
static int at_once(sd_underlying *u, double t, double *y, double *yd)
{
    clear(u, y, yd);
    sd_residual(u->applied, t, y, yd, u->r);
    if (*u->system->stop)
        return SD_STOPPED;
    int cause = factorise(u, t, y, yd);
    const double *off = cause ? NULL : solve(u);
    if (!off)
        return no_number(u, t, y, yd, cause);
    double *const of[] = {y, yd};
    for (int32_t j = 0; j < u->solved; j++)
        of[u->rate[j] > 0][u->unknown[j]] = -off[j];
    return u->flows ? kinematics(u, y, yd) : SD_FINE;
}

void sd_underlying_switched(sd_underlying *u)
{
    u->ready = 0;
    u->factored_at = -1;
}

void sd_underlying_begin(sd_underlying *u, double tolerance, double *yd)
{
    u->tolerance = tolerance;
    for (int32_t j = 0; j < u->solved; j++)
        if (!u->rate[j])
            yd[u->unknown[j]] = 0.0;
}

int sd_underlying_slopes(sd_underlying *u, double t, double *y, double *yd)
{
    const sd_system *system = u->system;
    double before = 0.0;
    u->ready = 0;
    if (!u->placed && find_places(u))
        return SD_MEMORY;
    if (u->direct)
        return at_once(u, t, y, yd);
    kinematics(u, y, yd);
    for (int m = 0; m < ITERATIONS; m++) {
        sd_residual(u->system, t, y, yd, u->r);
        if (*system->stop)
            return SD_STOPPED;
        int cause = u->ready ? SD_FINE : factorise(u, t, y, yd);
        double size = cause ? INFINITY : correct(u, y, yd);
        if (!isfinite(size))
            return no_number(u, t, y, yd, cause);
        if (size <= DBL_EPSILON)
            return kinematics(u, y, yd);
        double ratio = m > 0 ? size / before : 1.0;
        if (m > 0 && ratio < 1.0 && size * ratio <= u->tolerance * (1.0 - ratio))
            return kinematics(u, y, yd);
        if (m > 1 && ratio > STAGNANT && size <= CLOSE) /* at the round-off of its rows: nothing is left to find */
            return kinematics(u, y, yd);
        if (m > 0 && ratio > SLOW)
            u->ready = 0;
        before = size;
    }
    return SD_NEWTON;
}

/* One kind of state moved onto its constraints (`rows` stand where their derivatives do): displacements, or flows and
 * momenta; content: with which move where it stagnates. */
static int onto(sd_underlying *u, sd_system *rows, int displacements, double content, double t, double *y)
{
    const sd_system *system = u->system;
    double before = INFINITY;
    for (int m = 0; m < MOVES; m++) {
        double size = 0.0;
        sd_residual(rows, t, y, u->rest, u->r);
        if (*system->stop)
            return SD_STOPPED;
        for (int32_t i = 0; i < system->held; i++) /* of a redundant constraint: it holds with the others */
            u->r[system->held_row[i]] = 0.0;
        const double *goal = displacements ? u->goal_position : u->goal_velocity;
        for (int32_t j = 0; j < u->solved; j++)
            u->step[j] = (goal ? goal[u->first + j] : 0.0) - u->r[u->first + j];
        sd_linear_solve(u->linear, u->step);
        if (!sd_finite(u->solved, u->step))
            return SD_NONFINITE;
        for (int32_t i = 0; displacements && i < system->kinematics; i++) {
            int32_t k = system->k_q[i];
            double move = u->step[u->column[system->k_f[i]]];
            y[k] += move;
            size = fmax(size, fabs(move) / (u->magnitude[k] + fabs(y[k])));
        }
        for (int32_t j = 0; !displacements && j < u->solved; j++)
            if (u->rate[j] == 2) {
                int32_t k = u->unknown[j];
                y[k] += u->step[j];
                size = fmax(size, fabs(u->step[j]) / (u->magnitude[k] + fabs(y[k])));
            }
        if (m == 0)
            u->drift = fmax(u->drift, size);
        if (size <= EXACT || (m > 0 && size * size <= EXACT * before))
            return SD_FINE;
        if (m > 0 && size > STAGNANT * before)
            return size <= content ? SD_FINE : SD_NEWTON;
        before = size;
    }
    return before <= content ? SD_FINE : SD_NEWTON;
}

void sd_underlying_constraints(sd_underlying *u, double t, const double *y, double *position, double *velocity)
{
    memset(position, 0, (size_t)u->system->rows * sizeof *position);
    memset(velocity, 0, (size_t)u->system->rows * sizeof *velocity);
    if (u->position)
        sd_residual(u->position, t, y, u->rest, position);
    if (u->velocity)
        sd_residual(u->velocity, t, y, u->rest, velocity);
    for (int32_t i = 0; i < u->system->held; i++)
        position[u->system->held_row[i]] = velocity[u->system->held_row[i]] = 0.0;
}

int sd_underlying_project(sd_underlying *u, double t, double *y, const double *yd)
{
    int cause = SD_FINE;
    if (!u->placed && find_places(u))
        return SD_MEMORY;
    for (int fresh = 0; fresh < 2; fresh++) {
        double content = fresh ? FRESH : CLOSE;
        u->drift = 0.0;
        if (!u->ready && (cause = factorise(u, t, y, yd)))
            return cause;
        cause = u->position ? onto(u, u->position, 1, content, t, y) : SD_FINE;
        if (cause == SD_FINE && u->velocity)
            cause = onto(u, u->velocity, 0, content, t, y);
        if (cause != SD_NEWTON)
            return cause;
        u->ready = 0;
    }
    return cause;
}
