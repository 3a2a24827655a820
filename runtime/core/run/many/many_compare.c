/* What two of many runs differ by: see many_compare.h. */
#include "run/many/many_compare.h"

#include <math.h>
#include <string.h>

/* size [columns] of the traced quantities, noise [columns] below which one is zero */
static void measures(const sd_many *many, const sd_pass *pass, double *size, double *noise, double *unit)
{
    const sd_run *run = pass->run;
    memset(unit, 0, (size_t)many->units * sizeof *unit);
    for (int32_t i = 0; i < many->written; i++)
        if (many->unit_of[i] >= 0)
            unit[many->unit_of[i]] = fmax(unit[many->unit_of[i]], pass->met[i]);
    for (int32_t q = 0; q < many->columns; q++)
        unit[many->unit[q]] = fmax(unit[many->unit[q]], run->largest[many->column[q]]);
    for (int32_t q = 0; q < many->columns; q++) {
        size[q] = fmax(run->largest[many->column[q]], SD_MANY_NOTHING * unit[many->unit[q]]);
        noise[q] = SD_MANY_ROUND_OFF * unit[many->unit[q]];
    }
}

/* what a value at a step moves by within the time tolerance: as its rate says, but no faster than rules.bend times what the
 * steps beside it show (accuracy/control.py) */
static double lateness(const sd_many *many, const sd_samples *own, int32_t k, int32_t q)
{
    double least = INFINITY;
    size_t columns = (size_t)many->columns;
    for (int32_t side = k - 1; !many->known && side <= k; side++) {
        if (side < 0 || side + 1 >= own->number)
            continue;
        double rise = own->value[(size_t)(side + 1) * columns + q] - own->value[(size_t)side * columns + q];
        least = fmin(least, fabs(rise / (own->time[side + 1] - own->time[side])));
    }
    return fmin(own->late[(size_t)k * columns + q], many->rules.bend * many->late * least);
}

double sd_many_difference(const sd_many *many, const sd_pass *pass, const sd_samples *coarse, const sd_samples *fine,
                          double *over)
{
    double *size = many->work, *noise = size + many->columns, worst = 0.0;
    measures(many, pass, size, noise, noise + many->columns);
    *over = 0.0;
    if (coarse->number != fine->number)
        return *over = INFINITY;
    for (int32_t q = 0; q < many->columns; q++) {
        double largest = 0.0, apart = 0.0;
        if (size[q] == 0.0 || isinf(many->target[q]))
            continue;
        for (int32_t k = 0; k < fine->number; k++) {
            size_t at = (size_t)k * many->columns + q;
            double a = coarse->value[at], b = fine->value[at];
            double d = fmax(fabs(b - a) - fmax(lateness(many, coarse, k, q), fine->late[at]), 0.0);
            d = isfinite(a) && isfinite(b) ? d : INFINITY;
            largest = fmax(largest, fmax(fabs(a), fabs(b)));
            apart = fmax(apart, d);
        }
        if (largest <= noise[q])
            continue;
        if (size[q] > many->rules.hidden * largest)
            apart = INFINITY; /* it did something between the instants of comparison */
        apart = isfinite(size[q]) ? apart / size[q] : INFINITY;
        worst = fmax(worst, apart);
        *over = fmax(*over, apart / many->target[q]);
    }
    return worst;
}

int sd_many_parted(const sd_many *many, const sd_pass *pass, const sd_samples *coarse, const sd_samples *fine)
{
    double *size = many->work, *noise = size + many->columns;
    measures(many, pass, size, noise, noise + many->columns);
    for (int32_t q = 0; q < many->columns && fine->number; q++) {
        double most = fabs(fine->value[q]);
        if (!(most > noise[q]))
            continue;
        for (int32_t k = 1; k < fine->number; k++) {
            size_t at = (size_t)k * many->columns + q;
            double a = coarse->value[at], b = fine->value[at];
            if (fabs(b - a) - fine->late[at] > fmax(many->rules.parted * most, many->rules.much * fmax(fabs(a), fabs(b))))
                return 1;
            most = fmax(most, fabs(b));
        }
    }
    return 0;
}

void sd_many_match(const sd_many *many, sd_samples *mine, const sd_samples *other)
{
    int32_t n = 0;
    size_t columns = (size_t)many->columns, bytes = columns * sizeof(double);
    for (int32_t k = 0; k < mine->number && n < other->number; k++) {
        if (mine->time[k] != other->time[n])
            continue;
        mine->time[n] = mine->time[k];
        memmove(mine->value + n * columns, mine->value + k * columns, bytes);
        memmove(mine->late + n * columns, mine->late + k * columns, bytes);
        n++;
    }
    mine->number = n;
}
