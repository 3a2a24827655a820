/* Passes over the panels of fronts (fronts.h): whole lanes of real or complex numbers. */
#ifndef SYSDYN_FRONT_LANES_H
#define SYSDYN_FRONT_LANES_H

#include "linear/fronts.h"
#include "linear/lanes.h"

#include <math.h>

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wpsabi" /* lanes are handed to functions that are always inlined */
#endif

#ifdef SD_COMPLEX
#define IN_LANES (SD_LANES / 2)
/* what a lane's numbers are multiplied by: real parts twice, imaginary parts with the signs of their products */
typedef struct sd_multiplier {
    sd_lanes real, imaginary;
} sd_multiplier;

static inline __attribute__((always_inline)) sd_multiplier every(sd_number x)
{
    double re = creal(x), im = cimag(x);
    return (sd_multiplier){{re, re, re, re}, {-im, im, -im, im}};
}

static inline __attribute__((always_inline)) sd_lanes times(sd_lanes x, sd_multiplier by)
{
    return x * by.real + (sd_lanes){x[1], x[0], x[3], x[2]} * by.imaginary;
}

static inline __attribute__((always_inline)) sd_lanes sizes(sd_lanes x)
{
    const sd_lanes parts = SD_SIZES(x);
    return parts + (sd_lanes){parts[1], parts[0], parts[3], parts[2]};
}
#else
#define IN_LANES SD_LANES
typedef sd_lanes sd_multiplier;

static inline __attribute__((always_inline)) sd_multiplier every(sd_number x)
{
    return (sd_multiplier){x, x, x, x};
}

static inline __attribute__((always_inline)) sd_lanes times(sd_lanes x, sd_multiplier by)
{
    return x * by;
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
    sd_lanes sum[4] = {{0.0}};
    for (int32_t k = 0; k < many; k++, panel += step) {
        const sd_multiplier here = every(x[places ? places[k] : (int64_t)k * apart]);
        for (int c = 0; c < chunks; c++)
            sum[c] += times(SD_FROM(panel, c * IN_LANES), here);
    }
    for (int c = 0; c < chunks; c++)
        if (how == SUM)
            SD_AT(to, c * IN_LANES) = sum[c];
        else if (how == MINUS)
            SD_AT(to, c * IN_LANES) = -sum[c];
        else
            SD_AT(to, c * IN_LANES) -= sum[c];
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
