/* Ledgers: see ledgers.h. */
#include "linear/lanes.h"
#include "run/meters/ledgers.h"
#include "linear/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NEGATIVE SD_SAME /* part of the largest content seen: less below zero is round-off */
#define RISE 1.01 /* of a record over the one before: a staircase of bounded length */

static const double *rows_of(const double *audit, int32_t ledger)
{
    return audit + SD_AUDIT_HEAD + (size_t)ledger * SD_LEDGER_ROWS;
}

void sd_ledgers_add(sd_ledgers *ledgers, const double *integral)
{
    for (int32_t k = 0; k < ledgers->count; k++) {
        const double *row = rows_of(integral, k);
        ledgers->dissipated[k] += row[1];
        ledgers->supplied[k] += row[2];
        ledgers->gross[k] += row[3];
    }
}

void sd_ledgers_jump(sd_ledgers *ledgers, const double *before, const double *after)
{
    for (int32_t k = 0; k < ledgers->count; k++) {
        double gained = rows_of(after, k)[0] - rows_of(before, k)[0];
        ledgers->supplied[k] += fmax(gained, 0.0);
        ledgers->dissipated[k] += fmax(-gained, 0.0);
        ledgers->gross[k] += fabs(gained);
    }
}

void sd_ledgers_clear(sd_ledgers *ledgers)
{
    free(ledgers->record);
    ledgers->record = NULL;
    ledgers->records = ledgers->room = 0;
}

static void keep(sd_ledgers *ledgers, int32_t k, double t, double value)
{
    if (ledgers->records == ledgers->room) {
        int32_t room = ledgers->room ? 2 * ledgers->room : 64;
        sd_record *grown = realloc(ledgers->record, (size_t)room * sizeof *grown);
        if (!grown)
            return;
        ledgers->record = grown;
        ledgers->room = room;
    }
    ledgers->record[ledgers->records++] = (sd_record){t, value, k};
}

/* the element of a ledger whose content changed most since the last point */
static int32_t changed(const sd_ledgers *ledgers, const double *value, int32_t k)
{
    int32_t found = -1;
    double most = 0.0;
    for (int32_t f = 0, i = 0; f < ledgers->families; f++)
        for (; i < ledgers->end[f]; i++) {
            double change = fabs(value[i] - ledgers->before[i]);
            if (ledgers->of[f] == k && !(change <= most)) {
                most = change;
                found = i;
            }
        }
    return found;
}

/* most := the largest magnitude so far of each element; whether the sign of any says something of an inertia */
static SD_WIDE int32_t note_most(int32_t elements, const double *restrict value, double *restrict most,
                                 const int8_t *restrict inertia)
{
    int32_t any = SD_NO_INERTIA;
    for (int32_t i = 0; i < elements; i++) {
        double size = fabs(value[i]);
        most[i] = size <= most[i] ? most[i] : size;
        any |= inertia[i];
    }
    return any;
}

/* a modulus may be negative from the start: what was positive must not become so */
static void note_signs(sd_ledgers *ledgers, const double *value)
{
    for (int32_t i = 0; i < ledgers->elements; i++) {
        if (ledgers->inertia[i] == SD_INERTIA && value[i] > NEGATIVE * ledgers->most[i])
            ledgers->inertia[i] = SD_POSITIVE;
        if (ledgers->inertia[i] == SD_POSITIVE && value[i] < -NEGATIVE * ledgers->most[i] && ledgers->lost < 0)
            ledgers->lost = i;
    }
}

void sd_ledgers_note(sd_ledgers *ledgers, double t, const double *y, const double *yd, const double *audit, double *room)
{
    double *value = room ? room : ledgers->value;
    if (ledgers->contents) {
        memset(value, 0, (size_t)ledgers->elements * sizeof(double));
        ledgers->contents->rows(&ledgers->contents->frame, t, y, yd, value);
        if (note_most(ledgers->elements, value, ledgers->most, ledgers->inertia))
            note_signs(ledgers, value);
    }
    for (int32_t k = 0; k < ledgers->count; k++) {
        double now = rows_of(audit, k)[0];
        if (!ledgers->begun) {
            ledgers->stored[k] = now;
            ledgers->element[k] = -1;
            continue;
        }
        double balance = now - ledgers->stored[k] + ledgers->dissipated[k] - ledgers->supplied[k];
        double change = fabs(balance - ledgers->balance[k]);
        if (!(change <= ledgers->largest[k])) {
            ledgers->largest[k] = change;
            ledgers->element[k] = changed(ledgers, value, k);
        }
        ledgers->balance[k] = balance;
        if (!(fabs(balance) <= RISE * ledgers->highest[k])) {
            ledgers->highest[k] = fabs(balance);
            keep(ledgers, k, t, fabs(balance));
        }
    }
    ledgers->begun = 1;
    if (ledgers->contents)
        memcpy(ledgers->before, value, (size_t)ledgers->elements * sizeof(double));
}
