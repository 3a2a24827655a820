/* Ledgers of one integration: for each part of a model what it stored, dissipated and was supplied with.
 *
 * Behind its four global rows block audit has LEDGER_ROWS rows a ledger: stored, power dissipated, power supplied, and
 * the sum over elements of the magnitudes of both powers.  Block ledger gives what each element stores.
 * Balance: stored - stored at the start + int dissipated dt - int supplied dt; it is taken at every accepted step.
 */
#ifndef SYSDYN_LEDGERS_H
#define SYSDYN_LEDGERS_H

#include "system/assembly.h"

enum { SD_AUDIT_HEAD = 4 };
enum { SD_LEDGER_ROWS = 4 };

/* one step of a staircase: no balance was larger until t */
typedef struct sd_record {
    double t, value;
    int32_t ledger;
} sd_record;

enum sd_inertia {
    SD_NO_INERTIA = 0, /* its sign says nothing */
    SD_INERTIA = 1,    /* its sign is that of an inertia */
    SD_POSITIVE = 2,   /* and was positive */
};

typedef struct sd_ledgers {
    int32_t count, elements, families;
    const sd_call *contents;       /* block ledger; NULL: no element stores */
    const int32_t *of, *end;       /* [families] of elements: the ledger of each; where it ends among these */
    int8_t *inertia;               /* [elements] sd_inertia: what its sign says of an inertia */
    /* results */
    double *gross;                 /* [count] int of the magnitudes of both powers, and what impulses brought */
    double *most;                  /* [elements] largest magnitude stored */
    double *largest;               /* [count] largest change of a balance in one step */
    int32_t *element;              /* [count] whose content changed most in that step; -1: none stores */
    sd_record *record;             /* [records] when each balance became larger than ever before, by RISE at least */
    int32_t records, room;
    /* the last accepted point */
    double *stored, *balance, *highest;   /* [count] */
    double *dissipated, *supplied;        /* [count] integrals */
    double *value, *before;               /* [elements] what each stores; value: work, where there is no other room */
    int32_t begun;
    int32_t lost;                  /* an element whose inertia became negative; -1: none */
} sd_ledgers;

/* adds integrals of the rows of block audit over a step */
void sd_ledgers_add(sd_ledgers *ledgers, const double *integral);
/* an accepted point: rows of block audit there; room [elements]: of the caller, or NULL */
void sd_ledgers_note(sd_ledgers *ledgers, double t, const double *y, const double *yd, const double *audit, double *room);
/* frees the records */
void sd_ledgers_clear(sd_ledgers *ledgers);
/* what contents gained at a jump was supplied, what they lost dissipated: rows of block audit before and after */
void sd_ledgers_jump(sd_ledgers *ledgers, const double *before, const double *after);

#endif
