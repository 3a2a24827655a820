/* Points that are shown as they are: see settle_shown.h. */
#include "system/settle_shown.h"
#include "system/condensed.h"
#include "system/settle_room.h"
#include "linear/tuning.h"

#include <math.h>
#include <string.h>

#define TOLD SD_MET /* scaled residual of a row that points between steps keep */

/* y, yd := what the kept unknowns z, zd make of all, as far as rows show them: their rows were just evaluated */
static void show(const sd_settle *settle, const double *z, const double *zd, double *y, double *yd)
{
    const sd_condensed *left = (const sd_condensed *)settle->system->left;
    if (y != left->y) /* else all unknowns stand there */
        sd_condensed_expand(left, z, y, 0);
    sd_condensed_put(left, zd, yd);
    sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
    sd_condensed_shown_rates(left, yd);
}

int sd_settle_meets(sd_settle *settle, double t, double *y, double *yd)
{
    if (settle->calls == settle->failures || settle->seen || !sd_settle_provide_point(settle))
        return 0;
    const int condensed = settle->system->left != NULL;
    double *z = condensed ? settle->room : y, *zd = condensed ? settle->room + settle->unknowns + 8 : yd;
    if (condensed)
        sd_settle_take_point(settle, y, yd, z, zd);
    sd_settle_measure(settle, t, z, zd);
    settle->drift = settle->constraints;
    int meets = 1;
    for (int32_t i = 0; i < settle->rows && meets; i++)
        meets = !(settle->told[i] || settle->sort[i] == SD_CONSTRAINT) || fabs(settle->r[i] * settle->row_scale[i]) <= TOLD;
    if (condensed)
        show(settle, z, zd, y, yd);
    return meets;
}

int sd_settle_sums_alone(const sd_settle *settle)
{
    int alone = 1;
    for (int32_t i = 0; i < settle->rows; i++)
        alone &= settle->told[i] || settle->sort[i] != SD_CONSTRAINT;
    return alone;
}

void sd_settle_as_met(const sd_settle *settle, double *y, double *yd)
{
    const sd_condensed *left = (const sd_condensed *)settle->system->left;
    if (!left)
        return;
    sd_follow_flows(settle->k_span, settle->k_spans, y, yd);
    sd_condensed_shown_rates(left, yd);
}
