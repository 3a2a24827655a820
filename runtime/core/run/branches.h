/* Branches of holonomic constraints, which a step must not change: near a dead centre two of them lie close together.
 *
 * Rows phi of the settled system have normals N = dphi/dq in magnitudes of the unknowns.  Along one branch they turn
 * continuously: of two points that a step resolves det(N N'^T) > 0, as det(N N^T) is.  Where it is not, the chord between them
 * is halved, and its middle moved onto the constraints, as long as the sign tells in which half they turn.  Two branches keep
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
    const int32_t *row;          /* [rows] of the settled system */
    int32_t rows;
    double *before, *now;        /* [rows][unknowns] normals at the start of the step or earlier, and at its end */
    double *middle;              /* [rows][unknowns] normals on the chord */
    double *product, *rest;      /* [rows][rows], [rows of the settled system] work */
    double *jy, *jyd;            /* [entries] slopes */
    double *z, *zd, *at;         /* [unknowns] of the settled system: a point; where `before` was taken */
    double *near, *far;          /* [unknowns] ends of a part of the chord */
    double *y, *yd, t;           /* [n] the point that the step begins at */
    double *end, *end_d;         /* [n] the one that it ends at */
    double most, size;           /* largest volume of normals, its root a row, so far; the last one */
    int32_t begun;
    double *memory;
} sd_branches;

/* row [rows]: of the caller; extended: unknowns and what is audited.  NULL without memory */
sd_branches *sd_branches_new(sd_settle *settle, const sd_stepper *stepper, int32_t extended, const int32_t *row, int32_t rows);
void sd_branches_free(sd_branches *branches);
/* a step begins at the last point of the method */
void sd_branches_leave(sd_branches *branches, const sd_stepper *stepper);
/* 1: the step that was accepted stays on its branch; 0: the method stands where it began again, with a shorter step */
int sd_branches_follow(sd_branches *branches, sd_stepper *stepper);

#endif
