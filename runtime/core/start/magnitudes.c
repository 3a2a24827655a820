#include "start/magnitudes.h"

#include "linear/tuning.h"

#include <stdlib.h>
#include <string.h>

#define SWEEPS 8
#define SMALL SD_SMALL /* of the largest coefficient of its row and kind: it proposes much, and is asked last */
#define DUST SD_DEPENDENT /* the same: what is left of a zero, and is never asked */
#define NOTHING 1e-280 /* less is no magnitude */
#define TENTH 0.1 /* of a proposal that a steep law does not bear: the next one */
#define SHORTER 320 /* of them: from the largest double to one */
#define BEYOND 1e6 /* of the largest known of its kind: what a proposal is at most */

/* small [entries] := 1 where a coefficient is small beside the largest of its row and kind, 2 where it is none; line [rows]: room.  Entries of
 * a kind lie beside each other, for unknowns do. */
static int find_small(const sd_balance *m, const double *size, char *small, double *line)
{
    int32_t runs = 0, room = 64;
    int32_t *run = malloc((size_t)room * sizeof *run);
    for (int32_t e = 0; run && e < m->entries; e++)
        if (!e || m->kind[m->column[e]] != m->kind[m->column[e - 1]]) {
            if (runs + 1 == room) {
                int32_t *more = realloc(run, 2 * (size_t)room * sizeof *run);
                if (!more) {
                    free(run);
                    return -1;
                }
                run = more;
                room *= 2;
            }
            run[runs++] = e;
        }
    if (!run)
        return -1;
    run[runs] = m->entries;
    for (int32_t kind = 0; kind < m->kinds; kind++)
        for (int pass = 0; pass < 3; pass++) /* nothing known, the largest, beside the largest */
            for (int32_t k = 0; k < runs; k++) {
                if (m->kind[m->column[run[k]]] != kind)
                    continue;
                for (int32_t e = run[k]; e < run[k + 1]; e++) {
                    double *leading = line + m->row[e];
                    if (pass == 0)
                        *leading = 0.0;
                    else if (pass == 1)
                        *leading = size[e] > *leading ? size[e] : *leading;
                    else
                        small[e] = size[e] < DUST * *leading ? 2 : size[e] < SMALL * *leading;
                }
            }
    free(run);
    return 0;
}

char *sd_small(const sd_balance *m, const double *size)
{
    char *small = malloc((size_t)m->entries + 1);
    double *line = malloc(((size_t)m->rows + 1) * sizeof *line);
    if (!small || !line || find_small(m, size, small, line)) {
        free(small);
        small = NULL;
    }
    free(line);
    return small;
}

static int closed(const sd_balance *m, const double *found)
{
    for (int32_t k = 0; k < m->unknowns; k++)
        if (found[k] == 0.0)
            return 0;
    return 1;
}

/* slopes [entries] at the point, moved by the proposals for what is not found yet: all by different parts, so that
 * differences of two move too; way: 1 or -1 */
static void slopes_beside(const sd_balance *m, const sd_bearing *bearing, int way, const double *found,
                          const double *best, double *moved, double *slopes)
{
    double apart = 0.0;
    for (int32_t k = 0; k < m->unknowns; k++) {
        apart = sd_next_part(apart);
        int proposed = found[k] == 0.0 && isfinite(best[k]);
        moved[k] = bearing->y[k] + (proposed ? way * (1.0 + apart) * best[k] : 0.0);
    }
    sd_slopes(bearing->system, bearing->t, moved, bearing->yd, 0, slopes);
}

/* Proposals best [unknowns] of a sweep are shortened until none, by the slopes that it leads to, makes 1 / SMALL times what
 * balances a steep row (line [rows], where it is known), or of its terms at the point. */
static void bear(const sd_balance *m, const sd_bearing *bearing, const double *size, const double *line,
                 const double *found, double *best)
{
    double *limit = bearing->work, *moved = limit + m->rows, *slopes = moved + m->unknowns + SD_LANES;
    char *heavy = (char *)(slopes + m->entries); /* [unknowns] */
    sd_steep_terms(bearing->system, bearing->t, bearing->y, bearing->yd, limit);
    for (int32_t r = 0; r < m->rows; r++)
        limit[r] = limit[r] != 0.0 && line[r] > 0.0 ? sd_larger(limit[r], line[r]) / SMALL : INFINITY;
    for (int pass = 0, changed = 1; pass < SHORTER && changed; pass++) {
        memset(heavy, 0, (size_t)m->unknowns);
        for (int way = 1; way >= -1; way -= 2) {
            slopes_beside(m, bearing, way, found, best, moved, slopes);
            for (int32_t e = 0; e < m->entries; e++)
                if (size[e] > 0.0 && isfinite(limit[m->row[e]]))
                    heavy[m->column[e]] |= !(fabs(slopes[e]) * best[m->column[e]] <= limit[m->row[e]]);
        }
        changed = 0;
        for (int32_t k = 0; k < m->unknowns; k++)
            if (heavy[k] && found[k] == 0.0 && isfinite(best[k]) && best[k] != 0.0) {
                best[k] *= TENTH;
                changed = 1;
            }
    }
}

int sd_propagate(const sd_balance *m, const double *size, const double *excited, const char *silent, int32_t flags,
                 double *found)
{
    if (closed(m, found))
        return 0;
    char *small = sd_small(m, size);
    int failed = small ? sd_propagate_beside(m, size, small, excited, silent, NULL, flags, found) : -1;
    free(small);
    return failed;
}

int sd_propagate_beside(const sd_balance *m, const double *size, const char *small, const double *excited,
                        const char *silent, const sd_bearing *bearing, int32_t flags, double *found)
{
    size_t n = (size_t)m->unknowns, rows = (size_t)m->rows;
    int open = !closed(m, found);
    if (!open)
        return 0;
    double *memory = malloc((rows + n + (size_t)m->kinds + 1) * sizeof *memory);
    double *line = memory, *best = line + rows, *known = best + n;
    if (!memory)
        return -1;
    double worst = flags & SD_LARGEST ? 0.0 : INFINITY;
    for (int sweep = 0; sweep < SWEEPS && open; sweep++) {
        memcpy(line, excited, rows * sizeof *line);
        for (int32_t e = 0; e < m->entries; e++)
            if (size[e] > 0.0)
                line[m->row[e]] = sd_larger(line[m->row[e]], size[e] * found[m->column[e]]);
        /* small coefficients are asked only where no other is left */
        int leads = 0;
        for (int32_t e = 0; e < m->entries && !leads; e++)
            leads = size[e] > 0.0 && found[m->column[e]] == 0.0 && line[m->row[e]] > 0.0 && !small[e] &&
                    !(silent && silent[m->row[e]]);
        for (size_t k = 0; k < n; k++)
            best[k] = worst;
        for (int32_t e = 0; e < m->entries; e++) {
            int32_t c = m->column[e];
            if (!(size[e] > 0.0) || found[c] != 0.0 || !(line[m->row[e]] > 0.0) || (silent && silent[m->row[e]]))
                continue;
            if (small[e] == 2 || (leads && small[e]))
                continue;
            double proposed = line[m->row[e]] / size[e];
            best[c] = flags & SD_LARGEST ? sd_larger(best[c], proposed) : sd_smaller(best[c], proposed);
        }
        if (flags & SD_CAPPED) {
            memset(known, 0, (size_t)m->kinds * sizeof *known);
            for (size_t k = 0; k < n; k++)
                known[m->kind[k]] = sd_larger(known[m->kind[k]], found[k]);
            for (size_t k = 0; k < n; k++)
                if (known[m->kind[k]] > 0.0)
                    best[k] = sd_smaller(best[k], known[m->kind[k]]);
        }
        if (bearing)
            bear(m, bearing, size, line, found, best);
        int changed = 0;
        open = 0;
        for (size_t k = 0; k < n; k++)
            if (found[k] == 0.0) {
                if (isfinite(best[k]) && best[k] != 0.0) {
                    found[k] = best[k];
                    changed = 1;
                } else {
                    open = 1;
                }
            }
        if (!changed)
            break;
    }
    free(memory);
    return 0;
}

int sd_scale(const sd_balance *m, const double *nominal, int32_t first, const char *rated, const int32_t *member,
             int32_t members, const double *x, double *jacobian, double *residual, double *scale)
{
    double *most = calloc(2 * ((size_t)members + 1), sizeof *most), *known = most + members + 1;
    if (!most)
        return -1;
    for (int32_t k = 0; k < m->unknowns; k++)
        scale[k] = nominal && k < first && nominal[k] > 0.0 ? nominal[k] : fabs(x[k]);
    for (int32_t k = 0; k < first; k++)
        known[member[k]] = sd_larger(known[member[k]], scale[k]);
    for (int32_t r = 0; r < m->rows; r++)
        residual[r] = isfinite(residual[r]) ? fabs(residual[r]) : 0.0;
    for (int32_t e = 0; e < m->entries; e++)
        jacobian[e] = isfinite(jacobian[e]) ? fabs(jacobian[e]) : 0.0;
    char *small = sd_small(m, jacobian);
    int failed = small ? sd_propagate_beside(m, jacobian, small, residual, rated, NULL, 0, scale) : -1;
    /* by the slope of a junction that blocks 1e135 V balance its leak: beside what is known of its like that is no size */
    for (int32_t k = 0; k < first; k++)
        if (known[member[k]] > 0.0)
            scale[k] = sd_smaller(scale[k], BEYOND * known[member[k]]);
    /* unknowns of y are no less than a thousandth of their like */
    for (int32_t k = 0; k < first; k++)
        most[member[k]] = sd_larger(most[member[k]], scale[k]);
    for (int32_t k = 0; k < first; k++) {
        scale[k] = sd_larger(scale[k], SMALL * most[member[k]]);
        scale[k] = scale[k] > NOTHING ? scale[k] : 1.0;
    }
    failed |= small ? sd_propagate_beside(m, jacobian, small, residual, NULL, NULL, 0, scale) : -1;
    free(small);
    for (int32_t k = 0; k < m->unknowns; k++)
        scale[k] = scale[k] > NOTHING ? scale[k] : 1.0;
    free(most);
    return failed;
}

double sd_excitation(sd_system *system, double t0, double span, const double *y, const double *yd, const double *part,
                     int32_t parts, double noise, double *moves)
{
    size_t rows = (size_t)system->rows;
    double *base = malloc((3 * rows + 1) * sizeof *base), quick = INFINITY;
    if (!base)
        return -1.0;
    double *early = base + rows, *now = early + rows;
    sd_residual(system, t0, y, yd, base);
    memset(moves, 0, rows * sizeof *moves);
    for (int32_t k = 0; k < parts && !*system->stop; k++) {
        sd_residual(system, t0 + span * part[k], y, yd, now);
        for (size_t r = 0; r < rows; r++) {
            double moved = fabs(now[r] - base[r]);
            moved = isfinite(moved) ? moved : 0.0;
            moves[r] = moved > moves[r] ? moved : moves[r];
            if (k == 0)
                early[r] = moved;
        }
    }
    for (size_t r = 0; r < rows; r++)
        if (early[r] > noise * moves[r])
            quick = fmin(quick, part[0] * span * moves[r] / early[r]);
    free(base);
    return quick;
}

int sd_row_sizes(sd_system *system, double t, int32_t points, int32_t extended, const double *y, const double *yd,
                 int32_t entries, const int32_t *entry, const int32_t *of, int32_t sizes, double *size)
{
    double *jy = malloc((2 * (size_t)system->entries + 1) * sizeof *jy);
    if (!jy)
        return -1;
    memset(size, 0, (size_t)points * (size_t)sizes * sizeof *size);
    for (int32_t k = 0; k < points; k++, size += sizes) {
        sd_jacobian(system, t, y + (size_t)k * (size_t)extended, yd, NULL, jy, jy + system->entries);
        for (int32_t e = 0; e < entries; e++)
            size[of[e]] = sd_larger(size[of[e]], fabs(jy[entry[e]]));
    }
    free(jy);
    return 0;
}
