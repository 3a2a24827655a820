/* The numbers of a factorisation: double, or double complex where SD_COMPLEX is defined.
 *
 * linear.c, elimination/elimination.c and sparse/sparse.c are written once and compiled twice; complex_linear.c gives the complex ones
 * names of their own.
 */
#ifndef SYSDYN_NUMBER_H
#define SYSDYN_NUMBER_H

#include <math.h>

/* a function that is called seldom stays out of the one that calls it, whose registers it would want */
#ifdef __GNUC__
#define SD_APART __attribute__((noinline))
#else
#define SD_APART
#endif

#define SD_LEAST_PIVOT 1e-290 /* part of its column below which a pivot is none, where every one but zero counts */

#ifdef SD_COMPLEX
#include <complex.h>

typedef double complex sd_number;

/* |re| + |im|: within sqrt(2) of the modulus, and good enough to choose pivots */
static inline double sd_size(sd_number x)
{
    return fabs(creal(x)) + fabs(cimag(x));
}

static inline double sd_square(sd_number x)
{
    return creal(x) * creal(x) + cimag(x) * cimag(x);
}

static inline sd_number sd_conjugate(sd_number x)
{
    return CMPLX(creal(x), -cimag(x));
}

/* 1 / x by the plain formula, which overflows before x does: those who judge what comes of it see numbers that are not finite */
static inline sd_number sd_inverse(sd_number x)
{
    double size = creal(x) * creal(x) + cimag(x) * cimag(x);
    return CMPLX(creal(x) / size, -cimag(x) / size);
}

#define sd_linear sd_linear_z
#define sd_linear_new sd_linear_z_new
#define sd_linear_free sd_linear_z_free
#define sd_linear_factor sd_linear_z_factor
#define sd_linear_solve sd_linear_z_solve
#define sd_linear_pivoted sd_linear_z_pivoted
#define sd_linear_ordered sd_linear_z_ordered
#define sd_linear_replayed sd_linear_z_replayed
#define sd_linear_often sd_linear_z_often
#define sd_linear_again sd_linear_z_again
#define sd_linear_left sd_linear_z_left
#define sd_elimination sd_elimination_z
#define sd_elimination_new sd_elimination_z_new
#define sd_elimination_free sd_elimination_z_free
#define sd_elimination_forget sd_elimination_z_forget
#define sd_elimination_order sd_elimination_z_order
#define sd_elimination_learn sd_elimination_z_learn
#define sd_elimination_factor sd_elimination_z_factor
#define sd_elimination_solve sd_elimination_z_solve
#define sd_sparse sd_sparse_z
#define sd_sparse_new sd_sparse_z_new
#define sd_sparse_free sd_sparse_z_free
#define sd_sparse_pivot sd_sparse_z_pivot
#define sd_sparse_refactor sd_sparse_z_refactor
#define sd_sparse_solve sd_sparse_z_solve
#define sd_sparse_basic sd_sparse_z_basic
#define sd_sparse_lend sd_sparse_z_lend
#define sd_linear_borrow sd_linear_z_borrow
#define sd_linear_scale_sum sd_linear_z_scale_sum
#define sd_linear_factor_sum sd_linear_z_factor_sum
#define sd_linear_rest sd_linear_z_rest
#define sd_linear_effort sd_linear_z_effort
#define sd_sparse_rest sd_sparse_z_rest
#define sd_matrix sd_matrix_z
#else

typedef double sd_number;

static inline double sd_size(sd_number x)
{
    return fabs(x);
}

static inline double sd_square(sd_number x)
{
    return x * x;
}

static inline sd_number sd_conjugate(sd_number x)
{
    return x;
}

static inline sd_number sd_inverse(sd_number x)
{
    return 1.0 / x;
}
#endif

#endif
