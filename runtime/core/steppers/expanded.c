/* Points of a condensed system with every unknown: see expanded.h. */
#include "steppers/expanded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* room for a point of what is stepped */
static double *room_of(const sd_expanded *expanded)
{
    size_t numbers;
    return expanded->z ? expanded->z : expanded->inner->spare(expanded->inner->self, &numbers);
}

/* the points of the quadrature, one by one: together they would be as long as all the rest */
static void show(const void *self, int32_t k, double *y, double *yd)
{
    const sd_expanded *expanded = self;
    double *z = room_of(expanded), *zd = z + expanded->room;
    expanded->inner->show(expanded->inner->self, k, z, zd);
    sd_condensed_show(expanded->condensed, z, zd, y, yd);
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
    double *z = room_of(expanded), *zd = z + expanded->room;
    expanded->inner->dense(expanded->inner->self, t, z, zd);
    sd_condensed_show(expanded->condensed, z, zd, y, yd);
}

static void values(const void *self, double t, double *y)
{
    const sd_expanded *expanded = self;
    const sd_stepper *inner = expanded->inner;
    double *z = room_of(expanded);
    if (t != inner->ivp->t)
        inner->values(inner->self, t, z);
    sd_condensed_audited(expanded->condensed, t != inner->ivp->t ? z : inner->y, y);
}

static void refine(void *self, sd_settle *settle)
{
    sd_expanded *expanded = self;
    settle->seen = expanded->condensed;
    expanded->inner->refine(expanded->inner->self, settle);
    settle->seen = NULL;
}

static double *spare(void *self, size_t *numbers)
{
    const sd_expanded *expanded = self;
    return expanded->inner->spare(expanded->inner->self, numbers);
}

static void start(void *self, double t, const double *y, const double *yd, double h)
{
    sd_expanded *expanded = self;
    size_t size = (size_t)expanded->face.n * sizeof *y;
    double *z = room_of(expanded);
    if (!z) /* no memory, which the first step tells */
        return;
    sd_condensed_gather(expanded->condensed, y, z);
    sd_condensed_gather(expanded->condensed, yd, z + expanded->room);
    expanded->inner->start(expanded->inner->self, t, z, z + expanded->room, h);
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
    size_t m = (size_t)condensed->unknowns + 8, numbers = 0;
    if (!expanded)
        return NULL;
    int own = !inner->spare || !inner->spare(inner->self, &numbers) || numbers < 2 * m;
    int steep = condensed->full->scales > 0;
    expanded->z = own ? calloc(2 * m, sizeof(double)) : NULL;
    expanded->y = steep ? calloc((size_t)unknowns + 8, sizeof(double)) : NULL;
    if ((own && !expanded->z) || (steep && !expanded->y)) {
        sd_expanded_free(expanded);
        return NULL;
    }
    expanded->room = m;
    expanded->inner = inner;
    expanded->condensed = condensed;
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
    expanded->face.spare = inner->spare ? spare : NULL;
    return expanded;
}

void sd_expanded_free(sd_expanded *expanded)
{
    if (!expanded)
        return;
    free(expanded->z);
    free(expanded->y);
    free(expanded);
}
