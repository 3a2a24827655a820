/* linear.h for complex matrices: G = A + i B on one fixed pattern with real magnitudes of the unknowns. */
#ifndef SYSDYN_COMPLEX_LINEAR_H
#define SYSDYN_COMPLEX_LINEAR_H

#include "linear/linear.h"

#include <complex.h>
#include <stdint.h>

typedef struct sd_linear_z sd_linear_z;

sd_linear_z *sd_linear_z_new(int32_t n, const int32_t *column, const int32_t *row, const int32_t *order);
/* as sd_linear_ordered */
sd_linear_z *sd_linear_z_ordered(int32_t n, const int32_t *column, const int32_t *row, const sd_order *order);
void sd_linear_z_free(sd_linear_z *linear);
/* as sd_linear_pivoted */
int32_t *sd_linear_z_pivoted(sd_linear_z *linear);
/* as sd_linear_replayed */
void sd_linear_z_replayed(sd_linear_z *linear);
/* as sd_linear_often */
void sd_linear_z_often(sd_linear_z *linear);
/* as sd_linear_again */
void sd_linear_z_again(sd_linear_z *linear);
/* as sd_linear_factor; values may stand in sd_linear_z_values [entries], where they are scaled in place */
double complex *sd_linear_z_values(sd_linear_z *linear);
int sd_linear_z_factor(sd_linear_z *linear, const double complex *values, const double *scale);
void sd_linear_z_solve(sd_linear_z *linear, double complex *x);
/* as sd_linear_borrow, sd_linear_scale_sum, sd_linear_factor_sum */
int sd_linear_z_borrow(sd_linear_z *linear, double complex *work, double *row_scale, double *column_scale);
void sd_linear_z_scale_sum(sd_linear_z *linear, const double *a, const double *b, const int32_t *at, const double complex *c,
                           const double *scale);
int sd_linear_z_factor_sum(sd_linear_z *linear);
/* as sd_linear_rest */
void sd_linear_z_rest(sd_linear_z *linear);
/* null_pivot and idle of linear.h; the rank of the last factors */
void sd_linear_z_allow(sd_linear_z *linear, double null_pivot, const int32_t *idle);
int32_t sd_linear_z_rank(const sd_linear_z *linear);
/* where the last factorisation found its smallest pivot */
void sd_linear_z_bad(const sd_linear_z *linear, int32_t *row, int32_t *column);

#endif
