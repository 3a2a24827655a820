/* A list of sums (elimination.h) as straight machine code: x86-64, the calling convention of Linux; elsewhere there is none.
 *
 * What is written are moves, products, differences and quotients of doubles at fixed distances from two pointers, and the
 * return: no branch, no call, nothing of the user's.  Pages are written, then made executable, never both.
 */
#ifndef SYSDYN_MACHINE_CODE_H
#define SYSDYN_MACHINE_CODE_H

#include "linear/elimination.h"

#include <stddef.h>

typedef void sd_run_code(double *outside, double *cell);

struct sd_code {
    sd_run_code *factor, *solve;
    void *page;
    size_t size;
};

/* one, mask: cells of 1.0 and of the bits of a magnitude; inside: as in elimination.h.  NULL where there is none. */
sd_code *sd_code_new(const sd_list *factor, const sd_list *solve, int32_t inside, int32_t one, int32_t mask);
void sd_code_free(sd_code *code);
/* 0: from now on lists are interpreted (tests) */
void sd_code_allow(int allowed);

#endif
