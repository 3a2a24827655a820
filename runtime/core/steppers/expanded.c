/* Points of a condensed system with every unknown: see expanded.h. */
#include "steppers/expanded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void sd_expanded_show(const sd_expanded *expanded, double *y, double *yd)
{
    sd_condensed_expand(expanded->condensed, expanded->inner->y, y, 0);
    sd_condensed_expand(expanded->condensed, expanded->inner->yd, yd, 1);
}

/* what is looked at after each step: magnitudes, the points of the quadrature */
static void follow(sd_expanded *expanded)
{
    sd_stepper *inner = expanded->inner;
    if (expanded->met) {
        sd_condensed_expand(expanded->condensed, inner->y, expanded->y, 0);
        for (int32_t i = 0; i < expanded->face.n; i++)
            sd_met(fabs(expanded->y[i]), &expanded->met[i], &expanded->magnitude[i]);
    }
    expanded->face.nodes = inner->nodes;
    expanded->face.node = inner->node;
    expanded->face.node_weight = inner->node_weight;
}

/* the points of the quadrature, one by one: together they would be as long as all the rest */
static void show(const void *self, int32_t k, double *y, double *yd)
{
    const sd_expanded *expanded = self;
    expanded->inner->show(expanded->inner->self, k, expanded->z, expanded->zd);
    sd_condensed_show(expanded->condensed, expanded->z, expanded->zd, y, yd);
}

static int step(void *self)
{
    sd_expanded *expanded = self;
    int cause = expanded->inner->step(expanded->inner->self);
    if (cause == SD_FINE)
        follow(expanded);
    return cause;
}

static void dense(const void *self, double t, double *y, double *yd)
{
    const sd_expanded *expanded = self;
    expanded->inner->dense(expanded->inner->self, t, expanded->z, expanded->zd);
    sd_condensed_show(expanded->condensed, expanded->z, expanded->zd, y, yd);
}

static void values(const void *self, double t, double *y)
{
    const sd_expanded *expanded = self;
    const sd_stepper *inner = expanded->inner;
    if (t != *inner->t)
        inner->values(inner->self, t, expanded->z);
    sd_condensed_expand(expanded->condensed, t != *inner->t ? expanded->z : inner->y, y, 0);
}

static void refine(void *self, sd_settle *settle)
{
    sd_expanded *expanded = self;
    settle->seen = expanded->condensed;
    expanded->inner->refine(expanded->inner->self, settle);
    settle->seen = NULL;
}

static void start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_expanded_start(self, t, y, yd, h);
}

void sd_expanded_start(sd_expanded *expanded, double t, const double *y, const double *yd, double h)
{
    size_t size = (size_t)expanded->face.n * sizeof *y;
    sd_condensed_gather(expanded->condensed, y, expanded->z);
    sd_condensed_gather(expanded->condensed, yd, expanded->zd);
    expanded->inner->start(expanded->inner->self, t, expanded->z, expanded->zd, h);
    if (expanded->y)
        memmove(expanded->y, y, size);
    expanded->face.y = y;
    expanded->face.nodes = expanded->inner->nodes;
    expanded->face.node = expanded->inner->node;
    expanded->face.node_weight = expanded->inner->node_weight;
}

sd_expanded *sd_expanded_new(sd_stepper *inner, const sd_condensed *condensed, int32_t unknowns)
{
    sd_expanded *expanded = calloc(1, sizeof *expanded);
    size_t m = (size_t)condensed->unknowns + 8, n = condensed->full->scales > 0 ? (size_t)unknowns + 8 : 0;
    if (!expanded)
        return NULL;
    expanded->memory = calloc(2 * m + n, sizeof(double));
    if (!expanded->memory) {
        sd_expanded_free(expanded);
        return NULL;
    }
    expanded->inner = inner;
    expanded->condensed = condensed;
    expanded->z = expanded->memory;
    expanded->zd = expanded->z + m;
    expanded->y = n ? expanded->zd + m : NULL;
    expanded->face = *inner;
    expanded->face.self = expanded;
    expanded->face.n = unknowns;
    expanded->face.y = expanded->face.yd = NULL;
    expanded->face.step = step;
    expanded->face.dense = dense;
    expanded->face.refine = inner->refine ? refine : NULL;
    expanded->face.start = start;
    expanded->face.show = inner->show ? show : NULL;
    expanded->face.values = inner->values ? values : NULL;
    return expanded;
}

void sd_expanded_free(sd_expanded *expanded)
{
    if (!expanded)
        return;
    free(expanded->memory);
    free(expanded);
}

sd_stepper *sd_expanded_stepper(sd_expanded *expanded)
{
    return &expanded->face;
}
