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

/* of the numbers outside and those of the cells; others: two more arrays outside, where lists name places there */
typedef void sd_run_code(void *outside, void *cell, void *other, void *last);

typedef struct sd_code {
    sd_run_code *factor, *solve; /* the first list and the second */
    uint8_t *written, *run; /* the pages [size] at their two addresses */
    size_t size;
    int forks;              /* of the process before they were made */
} sd_code;

#define SD_ARRAYS 4 /* the cells, and those outside in the order of arguments */

/* end [SD_ARRAYS - 1]: places before the first are cells, as in elimination.h, before the next of the first array outside,
 * and so on (INT32_MAX: there is none behind it); the last two cells are a constant (real: 1; complex: the sign of an imaginary
 * part) and the bits of magnitudes.  NULL where there is none. */
sd_code *sd_code_new(const sd_list *factor, const sd_list *solve, const int32_t *end, enum sd_numbers numbers);
void sd_code_free(sd_code *code);
/* from now on lists are interpreted (0), written where that pays (1), or at once (2; tests) */
void sd_code_allow(int allowed);
int sd_code_early(void);

#endif
