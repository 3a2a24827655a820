/* A matrix of which factors are asked for, column by column: entries as they stand, or those of R (A + c B) C, which are made
 * where they are read: together they would be as long as the factors of a line. */
#ifndef SYSDYN_MATRIX_H
#define SYSDYN_MATRIX_H

#include "linear/number.h"

#include <stdint.h>

typedef struct sd_matrix sd_matrix;

/* pattern, compressed columns; arrays of the caller, but for room */
struct sd_matrix {
    const int32_t *column, *row;
    const sd_number *value;         /* [entries]; NULL: the sum */
    const double *a, *b;            /* A, B, whose entries of a column begin at `at`: columns that are alike may stand once */
    const int32_t *at;              /* [columns] */
    const double *row_scale, *column_scale; /* of R, C */
    sd_number c;
    sd_number *room;                /* [entries of the longest column] */
};

/* an entry of (A + c B) C, s: of C; place: where it stands in A and B */
static inline sd_number sd_entry_of_sum(const sd_matrix *matrix, int32_t place, double s)
{
    return (matrix->a[place] + matrix->c * matrix->b[place]) * s;
}

/* the entries of column c from its first one on, until the next column is asked for */
static inline const sd_number *sd_column_of(const sd_matrix *matrix, int32_t c)
{
    const int32_t first = matrix->column[c], number = matrix->column[c + 1] - first;
    if (matrix->value)
        return matrix->value + first;
    const double s = matrix->column_scale[c];
    const int32_t at = matrix->at[c];
    for (int32_t i = 0; i < number; i++)
        matrix->room[i] = sd_entry_of_sum(matrix, at + i, s) * matrix->row_scale[matrix->row[first + i]];
    return matrix->room;
}

#endif
