/* The factorisation of linear.c, elimination/elimination.c and sparse/sparse.c for complex matrices. */
#define SD_COMPLEX
#include "linear/sparse/sparse.c"

#include "linear/elimination/elimination_order.c"

#include "linear/elimination/elimination.c"

#include "linear/linear.c"

void sd_linear_z_bad(const sd_linear_z *linear, int32_t *row, int32_t *column)
{
    *row = linear->bad_row;
    *column = linear->bad_column;
}

double complex *sd_linear_z_values(sd_linear_z *linear)
{
    return linear->scaled;
}

void sd_linear_z_allow(sd_linear_z *linear, double null_pivot, const int32_t *idle)
{
    linear->null_pivot = null_pivot;
    linear->idle = idle;
}

int32_t sd_linear_z_rank(const sd_linear_z *linear)
{
    return linear->rank;
}
