/* A Radau that is made, with the room that it works in, and let go of (see radau.h). */
#include "linear/lanes.h"
#include "steppers/radau/radau.h"
#include "system/condensed.h"

#include <stdlib.h>
#include <string.h>

enum { OWN = 4 }; /* vectors that every step hands on to the next one */
#define SPARE 64           /* numbers behind each set of vectors: two sets are room for what has a few more than they */

/* the stages of the last accepted step, before it was projected; y, yd [n] */
static void show(const void *self, int32_t s, double *y, double *yd)
{
    const sd_radau *radau = self;
    sd_radau_combine(radau->used->stages, radau->ivp.n, radau->used->inverse[s], radau->kept, radau->rate);
    const double *last = radau->last, *phi = radau->phi, *end = radau->kept[radau->used->stages - 1], *z = radau->kept[s];
    for (int32_t i = 0; i < radau->ivp.n && last; i++)
        y[i] = last[i] + z[i];
    for (int32_t i = 0; i < radau->ivp.n && !last; i++)
        y[i] = phi[i] - end[i] + z[i];
    for (int32_t i = 0; i < radau->ivp.n; i++)
        yd[i] = radau->rate[i] / radau->ivp.h_used;
}

/* Factors work in vectors of which nothing is read while they do: the point of a stage is made anew, as are rates of the whole
 * system where that has more; the right sides behind the first one are in others then.  Rows and columns of the complex
 * matrices are scaled as those of the real one.  0; 2: no memory */
static int borrow(sd_radau *radau)
{
    const sd_condensed *kept = (const sd_condensed *)radau->ivp.system->left;
    sd_linear *real = radau->linear;
    int failed = sd_linear_borrow(real, kept ? kept->yd : radau->y, NULL, NULL);
    for (int k = 0; k < (radau->most_stages - 1) / 2 && !failed; k++)
        failed = sd_linear_z_borrow(radau->complex_linear[k], (double complex *)radau->d[1 + 2 * k], real->row_scale,
                                    real->column_scale);
    return failed;
}

/* lets go of the room */
static void leave_room(sd_radau *radau)
{
    free(radau->jy);
    free(radau->at);
    free(radau->work);
    free(radau->led);
    radau->work = radau->ivp.ee = radau->ivp.weight = radau->last = NULL;
    radau->jy = NULL;
    radau->at = NULL;
    radau->led = NULL;
}

int sd_radau_room_for_slopes(sd_radau *radau)
{
    const size_t nnz = (size_t)radau->ivp.system->entries + 1;
    if (radau->jy && !radau->at)
        return 0;
    free(radau->jy);
    free(radau->at);
    radau->at = NULL;
    radau->jy = malloc(2 * nnz * sizeof *radau->jy);
    radau->jyd = radau->jy + nnz;
    return radau->jy ? 0 : -1;
}

/* whether columns j - 1 and j have the same slopes, number for number; before: where those of j - 1 begin in jy, jyd */
static int same_slopes(const sd_radau *radau, int32_t j, int32_t before)
{
    const int32_t *column = radau->ivp.system->column, first = column[j], number = column[j + 1] - first;
    const size_t size = (size_t)number * sizeof(double);
    return number == first - column[j - 1] && !memcmp(radau->jy + before, radau->jy + first, size) &&
           !memcmp(radau->jyd + before, radau->jyd + first, size);
}

/* The columns are looked at twice: where few are alike they stay where they are. */
void sd_radau_share_slopes(sd_radau *radau)
{
    const sd_system *system = radau->ivp.system;
    const int32_t n = radau->ivp.n, *column = system->column;
    if (!sd_radau_sparing(radau))
        return;
    int32_t left = column[1];
    for (int32_t j = 1; j < n && left <= system->entries / 2; j++)
        left += same_slopes(radau, j, column[j - 1]) ? 0 : column[j + 1] - column[j];
    int32_t *at = left <= system->entries / 2 ? malloc((size_t)n * sizeof *at) : NULL;
    if (!at)
        return;
    at[0] = 0;
    left = column[1];
    for (int32_t j = 1; j < n; j++) {
        at[j] = same_slopes(radau, j, at[j - 1]) ? at[j - 1] : left;
        if (at[j] < left)
            continue;
        for (int32_t e = column[j]; e < column[j + 1]; e++, left++) {
            radau->jy[left] = radau->jy[e];
            radau->jyd[left] = radau->jyd[e];
        }
    }
    memmove(radau->jy + left, radau->jyd, (size_t)left * sizeof(double));
    double *few = realloc(radau->jy, 2 * (size_t)left * sizeof *few);
    radau->jy = few ? few : radau->jy;
    radau->jyd = radau->jy + left;
    radau->at = at;
}

int sd_radau_provide(sd_radau *radau)
{
    const sd_system *system = radau->ivp.system;
    size_t nnz = (size_t)system->entries + 1, m = (size_t)sd_whole_lanes(radau->ivp.n + 1);
    double **vectors[] = {&radau->before, &radau->slope[0], &radau->slope[1], &radau->slope[2], &radau->last,
                          &radau->ivp.weight, &radau->y, &radau->rate, &radau->ivp.ee, &radau->terms, &radau->first};
    const int sparing = sd_radau_sparing(radau), kept = sparing && system->left;
    /* z and kept change places, and either has next to it what no step hands on (`spare`); the last three: of steep laws */
    double **of_stages[] = {radau->z, radau->d, radau->kept, radau->base, radau->full, radau->moved};
    size_t steep = system->scales > 0, number = kept ? OWN : sparing ? OWN + 4 : OWN + 5 + 2 * steep;
    size_t sets = sizeof of_stages / sizeof *of_stages - 3 + 3 * steep;
    size_t pairs = (size_t)(radau->most_stages - 1) / 2, all = number + sets * (size_t)radau->most_stages + 2 * pairs;
    const sd_condensed *left = (const sd_condensed *)system->left;
    if (radau->work)
        return 0;
    radau->in_place = kept && sd_condensed_in_place(left) && 2 * m <= (size_t)left->full->unknowns + 8;
    all -= radau->in_place ? 2 : 0;
    radau->work = calloc(all * m + sets * SPARE + (steep ? nnz : 0), sizeof(double));
    radau->led = calloc((size_t)radau->ivp.n + 1, sizeof *radau->led);
    if (!radau->work || !radau->led) {
        leave_room(radau);
        return -1;
    }
    double *next = radau->work;
    for (size_t i = 0; i < number; i++, next += m)
        *vectors[i] = next;
    for (size_t i = 0; i < sets; i++, next += SPARE) {
        for (int32_t s = 0; s < radau->most_stages; s++, next += m)
            of_stages[i][s] = next;
        for (size_t k = 0; k < pairs && of_stages[i] == radau->d; k++)
            if (k > 0 || !radau->in_place) {
                radau->w[k] = (double complex *)next;
                next += 2 * m;
            } else
                radau->w[k] = (double complex *)left->y;
    }
    if (kept) { /* the point of a stage is made anew behind each solution */
        radau->y = radau->in_place ? radau->d[1] : (double *)radau->w[0];
        radau->rate = radau->y + m;
    }
    if (sparing)
        radau->ivp.ee = radau->d[0];
    if (sparing ? borrow(radau) : sd_radau_room_for_slopes(radau)) {
        leave_room(radau);
        return -1;
    }
    radau->g = steep ? next : radau->linear->scaled; /* rows of steep laws are judged by the matrix as it is */
    return 0;
}

double *sd_radau_spare(void *self, size_t *numbers)
{
    sd_radau *radau = self;
    *numbers = (size_t)sd_whole_lanes(radau->ivp.n + 1) * (size_t)(3 * radau->most_stages - 1 - 2 * radau->in_place) + SPARE;
    return sd_radau_provide(radau) ? NULL : radau->z[0] < radau->d[0] ? radau->z[0] : radau->d[0];
}

void sd_radau_rest(sd_radau *radau)
{
    leave_room(radau);
    radau->ready = 0;
    sd_linear_rest(radau->linear);
    for (int k = 0; k < (radau->most_stages - 1) / 2; k++)
        if (radau->complex_linear[k])
            sd_linear_z_rest(radau->complex_linear[k]);
}

sd_radau *sd_radau_new(sd_system *system, sd_linear *linear, sd_linear_z *const *complex_linear, int32_t stages)
{
    sd_radau *radau = calloc(1, sizeof *radau);
    if (!radau)
        return NULL;
    size_t m = (size_t)sd_whole_lanes(system->unknowns + 1);
    radau->ivp.system = system;
    radau->linear = linear;
    radau->ivp.n = system->unknowns;
    radau->stages = sd_radau_methods[0].stages;
    radau->most_stages = stages;
    for (int32_t k = 0; k < (stages - 1) / 2; k++) {
        radau->complex_linear[k] = complex_linear[k];
        if (complex_linear[k])
            sd_linear_z_often(complex_linear[k]);
    }
    sd_linear_often(linear);
    radau->phi = calloc(2 * m, sizeof(double));
    radau->gap = calloc(SD_METHODS, sizeof *radau->gap);
    if (!radau->phi || !radau->gap || sd_radau_provide(radau)) {
        sd_radau_free(radau);
        return NULL;
    }
    radau->yd = radau->phi + m;
    sd_radau_gaps(radau->gap);
    radau->method = radau->used = sd_radau_methods;
    radau->ivp.stepper = (sd_stepper){
        .self = radau, .ivp = &radau->ivp, .n = radau->ivp.n, .y = radau->phi, .yd = radau->yd, .step = sd_radau_step,
        .dense = sd_radau_dense, .refine = sd_radau_refine, .start = sd_radau_start, .nodes = stages, .collocated = 1,
        .show = show, .spare = sd_radau_spare};
    return radau;
}

void sd_radau_free(sd_radau *radau)
{
    if (!radau)
        return;
    leave_room(radau);
    free(radau->phi);
    free(radau->powered);
    free(radau->gap);
    free(radau->at_zero);
    free(radau->open);
    sd_radau_free_coupled(radau->coupled);
    free(radau);
}
