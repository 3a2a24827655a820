/* The three types of model.h that the core needs, for as long as model.h itself does not compile.
 *
 * model.h (version 1) ends its own comment early where it writes d2T* before a slash.  Its text belongs to the
 * contract and is not changed from here; when it is mended, this file becomes `#include "model.h"`.
 * The guard is model.h's own, so that nobody gets both.
 */
#ifndef SYSDYN_MODEL_H
#define SYSDYN_MODEL_H

#include <stdint.h>

#define SD_CONTRACT 1

typedef struct sd_frame {
    const double *p;
    const int32_t *ix;
    const int32_t *at;
    const int32_t *to;
} sd_frame;

typedef void sd_rows(const sd_frame *frame, double t, const double *y, const double *yd, double *r);
typedef void sd_entries(const sd_frame *frame, double t, const double *y, const double *yd, double *v);

#endif
