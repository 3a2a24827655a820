/* Points of a condensed system with every unknown: see expanded.h. */
#include "expanded.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void sd_expanded_show(sd_expanded *expanded)
{
    sd_condensed_expand(expanded->condensed, expanded->inner->y, expanded->y, 0);
    sd_condensed_expand(expanded->condensed, expanded->inner->yd, expanded->yd, 1);
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
    expanded->face.nodes = inner->nodes < expanded->nodes ? inner->nodes : expanded->nodes;
    expanded->face.node = inner->node;
    expanded->face.node_weight = inner->node_weight;
    for (int32_t k = 0; k < expanded->face.nodes; k++)
        sd_condensed_show(expanded->condensed, inner->node_y[k], inner->node_yd[k], expanded->node_y[k],
                          expanded->node_yd[k]);
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
    memmove(expanded->y, y, size);
    memmove(expanded->yd, yd, size);
    expanded->face.nodes = expanded->inner->nodes;
    expanded->face.node = expanded->inner->node;
    expanded->face.node_weight = expanded->inner->node_weight;
}

sd_expanded *sd_expanded_new(sd_stepper *inner, const sd_condensed *condensed, int32_t unknowns)
{
    sd_expanded *expanded = calloc(1, sizeof *expanded);
    size_t n = (size_t)unknowns + 8, m = (size_t)condensed->unknowns + 8;
    int32_t nodes = inner->node_y ? inner->nodes : 0; /* at most */
    if (!expanded)
        return NULL;
    expanded->memory = calloc(2 * n + 2 * m + 2 * (size_t)nodes * n, sizeof(double));
    expanded->node_y = calloc(2 * (size_t)nodes + 1, sizeof(double *));
    if (!expanded->memory || !expanded->node_y) {
        sd_expanded_free(expanded);
        return NULL;
    }
    expanded->inner = inner;
    expanded->condensed = condensed;
    expanded->nodes = nodes;
    expanded->y = expanded->memory;
    expanded->yd = expanded->y + n;
    expanded->z = expanded->yd + n;
    expanded->zd = expanded->z + m;
    expanded->node_yd = expanded->node_y + nodes;
    for (int32_t k = 0; k < nodes; k++) {
        expanded->node_y[k] = expanded->zd + m + 2 * (size_t)k * n;
        expanded->node_yd[k] = expanded->node_y[k] + n;
    }
    expanded->face = *inner;
    expanded->face.self = expanded;
    expanded->face.n = unknowns;
    expanded->face.y = expanded->y;
    expanded->face.yd = expanded->yd;
    expanded->face.step = step;
    expanded->face.dense = dense;
    expanded->face.refine = inner->refine ? refine : NULL;
    expanded->face.start = start;
    expanded->face.node_y = expanded->node_y;
    expanded->face.node_yd = expanded->node_yd;
    return expanded;
}

void sd_expanded_free(sd_expanded *expanded)
{
    if (!expanded)
        return;
    free(expanded->memory);
    free(expanded->node_y);
    free(expanded);
}

sd_stepper *sd_expanded_stepper(sd_expanded *expanded)
{
    return &expanded->face;
}
