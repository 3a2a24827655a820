/* Branches of a holonomic constraint, which a step must not change: near a dead centre two of them lie close together.
 *
 * The row phi of the settled system has a normal N = dphi/dq in magnitudes of the unknowns.  Along one branch it turns
 * continuously: of two points that a step resolves N N'^T > 0, as N N^T is.  Where it is not, the chord between them
 * is halved, and its middle moved onto the constraint, as long as the sign tells in which half it turns.  Two branches keep
 * their distance meanwhile: the step is taken again with a quarter of its length.  A motion through the singular place itself
 * (rod and crank of one length) is one curve, and goes on as it came.  Normals are taken where unknowns have moved, and at
 * every step where they are short.
 */
#ifndef SYSDYN_BRANCHES_H
#define SYSDYN_BRANCHES_H

#include "steppers/stepper.h"
#include "system/settle.h"

typedef struct sd_branches {
    sd_settle *settle;
    int32_t row;                 /* of the constraint in the settled system */
    double *before, *now;        /* [unknowns] normals at the start of the step or earlier, and at its end */
    double *middle;              /* [unknowns] normal on the chord */
    double *rest;                /* [rows of the settled system] work */
    double *jy, *jyd;            /* [entries] slopes */
    double *z, *zd, *at;         /* [unknowns] of the settled system: a point; where `before` was taken */
    double *near, *far;          /* [unknowns] ends of a part of the chord */
    double *y, *yd, t;           /* [n] the point that the step begins at */
    double *end, *end_d;         /* [n] the one that it ends at */
    double most, size;           /* longest normal so far; the last one */
    int32_t begun;
    double *memory;
} sd_branches;

/* row: of the constraint; extended: unknowns and what is audited.  NULL without memory */
sd_branches *sd_branches_new(sd_settle *settle, const sd_stepper *stepper, int32_t extended, int32_t row);
void sd_branches_free(sd_branches *branches);
/* a step begins at the last point of the method */
void sd_branches_leave(sd_branches *branches, const sd_stepper *stepper);
/* 1: the step that was accepted stays on its branch; 0: the method stands where it began again, with a shorter step */
int sd_branches_follow(sd_branches *branches, sd_stepper *stepper);

#endif
