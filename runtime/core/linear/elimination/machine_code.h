/* A list of sums (sums.h) as straight machine code: x86-64 with AVX, the calling convention of Linux; elsewhere
 * there is none.
 *
 * What is written are moves, products, differences and quotients of doubles at fixed distances from two pointers, and the
 * return: no branch, no call, nothing of the user's.  Numbers that are used again soon stay in registers.  A complex
 * number is the two halves of one; its products are those of plain formulae, as the compiler makes them.  Pages are seen
 * twice, to be written at one address and to be executed at another, at none both; those of a code that is no more wait for
 * the next, for new ones cost five times what is written on them.  A process that forks shares its pages with the other:
 * what was written before is never written again.  (An emulator that keeps translations looks for new ones where it is told
 * to: valgrind --smc-check=all.)
 */
#ifndef SYSDYN_MACHINE_CODE_H
#define SYSDYN_MACHINE_CODE_H

#include "linear/sums.h"

#include <stddef.h>

enum sd_numbers { SD_REAL_NUMBERS, SD_COMPLEX_NUMBERS };

/* of the arrays whose places the lists name */
typedef void sd_run_code(void *, void *, void *, void *, void *, void *);

typedef struct sd_code {
    sd_run_code *first, *second; /* the two lists */
    uint8_t *written, *run; /* the pages [size] at their two addresses */
    size_t size;
    int forks;              /* of the process before they were made */
} sd_code;

/* Of the first array the last two numbers are a constant (real: 1; complex: the sign of an imaginary part) and the bits of
 * magnitudes, where the lists take inverses or sizes.  NULL where there is none. */
sd_code *sd_code_new(const sd_list *first, const sd_list *second, enum sd_numbers numbers);
void sd_code_free(sd_code *code);
/* from now on lists are interpreted (0), written where that pays (1), or at once (2; tests) */
void sd_code_allow(int allowed);
int sd_code_early(void);
/* whether any is written, which this machine takes */
int sd_code_possible(void);

#endif
