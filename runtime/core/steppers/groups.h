/* Groups of unknowns that are states but for what those of each have in common: the error test of the bdf and of radau sees them
 * without that. */
#ifndef SYSDYN_GROUPS_H
#define SYSDYN_GROUPS_H

#include <stdint.h>

/* weight of an unknown in the error test */
typedef double sd_weight_of(const void *stepper, int32_t i);

/* Squares, in these weights, of x + by[0] one + by[1] two (NULL: none) over the unknowns of groups, without what those of each
 * have in common.  from [groups + 1]: where each begins in `member`. */
static inline __attribute__((always_inline)) double sd_squares_apart(int32_t groups, const int32_t *from, const int32_t *member,
                                                                     sd_weight_of *weight, const void *stepper, const double *x,
                                                                     const double *by, const double *one, const double *two)
{
    double sum = 0.0;
    for (int32_t g = 0; g < groups; g++) {
        const int32_t *first = member + from[g], *end = member + from[g + 1];
        double weights = 0.0, mean = 0.0;
        for (const int32_t *i = first; i < end; i++) {
            double w = weight(stepper, *i);
            weights += w * w;
            mean += w * w * (x[*i] + by[0] * one[*i] + (two ? by[1] * two[*i] : 0.0));
        }
        mean /= weights;
        for (const int32_t *i = first; i < end; i++) {
            double v = weight(stepper, *i) * (x[*i] + by[0] * one[*i] + (two ? by[1] * two[*i] : 0.0) - mean);
            sum += v * v;
        }
    }
    return sum;
}

#endif
