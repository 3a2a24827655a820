/* What a point leaves of its rows: see settle_room.h. */
#include "system/settle_room.h"

#include <math.h>

#include "linear/lanes.h"

/* of the scaled residuals of rows: the largest one, that among rows which are not the rate of another, the sum of squares of
 * constraints */
typedef struct measured {
    double worst, own, sum;
} measured;

typedef int32_t sorts __attribute__((vector_size(4 * SD_LANES), aligned(4), may_alias));

/* a where `of` says so, else b */
#define PICK(of, a, b) ((sd_lanes)(((of) & (sd_bits)(a)) | (~(of) & (sd_bits)(b))))

/* those of the first rows, a whole number of lanes */
static SD_WIDE void measure_lanes(int32_t rows, const double *r, const double *scale, const int32_t *sort, measured *found)
{
    const sd_lanes none = {0.0}, most = none + INFINITY;
    sd_lanes worst = none, own = none, sum = none;
    for (int32_t i = 0; i < rows; i += SD_LANES) {
        const sd_lanes size = SD_SIZES(SD_FROM(r, i) * SD_FROM(scale, i));
        const sd_lanes v = PICK(size < most, size, most); /* of what is no number the next row would be larger */
        const sorts kind = *(const sorts *)(sort + i);
        const sd_bits constraint = __builtin_convertvector(kind == SD_CONSTRAINT, sd_bits);
        const sd_bits its_own = __builtin_convertvector(kind != SD_RATE, sd_bits);
        const sd_lanes among = (sd_lanes)((sd_bits)v & its_own), part = (sd_lanes)((sd_bits)v & constraint);
        worst = PICK(v > worst, v, worst);
        own = PICK(among > own, among, own);
        sum += part * part;
    }
    for (int k = 0; k < SD_LANES; k++) {
        found->worst = worst[k] > found->worst ? worst[k] : found->worst;
        found->own = own[k] > found->own ? own[k] : found->own;
    }
    found->sum = SD_TOTAL(sum);
}

double sd_settle_measure(sd_settle *settle, double t, const double *y, const double *yd)
{
    const int32_t whole = settle->rows - settle->rows % SD_LANES;
    measured found = {0.0, 0.0, 0.0};
    sd_residual(settle->system, t, y, yd, settle->r);
    if (whole)
        measure_lanes(whole, settle->r, settle->row_scale, settle->sort, &found);
    for (int32_t i = whole; i < settle->rows; i++) {
        double v = fabs(settle->r[i] * settle->row_scale[i]);
        v = v < INFINITY ? v : INFINITY;
        found.worst = v > found.worst ? v : found.worst;
        if (settle->sort[i] == SD_CONSTRAINT)
            found.sum += v * v;
        if (settle->sort[i] != SD_RATE && v > found.own)
            found.own = v;
    }
    settle->own = found.own;
    settle->residual = found.worst;
    settle->constraints = sqrt(found.sum);
    return found.worst;
}
