/* Four numbers at a time: passes over arrays that end on a whole number of lanes, and the widest registers of a machine.
 *
 * SD_WIDE: a function is compiled twice, and the machine takes the one with registers of four doubles if it has them.  Both
 * do the same operations in the same order (no fused products): results do not depend on the machine.
 */
#ifndef SYSDYN_LANES_H
#define SYSDYN_LANES_H

#include <stdint.h>
#include <stdlib.h> /* says which C library it is */
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

enum { SD_LANES = 4 };

typedef double sd_lanes __attribute__((vector_size(8 * SD_LANES), aligned(8), may_alias));
typedef int64_t sd_bits __attribute__((vector_size(8 * SD_LANES), aligned(8), may_alias));

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && !defined(SD_NARROW)
#define SD_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define SD_WIDE
#endif

/* a function whose loops are short: what vectors ask before they begin would take longer */
#if defined(__GNUC__) && !defined(__clang__)
#define SD_ONE_BY_ONE __attribute__((optimize("no-tree-vectorize")))
#else
#define SD_ONE_BY_ONE
#endif

/* room for n numbers in whole lanes */
static inline int32_t sd_whole_lanes(int32_t n)
{
    return (n + SD_LANES - 1) / SD_LANES * SD_LANES;
}

/* x[i .. i + SD_LANES) */
#define SD_AT(x, i) (*(sd_lanes *)((x) + (i)))
#define SD_FROM(x, i) (*(const sd_lanes *)((x) + (i)))
#define SD_SIZES(x) ((sd_lanes)((sd_bits)(x) & INT64_MAX))
#define SD_TOTAL(x) ((x)[0] + (x)[1] + (x)[2] + (x)[3])

/* Until `sd_subnormals` gets back what this gives, numbers below 1e-307 are zeros where the machine can: each of them costs it a
 * hundred cycles.  In a factorisation of rows of size one they are less than round-off even beside its least pivot
 * (SD_LEAST_PIVOT). */
static inline unsigned sd_no_subnormals(void)
{
#ifdef __SSE2__
    unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040); /* results, operands */
    return before;
#else
    return 0;
#endif
}

static inline void sd_subnormals(unsigned before)
{
#ifdef __SSE2__
    _mm_setcsr(before);
#else
    (void)before;
#endif
}

#endif
