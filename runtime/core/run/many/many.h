/* Many runs of one model that differ in numbers alone, one after the other without anything between them.
 *
 * Everything that depends on the structure (patterns, orders, places) is set up once, at a nominal run.  A run begins by
 * putting every structure back as it was set up, so that what comes of it depends on its own numbers and on nothing that
 * ran before: results are equal bit for bit whatever the order, and whoever runs them.
 * Start: the anchored unknowns as the run's text gives them, everything else from the nominal start by one settling, whose
 * steps converge as Newton's method does near a root; guesses that are others than the nominal ones must lead to it too.
 * Magnitudes: of this start, as any run finds them (sizing.h).
 * Accuracy: a draft and finer runs compared at instants of the one before, as runtime/accuracy/control.py has it.
 * A run that fails, misses its accuracy or a ledger, breaks a claim, or whose structure is another than the nominal's
 * is handed back without a result: the caller runs it on its own, and says what is the matter.
 */
#ifndef SYSDYN_MANY_H
#define SYSDYN_MANY_H

#include "run/run.h"
#include "start/sizing.h"
#include "linear/tuning.h"

enum sd_many_state {
    SD_MANY_DONE = 0,
    SD_MANY_START = 1,     /* no consistent start, or one that moves what was anchored */
    SD_MANY_STRUCTURE = 2, /* entries of the Jacobian vanish or appear, pivots vanish, inertia is negative */
    SD_MANY_FAILED = 3,    /* an integration did not come to its end */
    SD_MANY_ACCURACY = 4,  /* not reached, or not known */
    SD_MANY_ENERGY = 5,    /* a ledger does not balance */
    SD_MANY_CLAIM = 6      /* an expectation does not hold */
};

enum { SD_MANY_COUNTERS = 8 };
#define SD_MANY_NOTHING SD_CANCELS /* of the largest of the same unit: what is left of a zero (model/scales.py) */
enum { SD_MANY_ROWS = 3 }; /* `keep`: all rows of the last integration stay where it wrote them */

/* a structure as it was set up */
typedef struct sd_region {
    void *at;
    const void *copy;
    int64_t size; /* bytes */
} sd_region;

/* one integration, set up: the draft's, or that of every finer run */
typedef struct sd_pass {
    sd_run *run;
    const sd_region *region;     /* [regions] */
    int32_t regions;
    int32_t n;                   /* unknowns of the form */
    double *y, *yd, *start_rate; /* [n] */
    const int32_t *differential; /* [n] 1: its rate is a start's */
    double *magnitude, *met;     /* [n] of the stepper */
    const double *least;         /* [n] what round-off leaves open: no magnitude is less */
    sd_settle *project;          /* of the method; NULL: none */
    double *rtol, *h_max;        /* of the stepper */
    double *opening;             /* of dopri (steppers/explicit/dopri.h); NULL: none */
    double longest;              /* step [s] */
    const int64_t *counter[SD_MANY_COUNTERS]; /* of its work; NULL: none */
} sd_pass;

/* an expectation: value[left] op value[right], value[within] granted; moment 0 always, 1 finally, 2 at an instant */
typedef struct sd_claim {
    int32_t moment, op, left, right, within; /* op: 0 ==, 1 !=, 2 <, 3 <=, 4 >, 5 >=; within -1: nothing */
    double at;
} sd_claim;

/* what a run hands to the comparison: instants, values, and what they move by within the time tolerance */
typedef struct sd_samples {
    double *time, *value, *late; /* [room], [room][columns] */
    int32_t number, room;
} sd_samples;

/* what two runs are judged by, as the accuracy control has it (accuracy/*.py say of what each is, and why) */
typedef struct sd_rules {
    double safety, aim, left, slowest, stretch, unseen, short_credit, first_drop, loose, tame, beyond;
    double hidden, parted, much, bend; /* of a pair: accuracy/pairs.py */
    int32_t few, runs, instants;       /* steps of a short run; runs of a control; instants of comparison, at most twice that */
} sd_rules;

typedef struct sd_many {
    double *p;                   /* [parameters] that every block reads */
    int32_t parameters, written, columns, observed;
    /* the start */
    sd_settle *start;
    const sd_region *region;
    int32_t regions;
    const double *y0, *yd0;      /* [written] the nominal start */
    const int32_t *anchored;     /* [written] 1: as the text gives it */
    const int32_t *guessed;      /* [written] 1: sought from what the text gives, at the nominal start `guess` */
    const double *guess;         /* [written] */
    const double *size;          /* [written] magnitudes */
    double smallest;             /* pivot of the start's matrix at the nominal start */
    const double *jy0, *jyd0;    /* [entries] of the start's system at the nominal start */
    const int32_t *counts;       /* [entries] 1: jy0 counts beside the others of its row, 2: jyd0 does */
    double *jy, *jyd;
    int32_t flows, inertias;     /* the inertia M [flows, flows]: its entries among those */
    const int32_t *inertia_row, *inertia_column, *inertia_entry, *inertia_rate; /* rate 1: of jyd */
    const double *inertia_sign;
    double *inertia;             /* [flows][flows] */
    double t0, t1;
    /* magnitudes */
    sd_system *system;           /* of the passes */
    const sd_sizing *sizing;
    const sd_order *order;        /* of its columns; NULL: dense */
    double *form_jy, *form_jyd;  /* [entries] at the start */
    double *found;               /* [n] magnitudes of this run */
    double *ceiling;             /* [n] what its next integration's are no larger than */
    double tau;                  /* time scale of its start [s] */
    /* accuracy */
    sd_pass passes[2];
    const int32_t *column;       /* [columns] place among the observed */
    const double *target;        /* [columns] relative; infinite: free */
    const int32_t *unit, *unit_of; /* [columns], [written]; unit_of -1: none */
    int32_t units, known;        /* known 1: instants of comparison are set up, else steps of the run before */
    double late;                 /* time tolerance of comparisons [s] */
    double power, credit, finest, far, ratio, little, growth, fall, few_steps, many_steps; /* of the method's law (accuracy/laws.py) */
    sd_rules rules;
    double tolerance[2];         /* of the draft, of the run behind one of few steps */
    int64_t max_steps;
    double energy;               /* part of a ledger's turnover that its balance may be */
    const sd_claim *claim;
    int32_t claims;
    int32_t keep;                /* 0 end values, 1 extrema too, 2 and rows `thin` of the trace; SD_MANY_ROWS */
    const int32_t *thin;         /* [thins] ascending numbers of rows of the trace */
    int32_t thins;
    /* at work */
    sd_samples sample[3];        /* own of the last run; own of this one; this one's at instants of the last */
    int32_t stride, seen, rows, thinned, broken, judged;
    double last_time;
    double *end, *least, *most, *thick; /* [columns] x 3, [columns][thins]: where the run's results go */
    double *work;                /* [4 columns + 2 units] */
    int32_t *kind;               /* [room] */
    /* of the last run */
    int32_t held;                /* rows of its last integration, at `row` of that */
    double spent;                /* CPU of its integrations [s] */
    int64_t counted[SD_MANY_COUNTERS]; /* by all of them */
} sd_many;

/* one run after the other: p [runs][parameters], anchor [runs][written] values of anchored unknowns; state [runs] as
 * above; steps [runs]; estimate [runs]; cpu [runs] seconds; end, least, most [runs][columns]; thick [runs][columns][thins] */
void sd_many_runs(sd_many *many, int32_t runs, const double *p, const double *anchor, int32_t *state, int64_t *steps,
                  double *estimate, double *cpu, double *end, double *least, double *most, double *thick);

#endif
