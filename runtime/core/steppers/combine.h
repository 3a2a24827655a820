/* Sums of the vectors of stages. */
#ifndef SYSDYN_COMBINE_H
#define SYSDYN_COMBINE_H

#include "linear/lanes.h"

/* out [n] := sum_j weight[j] v[j] of the first `terms`, in whole lanes, for which all vectors have room */
static inline __attribute__((always_inline)) void sd_combine(int terms, int32_t n, const double *weight, double *const *v,
                                                             double *out)
{
    for (int32_t i = 0; i < n; i += SD_LANES) {
        sd_lanes total = weight[0] * SD_FROM(v[0], i);
        for (int j = 1; j < terms; j++)
            total += weight[j] * SD_FROM(v[j], i);
        SD_AT(out, i) = total;
    }
}

#endif
