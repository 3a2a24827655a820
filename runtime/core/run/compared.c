/* Rows for the comparison of runs: see compared.h. */
#include "run/compared.h"

#include <math.h>
#include <string.h>

/* Whether something observed relaxes at t within a small part of the last step, which began with it: by the equations,
 * whose rates `row` has, it is under way to where the dense output is not.  Then the row is for the comparison alone, and
 * has in the place of its energies how many times as long the step is, and the largest part of its largest that something
 * moves by since then as fast as the equations and the dense output differ. */
static int relaxes(const sd_run *run, double t, double *row)
{
    const double *rate = row + SD_ROW_HEAD + run->observed;
    double h = run->t_to - run->t_from, since = t - run->t_from, most = 0.0;
    for (int32_t i = 0; i < run->observed; i++) {
        const double apart = fabs(rate[i] - run->slope[i]);
        if (run->largest[i] > run->nothing[i] && isfinite(apart)) /* what is no number is said elsewhere */
            most = fmax(most, apart / run->largest[i]);
    }
    if (!(most * h > run->swift))
        return 0;
    row[2] = h / since;
    row[3] = most * since;
    return 1;
}

/* The row just written once more for the comparison alone, with the slopes of the dense output.  The rates of a settled
 * point are those of the equations: a motion that relaxes at once makes of any error a rate without bound. */
void sd_run_compare(sd_run *run, double t, double *row, int begun)
{
    size_t width = (size_t)(SD_ROW_HEAD + 2 * run->observed);
    int32_t others = (int32_t)row[1] & ~SD_COMPARED;
    if (others) {
        memcpy(row + width, row, width * sizeof *row);
        row[1] = (double)others;
        row += width;
        run->rows++;
    }
    row[1] = SD_COMPARED | (begun && relaxes(run, t, row) ? SD_RELAXING : 0);
    memcpy(row + SD_ROW_HEAD + run->observed, run->slope, (size_t)run->observed * sizeof *row);
}
