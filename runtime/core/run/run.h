/* One integration in chunks: steps, quadratures of the energy balance, values at the instants asked for.
 *
 * An output row is [t, kind, kinetic, potential, dissipated, supplied, energy, constraints,
 *                   observe [observed], observe_rate [observed]]   (SI units; kind, a sum: 1 row of the
 * trace, 2 accepted step, 4 instant at which runs are compared, 8 see SD_RELAXING).
 * At the instants the dense output is moved onto the constraints and their hidden derivatives (settle.h), so multipliers
 * and accelerations are as exact as positions.
 * Energy balance: [T + V](t) - [T + V](t0) + int dissipated dt - int supplied dt.  The integrals of each accepted step:
 * where laws are steep by the method's stages, at which they hold, else on the dense output: by what is known from steps before
 * and the middle of this one (exact to degree 5), and by Lobatto's rule of five points (to 7) where that leaves something open.
 * Where an integration restarts after a jump, what T + V gained there was supplied by the impulses that forced it, and what
 * it lost was dissipated by them (an impact without restitution).
 */
#ifndef SYSDYN_RUN_H
#define SYSDYN_RUN_H

#include "system/least_norm.h"
#include "run/meters/extrema.h"
#include "run/meters/ledgers.h"
#include "run/events/modes.h"
#include "system/settle.h"
#include "steppers/stepper.h"

enum { SD_ROW_HEAD = 8 };
enum { SD_TRACE = 1 }; /* kinds of a row (integrate/request.py): of the trace, */
enum { SD_SAMPLE = 2 }; /* of a step, which is watched alone, */
enum { SD_COMPARED = 4 }; /* that runs are compared by */
enum { SD_RELAXING = 8 }; /* of these: where something relaxes at once within the first step behind a restart */
enum { SD_PARTS = 4 }; /* of a step, at whose ends what is watched is looked at */
enum { SD_PAST = 3 }; /* steps before the last one whose powers are known */
#define SD_FINEST 1024 /* parts of a step that what is watched does not follow in fewer */

enum sd_state { SD_RUNNING = 0, SD_FINISHED = 1, SD_FULL = 2, SD_FAILED = 3, SD_EVENT = 4 };

typedef struct sd_run {
    sd_stepper *stepper;
    sd_settle *settle;
    sd_least_norm *least_norm;        /* NULL: multipliers are as they come */
    sd_ledgers *ledgers;              /* NULL: none is kept */
    int32_t written;                  /* unknowns as written: y of blocks observe, audit */
    int32_t observed;
    int32_t audited;                  /* rows of block audit */
    const sd_call *audit;             /* NULL: no audit block */
    const sd_call *powers;            /* the same without loops of energies alone, which no integral takes */
    int32_t rated;                    /* blocks audit, ledger read rates */
    const sd_call *observe, *observe_rate, *observe_scale;   /* NULL where missing */
    const int32_t *audit_at;          /* [7] places of energy, kinetic, potential, dissipated, supplied, constraints,
                                         * drift */
    const double *instant;            /* [instants] ascending, within the span */
    const int32_t *instant_kind;      /* [instants] kind of the row */
    int32_t instants, every_step;
    int32_t glances, glanced;         /* instants of a step that are watched, at even parts of it, its end among them; those
                                       * within it that are written */
    int32_t sizes_at_steps;           /* largest is over the ends of all steps, not of those with a row alone */
    int32_t bare;                     /* what is observed follows from the state: rows for comparison alone are not settled */
    int32_t told;                     /* it does by the settler's `told` rows: one that meets these is not settled; falls to
                                       * 0 where few do */
    int32_t unsummed;                 /* nothing observed reads the audit: rows for comparison alone are without it (1), a draft
                                       * without integrals of powers (2); they are no numbers */
    double rough;                     /* scaled residual that will do for rows by which runs are compared and nothing else */
    double swift;                     /* of its largest: what by the equations moves by more beside the dense output, as fast
                                       * as there for a step, relaxes at once */
    double apart;                     /* part of a step: instants within it that are nearer to the row before are passed
                                       * over; 0: none is */
    const double *start_rate;         /* [unknowns] yd at the (re)start, also of what the stepper does not differentiate */
    double *row;                      /* [room][SD_ROW_HEAD + 2 observed] */
    int32_t room;
    /* progress */
    int32_t rows, next, pending, started, fresh;   /* fresh: at a point started from, no step yet */
    int32_t sampled;                               /* point and sample are of the end of the last step */
    double stored, dissipated, supplied;           /* T + V at the start; integrals up to the last accepted step */
    double step_dissipated, step_supplied;         /* integrals up to the start of the last step */
    double t_from, t_row, t_begun;                 /* t_row: instant of the last row that is compared; t_begun: of the last
                                                    * restart */
    double *power, *after, *sample, *integral, *end;   /* [audited] at the start and the end of the last step; of one
                                                        * sample; integrals over the step; of a row */
    double *middle, *work;                             /* [audited] in the middle of the last step; work */
    double *past[SD_PAST], t_past[SD_PAST];            /* [audited] at the starts of the steps before it, the last one first, */
    int32_t pasts;                                     /* so many of them: since the last start */
    double *point, *point_d, *values, *largest, *slope, *memory; /* point: of a sample or a row; largest [observed]: of observe_scale;
                                       * slope [observed]: rates of the dense output as it is */
    int64_t rows_written;
    double first_energy;
    /* events */
    const sd_watch *watch;            /* [watches] */
    int32_t watches, end_kind;        /* end_kind: kind of the row where a step meets t_end, beside those asked for */
    int32_t start_kind;               /* the same of the row of a restart */
    double t_to;                      /* end of what counts of the last step */
    const double *magnitude;          /* [n] of the unknowns at steps; NULL: not looked at */
    double beyond;                    /* largest |unknown| of a row within a step, in these magnitudes */
    const double *nothing;            /* [observed] what is round-off beside others of its unit */
    const double *projected;          /* drift of the last step before the method itself projected it; NULL: it does not */
    sd_modes *modes;                  /* NULL: every event goes to its handler */
    struct sd_corners *corners;       /* NULL: every jump of a text without events goes to Python */
    sd_extrema *extrema;              /* NULL: nobody asks for them */
    double t_clear, t_seen;           /* within the last step, between which something watched has been seen to change */
    double turns;                     /* s: in which something that is read turns; 0: nothing does */
    double *looked;                   /* [SD_PARTS + 2][observed] values at the ends of parts, and within one */
    int32_t noded;                    /* powers at so many nodes of the last step are known; -1: at none; 0: nobody asked yet */
    double node[SD_NODES];            /* parts of the last step behind its start, negative ones of steps before it */
    double node_power[SD_NODES][2];   /* dissipated, supplied */
    double difference[SD_NODES + 1][2]; /* of the powers from the start on, divided, if `divided` (Newton) */
    int32_t told_here;                /* a row within the last step met its sums, and so do all there */
    int32_t divided;                  /* differences are of the last step */
    int32_t by_past;                  /* the integrals over the last step, all of it, are those by the powers of steps before */
} sd_run;

sd_run *sd_run_new(sd_stepper *stepper, sd_settle *settle, int32_t written, int32_t extended, int32_t observed,
                   int32_t audited);
void sd_run_free(sd_run *run);
/* steps until `steps` more are taken, `seconds` are over, the rows are full, the end, a failure, or a step within which
 * something watched changes (SD_EVENT: the step is not counted yet, see sd_run_accept) */
int sd_run_advance(sd_run *run, int64_t steps, double seconds);
/* notes the powers at y, yd [written], the point at the end of the last step, which a restart leaves */
void sd_run_leave(sd_run *run, const double *y, const double *yd);
/* then goes on from y, yd [n] at t with the row of the instant `label` */
void sd_run_restart(sd_run *run, double t, double label, const double *y, const double *yd);
/* the last step counts up to `to`, where a row of kind `kind` is written beside those asked for; after SD_EVENT.  1: the
 * rows are full, `sd_run_drain` goes on */
int sd_run_accept(sd_run *run, double to, int32_t kind);

/* rows.c: rows of the last step that are still to be written; 1: no room left */
int sd_run_drain(sd_run *run);
/* those of the point started from, which stands in run->point then: as of `label` where the instant is not earlier */
void sd_run_rows_of_start(sd_run *run, double label);
/* a row of kind `kind` at the end of the last step, which counts and whose rows are drained */
void sd_run_row(sd_run *run, int32_t kind);
/* a row of what is watched at t within the last step, where there is room for one */
void sd_run_sample(sd_run *run, double t);
/* whether a row of the trace is asked for at t or before, and not at every step */
int sd_run_asks(const sd_run *run, double t);
/* run->point, point_d at t within the last step moved onto the equations: by what the method has at hand, where that does; the
 * end of a step may be there */
void sd_run_settle(sd_run *run, double t);
/* values [observed] := what is observed at run->point, point_d */
void sd_run_quantities(sd_run *run, double t, double *values);
/* the same at t within the last step, on the dense output as it is; settled */
void sd_run_look(sd_run *run, double t, double *values);
void sd_run_observe(sd_run *run, double t, double *values);

#endif
