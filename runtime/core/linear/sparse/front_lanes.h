/* Passes over the panels of fronts (fronts.h): whole lanes of real or complex numbers. */
#ifndef SYSDYN_FRONT_LANES_H
#define SYSDYN_FRONT_LANES_H

#include "linear/sparse/fronts.h"
#include "linear/lanes.h"

#include <math.h>

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wpsabi" /* lanes are handed to functions that are always inlined */
#endif

#ifdef SD_COMPLEX
#define IN_LANES (SD_LANES / 2)
/* a sum of lanes, each times a number: with its real parts, with its imaginary parts */
typedef struct sd_lane_sum {
    sd_lanes real, imaginary;
} sd_lane_sum;

static inline __attribute__((always_inline)) void add_times(sd_lane_sum *sum, sd_lanes x, sd_number by)
{
    sum->real += x * creal(by);
    sum->imaginary += x * cimag(by);
}

static inline __attribute__((always_inline)) sd_lanes summed(sd_lane_sum sum)
{
    const sd_lanes i = sum.imaginary;
    return sum.real + (sd_lanes){-i[1], i[0], -i[3], i[2]};
}

/* one number of each column of a panel that are so far apart */
static inline __attribute__((always_inline)) sd_lanes across(const sd_number *x, int32_t apart)
{
    return (sd_lanes){creal(x[0]), cimag(x[0]), creal(x[apart]), cimag(x[apart])};
}

static inline __attribute__((always_inline)) sd_lanes sizes(sd_lanes x)
{
    const sd_lanes parts = SD_SIZES(x);
    return parts + (sd_lanes){parts[1], parts[0], parts[3], parts[2]};
}
#else
#define IN_LANES SD_LANES
typedef sd_lanes sd_lane_sum;

static inline __attribute__((always_inline)) void add_times(sd_lane_sum *sum, sd_lanes x, sd_number by)
{
    *sum += x * by;
}

static inline __attribute__((always_inline)) sd_lanes summed(sd_lane_sum sum)
{
    return sum;
}

static inline __attribute__((always_inline)) sd_lanes across(const sd_number *x, int32_t apart)
{
    return (sd_lanes){x[0], x[apart], x[2 * (int64_t)apart], x[3 * (int64_t)apart]};
}

static inline __attribute__((always_inline)) sd_lanes sizes(sd_lanes x)
{
    return SD_SIZES(x);
}
#endif

static inline int32_t whole_line(int32_t n)
{
    return (n + IN_LANES - 1) / IN_LANES * IN_LANES;
}

/* whole lanes times a number */
static inline __attribute__((always_inline)) void scale_lines(int32_t lines, sd_number by, sd_number *x)
{
    for (int32_t i = 0; i < lines; i += IN_LANES) {
        sd_lane_sum scaled = {0};
        add_times(&scaled, SD_FROM(x, i), by);
        SD_AT(x, i) = summed(scaled);
    }
}

/* lines of a front's panels */
static inline int32_t lines_of(const sd_front *front)
{
    return whole_line(front->many) + whole_line(front->wide);
}

/* numbers that it leaves */
static inline int64_t left_by(const sd_front *front)
{
    return (int64_t)front->wide * whole_line(front->wide);
}

/* the largest size among whole lanes of numbers; not finite where one is not */
static inline __attribute__((always_inline)) double largest_of(int32_t lines, const sd_number *x)
{
    sd_lanes most = {0.0}, sum = {0.0};
    for (int32_t i = 0; i < lines; i += IN_LANES) {
        const sd_lanes size = sizes(SD_FROM(x, i));
        const sd_bits larger = size > most;
        most = (sd_lanes)((larger & (sd_bits)size) | (~larger & (sd_bits)most));
        sum += size;
    }
    double largest = most[0];
    for (int k = 1; k < SD_LANES; k++)
        largest = most[k] > largest ? most[k] : largest;
    return isfinite(SD_TOTAL(sum)) ? largest : INFINITY;
}

enum sd_sum_into { SUM, MINUS, LESS }; /* what is there becomes the sum, its negative, or less by it */

/* `chunks` lanes of a sum of columns of a panel, each times a number of x: of those `places`, or so far apart */
static inline __attribute__((always_inline)) void sum_some_lines(enum sd_sum_into how, int chunks, int32_t many,
                                                                 const sd_number *panel, int32_t step, const sd_number *x,
                                                                 int32_t apart, const int32_t *places, sd_number *to)
{
    sd_lane_sum sum[4] = {0};
    for (int32_t k = 0; k < many; k++, panel += step) {
        const sd_number here = x[places ? places[k] : (int64_t)k * apart];
        for (int c = 0; c < chunks; c++)
            add_times(&sum[c], SD_FROM(panel, c * IN_LANES), here);
    }
    for (int c = 0; c < chunks; c++)
        if (how == SUM)
            SD_AT(to, c * IN_LANES) = summed(sum[c]);
        else if (how == MINUS)
            SD_AT(to, c * IN_LANES) = -summed(sum[c]);
        else
            SD_AT(to, c * IN_LANES) -= summed(sum[c]);
}

/* the same of whole lines */
static inline __attribute__((always_inline)) void sum_columns(enum sd_sum_into how, int32_t lines, int32_t many,
                                                              const sd_number *panel, int32_t step, const sd_number *x,
                                                              int32_t apart, const int32_t *places, sd_number *to)
{
    int32_t i = 0;
    for (; i + 4 * IN_LANES <= lines; i += 4 * IN_LANES)
        sum_some_lines(how, 4, many, panel + i, step, x, apart, places, to + i);
    if (lines - i == 3 * IN_LANES)
        sum_some_lines(how, 3, many, panel + i, step, x, apart, places, to + i);
    else if (lines - i == 2 * IN_LANES)
        sum_some_lines(how, 2, many, panel + i, step, x, apart, places, to + i);
    else if (lines - i == IN_LANES)
        sum_some_lines(how, 1, many, panel + i, step, x, apart, places, to + i);
}

#endif
