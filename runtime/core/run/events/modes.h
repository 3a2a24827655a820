/* Events that have happened before, without their handler.
 *
 * Between events a run is in a mode: which constraints hold, in which sense dry friction slips, which branch each law
 * has, on which side of zero each relation is.  The handler (runtime/events) finds where an event leads; what it did is
 * kept as a transition: a mode, what crossed or which samples were due, what was assigned, the mode behind it.  Where
 * the same happens again the transition is taken, and each condition of the mode behind it is looked at as the handler
 * would; where one does not hold nothing has been done, and the handler is asked (Lygeros et al. 2003: modes, guards and
 * resets of hybrid automata).  A law that goes from one branch to the other needs no handler the first time either:
 * nothing is assigned, and which constraints hold stays.
 */
#ifndef SYSDYN_MODES_H
#define SYSDYN_MODES_H

#include "system/assembly.h"

struct sd_run;
struct sd_linear;

#define SD_OWN INT32_MAX /* the mode that the core has found by itself */
/* branches of a law, as events/kinks.py has them: the text's own, above zero, on it by both, on it by its own value; -1 below */
enum { SD_BRANCH_LIVE, SD_BRANCH_ABOVE, SD_BRANCH_SLIDES, SD_BRANCH_RESTS };
enum { SD_JUMP = -1 }; /* in place of samples that are due: the text jumps */

enum sd_contact_kind { SD_PSI, SD_FRICTION, SD_PHI, SD_GUARDED, SD_FOLLOWS };

/* What ends a smooth piece: side * observed[row] falls below -tolerance. */
typedef struct sd_watch {
    int32_t row, side;
    double tolerance;
} sd_watch;

/* The rows of one system that read "multiplier = 0" in a mode: as in assembly.h. */
typedef struct sd_held {
    int32_t held, clear;
    const int32_t *row, *unknown, *slot, *rate, *cleared;
} sd_held;

typedef struct sd_mode {
    int32_t watches, first;           /* first: transition from here, -1: none */
    int32_t *row, *side, *rate;       /* [watches] of block observe; side 1 or -1; row of the rate or -1 */
    double *value;                    /* [places] of the parameters that a mode fixes */
    const double *relation;           /* [relations] sides */
    const int32_t *holds;             /* [contacts] */
    const sd_held *held;              /* [systems] */
} sd_mode;

/* The impulse that opens a gap again: equations of the flows and momenta behind it and of impulses, in whose matrix, by
 * columns, entry k is that of place slot[k] of dF/dy of the settled system, or where rated of dF/dyd. */
typedef struct sd_strike {
    sd_system *system;
    struct sd_linear *linear;
    int32_t contact, row, own;        /* the gap, its row of flows in the system, the column of its impulse; -1: none */
    int32_t n, moves;                 /* columns; the first ones are unknowns that move, the others impulses */
    int32_t besides;
    const int32_t *beside;            /* [besides] other gaps that an impulse of this one reaches */
    const int32_t *unknown, *of_row, *integral; /* [n] unknown of a column, row of a row; 1: integrated over the instant */
    const int32_t *column, *row_of, *slot, *rated; /* [n + 1], [entries] */
    sd_held held;                     /* of the system: this gap alone holds; or as it was */
    double restitution;
    double *jy, *jyd, *r;             /* [entries], [rows] of the system */
    double *value, *scale, *x, *impulse; /* [entries], [n] */
} sd_strike;

typedef struct sd_transition {
    int32_t number, to, next;         /* among all; next: transition from the same mode, -1: none */
    int32_t crossed, due, rounds, moves; /* due SD_JUMP: where the text jumps; moves 0: nothing but sides change, the step goes on */
    const int32_t *which, *sample;    /* [crossed] watches, [due] samples, both ascending */
    const int32_t *end;               /* [rounds] of its assignments */
    const int32_t *kind, *place, *read; /* [end of the last] 0: a parameter, 1: an unknown; place; row that it becomes */
    const double *sides;              /* [1 + rounds][relations] once what crossed has changed, and behind each round */
    int64_t entries;                  /* events that it counts as */
    double soon;                      /* s: sooner behind another event the handler looks whether it is seen to end */
    const sd_strike *strike, *momenta; /* an impact; momenta that follow from flows which are assigned; NULL: none */
} sd_transition;

/* rows as in events/plan.py; sense: place in p */
typedef struct sd_contact {
    int32_t kind, value, rate, multiplier, bound, guard, sense, acceleration;
} sd_contact;

typedef struct sd_kink {
    int32_t branch, value, rate, above, below;
    int32_t inner, jumps;             /* coordinates move it, and nothing is supplied at its zero; it may rest there */
    double passage;                   /* of a peak: how far the function goes while it is passed; else 0 */
} sd_kink;

/* A smooth piece of the text (s); label: of the row in which it begins. */
typedef struct sd_piece {
    double begin, end, label;
} sd_piece;

typedef struct sd_modes {
    const sd_mode *mode;
    const sd_transition *transition;
    sd_mode own;                      /* arrays [watches], [places] of its own; the rest is that of `base` */
    int32_t base;                     /* the mode of which it differs by branches of laws alone */
    int32_t now;                      /* the mode, -1: unknown here, SD_OWN: own */
    int32_t parameters, places, relations, contacts, kinks, systems, samples, observed, alikes, unknowns;
    double *p;                        /* [parameters] */
    const int32_t *place;             /* [places] in p */
    int32_t *anywhere;                /* [contacts] the transition in which this gap alone opens again, whatever else the mode
                                       * is, in no mode's list; -1: none */
    sd_transition here;               /* such a one, as it is from the mode at hand */
    const int32_t *relation_row, *relation_moves; /* [relations] */
    const sd_contact *contact;
    const sd_kink *kink;
    sd_system *const *system;         /* [systems] whose rows follow */
    const double *period;             /* [samples] s */
    int64_t *next;                    /* [samples] number of the next one */
    const sd_piece *piece;            /* [pieces] of the text */
    double first, segment;            /* s: of the samples, end of the piece of the text */
    double last, nothing;             /* s: the event before, what is no time behind it */
    double begin;                     /* s: from here on the last step has not been looked at */
    double longest, begun;            /* s: step; of the event that the run goes on from */
    double passed, part;              /* s: until when peaks are being passed, in steps of so much at most */
    double early, at_once;            /* part of the first step behind it, of which the dense output knows only what inertia
                                       * leads (integrate/jumps/modes.py); s: so soon behind it another one is at once */
    double *t_end, *h_max;            /* of the method */
    double *largest;                  /* [observed] of values and terms, at points asked for */
    const int32_t *known;             /* [observed] to rounding: 2: time alone moves it; 1: an assignment put it next to zero */
    double small, still;              /* of `largest`: zero; of a magnitude: what a state moves by and has not jumped */
    const int32_t *alike, *alike_end; /* rows of one size, group by group; [alikes] */
    const int32_t *state;             /* [written] 1: keeps its value across an event */
    const int32_t *differential, *unnamed; /* [unknowns] 1: has a rate; its size may show when it begins to move */
    const double *met, *magnitude, *resolved; /* [unknowns] */
    double unknown_size, round_off;
    double *rate;                     /* [unknowns] start_rate of the run */
    double *y, *yd, *before, *before_d, *restart, *restart_d; /* [unknowns], room for what is written and audited */
    double *values, *low, *high;      /* [observed] */
    double *p_before, *p_after;       /* [parameters] */
    int32_t *exact;                   /* [relations] 1: it crosses now, and is zero to the last bit */
    double *was;                      /* [relations] value before an assignment */
    double *found;                    /* [watches] */
    int32_t *which;                   /* [watches] */
    int32_t *turning;                 /* [kinks] that turn now */
    int32_t *thrown;                  /* [observed] 1: of a gap that an impact has opened, until it closes (events/bounces.py) */
    double *level, *height;           /* [observed] of these: value at which the flight begins, what it rises to */
    double *begins, *flight;          /* [observed] s: when it begins, how long it takes */
    double *fastest;                  /* [contacts] speed at which each gap closed at most */
    double rest, faint;               /* of it: a slower impact is the last; of `largest`: lower flights are the handler's */
    sd_watch *watch;                  /* [watches] */
    double *log;                      /* [room][width] t, transition, before and after of what was assigned; t, -1 - kink
                                       * and its branches */
    int64_t left, stalled, chatters;  /* events that may still be; so many in a row within no time, of which the handler asks
                                       * whether they end */
    double differs;                   /* of its size: what a value differs by that has jumped */
    int32_t pieces, at;               /* number of the present piece */
    int32_t struck;                   /* the contact that is thrown by the event at hand, -1: none */
    int32_t width, room, logged, waits; /* waits: an event has no room for its rows yet */
} sd_modes;

/* What changes within the last step: SD_RUNNING: done; SD_EVENT: the handler is asked; SD_FULL: no room for rows. */
int sd_modes_event(struct sd_run *run);
/* Samples due where a step has met its end, or the text that jumps there: the same, SD_FINISHED where there is nothing or
 * the handler is asked. */
int sd_modes_end(struct sd_run *run);
/* Peaks that have begun at t, behind a step of so many s, and take `passes` (s), are passed in parts, beside those that already
 * are. */
void sd_modes_pass(sd_modes *m, double t, double step, double passes);

#endif
