/* The factorisation of linear.c and sparse.c for complex matrices. */
#define SD_COMPLEX
#include "sparse.c"

#include "linear.c"

void sd_linear_z_bad(const sd_linear_z *linear, int32_t *row, int32_t *column)
{
    *row = linear->bad_row;
    *column = linear->bad_column;
}
