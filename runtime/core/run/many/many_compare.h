/* What two runs of one model differ by at their instants of comparison, as accuracy/control.py has it. */
#ifndef SYSDYN_MANY_COMPARE_H
#define SYSDYN_MANY_COMPARE_H

#include <float.h>

#include "run/many/many.h"

#define SD_MANY_ROUND_OFF (64.0 * DBL_EPSILON)

/* largest relative difference of two runs, and the same over the accuracy wanted */
double sd_many_difference(const sd_many *many, const sd_pass *pass, const sd_samples *coarse, const sd_samples *fine,
                          double *over);

/* 1: two runs differ somewhere by PARTED times all that a quantity was since its start, and by much of what it is */
int sd_many_parted(const sd_many *many, const sd_pass *pass, const sd_samples *coarse, const sd_samples *fine);
/* of the samples only those at instants of other ones, which are fewer: a draft has no two within a part of a step */
void sd_many_match(const sd_many *many, sd_samples *mine, const sd_samples *other);

#endif
