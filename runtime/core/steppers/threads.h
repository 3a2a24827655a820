/* Parts of one piece of work on the cores of the machine.
 *
 * What is computed never depends on how many threads there are: parts are whole tasks that write to places of their own.
 * One job at a time: whoever asks while another one runs (another thread of the process, a part itself) does its parts alone.
 * Threads begin with the first job of a large system, wait for the next one on a core for microseconds, and then sleep.
 *
 * What was measured on two cores and left out: loops over unknowns in halves (values between steps, differences, eliminated
 * unknowns) took 1.1 times as long at 30000 unknowns and as long at 100000, for halves change caches; columns of a grid's
 * factors in turns made a step of the bdf 0.93 to 1.46 times as fast, and slower where others had the cores.  Lines are
 * eliminated from one end to the other: their factors have no parts that could be made at once.
 */
#ifndef SYSDYN_THREADS_H
#define SYSDYN_THREADS_H

#include <stdint.h>

#define SD_LARGE 10000 /* unknowns from which a step of radau gains from a second thread (tests/bench/cores.py) */

typedef void sd_part(void *context, int part);

/* threads that work on a job, the asking one among them: SYSDYN_THREADS, else the cores that the process may use */
int sd_threads(void);
/* from now on; 0: as the environment or the machine says */
void sd_threads_use(int number);
/* work(context, part) for each part of 0..parts-1, in any order; returns when all are done */
void sd_side_by_side(int parts, sd_part *work, void *context);

#endif
