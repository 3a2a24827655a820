/* Rodas5P: a Rosenbrock-Wanner method of order 5 with eight stages, stiffly accurate, for F(t, y, yd) = 0 of index 1.
 *
 * Sources: G. Steinebach, Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
 * Differential Equations package, BIT Numerical Mathematics 63 (2023) 27; E. Hairer, G. Wanner, Solving Ordinary Differential
 * Equations II, Springer 1996, sections IV.7 and VI.3 (implicit equations (3.18): y' = z, 0 = F(t, y, z)).
 * A step solves eight linear systems with one matrix and no iteration.  With J = dF/dy, E = dF/dyd and T = dF/dt at the last
 * accepted point, u_i and v_i what stage i adds to y and to z = y':
 *   (J + E / (gamma h)) u_i = -F(t + c_i h, Y_i, Z_i) + E W_i - d_i h T,     W_i = Z_i + s_i,     v_i = u_i / (gamma h) - W_i
 *   Y_i = y + sum_(j<i) a_ij u_j,   Z_i = z + sum_(j<i) a_ij v_j,   s_i = sum_(j<i) C_ij u_j / h
 * E may depend on y; what occurs undifferentiated follows from its own rows, whose remainders the next step takes in.
 * The last stage is the solution, y = Y_8 + u_8, and u_8 the difference to the embedded one of order 4: the error test.
 * It sees what follows from the state too, which no iteration brings onto its rows; where a law jumps, that jumps in a step
 * however short, which is told by its error (stays), and the error of the state decides.
 * Slopes that hold at the begin what they do not at the end (a tanh that saturates) hide its error: then those of the end tell.
 * Values within a step: the method's own polynomial, of order 4.
 */
#ifndef SYSDYN_ROSENBROCK_H
#define SYSDYN_ROSENBROCK_H

#include "system/assembly.h"
#include "linear/linear.h"
#include "steppers/stepper.h"

enum { SD_ROSENBROCK_STAGES = 8 };
enum { SD_ROSENBROCK_DENSE = 3 };
#define SD_ROSENBROCK_LEAST 1e-10 /* error of a step, for the next one's size */

extern const double sd_rosenbrock_gamma;
extern const double sd_rosenbrock_a[SD_ROSENBROCK_STAGES][SD_ROSENBROCK_STAGES];
/* of z in Z_i and W_i; of u_j / h in Z_i; of u_j / h in W_i */
extern const double sd_rosenbrock_begin[SD_ROSENBROCK_STAGES];
extern const double sd_rosenbrock_rate[SD_ROSENBROCK_STAGES][SD_ROSENBROCK_STAGES];
extern const double sd_rosenbrock_known[SD_ROSENBROCK_STAGES][SD_ROSENBROCK_STAGES];
extern const double sd_rosenbrock_c[SD_ROSENBROCK_STAGES], sd_rosenbrock_d[SD_ROSENBROCK_STAGES];
extern const double sd_rosenbrock_dense_weight[SD_ROSENBROCK_DENSE][SD_ROSENBROCK_STAGES];

typedef struct sd_rosenbrock {
    sd_ivp ivp;               /* what `test` leaves out is tested too where power is 0 */
    sd_linear *linear;
    double opening;           /* over rtol^(1/5): the first step as an earlier run found it fit, 0: chosen; then as this one does */
    /* state of the integration */
    double h_accepted, power_accepted, h_refused, error_refused; /* power: of the last error, that tells of the next step */
    int32_t rejected, jumped; /* jumped: whether the last one was taken for its state alone */
    double *phi, *yd;         /* [n] the last accepted point */
    double *last;             /* [n] the one before it */
    double *y, *rate, *known, *drift; /* [n] Y_i, Z_i and, behind the last stage, the rates of the step's end; W_i; T */
    double *begin;            /* [n] F at the last accepted point */
    double *end, *within, *within_d, *inner; /* [n] the end of the step at hand; a point within, its correction */
    double *u[SD_ROSENBROCK_STAGES], *bend[SD_ROSENBROCK_DENSE]; /* [n]; bend: of the polynomial */
    double *jy, *jyd, *g, *e, *memory;
    double *jy_end, *jyd_end, *begin_end; /* slopes, and F [n], at the end of the step at hand */
    int32_t sloped;           /* whether these are those of the last accepted point, behind a step jy, jyd and begin are */
    int32_t lasting;          /* slopes are what they were since the start, whatever the point */
    int32_t *rate_row, *rate_column, rates; /* of the entries e of E that are not zero */
    sd_settle *settle;        /* of steep laws: moves a point that no step goes on from onto all rows; or NULL */
} sd_rosenbrock;

sd_rosenbrock *sd_rosenbrock_new(sd_system *system, sd_linear *linear);
void sd_rosenbrock_free(sd_rosenbrock *rosenbrock);
void sd_rosenbrock_start(void *rosenbrock, double t, const double *y, const double *yd, double h);
int sd_rosenbrock_step(void *rosenbrock);
/* rosenbrock_stages.c: F at (t, y, yd) into r [n]: SD_NONFINITE with its row where it is none */
int sd_rosenbrock_residual(sd_rosenbrock *rosenbrock, double t, const double *y, const double *yd, double *r);
/* J, E, F and T at the last accepted point, for steps of about the size at hand; the factors of J + E / (gamma h); all stages
 * of a step, whose end is then `end` with the rates `rate` */
int sd_rosenbrock_linearise(sd_rosenbrock *rosenbrock);
int sd_rosenbrock_factorise(sd_rosenbrock *rosenbrock);
int sd_rosenbrock_stages(sd_rosenbrock *rosenbrock);
/* the polynomial of the last step */
void sd_rosenbrock_bend(sd_rosenbrock *rosenbrock);
/* y(x) = y0 + x (change + (1 - x) (b0 + x (b1 + x b2))) and its slope, x: part of a step of size h from y0 to y1.  yd NULL: y
 * alone. */
void sd_rosenbrock_polynomial(const sd_rosenbrock *rosenbrock, const double *y0, const double *y1, double h, double x,
                              double *y, double *yd);
/* rosenbrock_error.c: root mean square over the tested unknowns in the error weights; h: of those that count with it.  Grows
 * `state` to that of what carries the state. */
double sd_rosenbrock_norm(const sd_rosenbrock *rosenbrock, const double *x, double h, double *state);
/* factors and stages of a step, its error in `error`, of the state alone in `state`; SD_ERROR_TEST where it is too large */
int sd_rosenbrock_attempt(sd_rosenbrock *rosenbrock, double *error, double *state);

#endif
