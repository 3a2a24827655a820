/* A small pool of threads: see threads.h.
 *
 * A job is published in `ticket`: its number in the upper half, how many of its parts nobody has taken in the lower one.
 * Who takes a part lowers that by one, and only while the job is the one that it saw; so nobody waits for a thread that
 * sleeps or whose core is taken, and what a job points to stays until each part that was taken is done. */
#define _GNU_SOURCE
#include "steppers/threads.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

#define MOST 8     /* threads: memory feeds no more */
#define SPIN 1000  /* looks for another job, or for an end, before a thread sleeps: some ten microseconds */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t wake = PTHREAD_COND_INITIALIZER, finished = PTHREAD_COND_INITIALIZER;
static atomic_flag busy = ATOMIC_FLAG_INIT;
static atomic_int number, left, sleeping, waiting;
static _Atomic uint64_t ticket;
static int begun, prepared;
static sd_part *job;
static void *job_context;

static inline void pause_briefly(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

/* a child of fork has none of the threads */
static void forget(void)
{
    pthread_mutex_init(&lock, NULL);
    pthread_cond_init(&wake, NULL);
    pthread_cond_init(&finished, NULL);
    atomic_flag_clear(&busy);
    atomic_store(&ticket, 0);
    atomic_store(&left, 0);
    atomic_store(&sleeping, 0);
    atomic_store(&waiting, 0);
    begun = 0;
}

static int available(void)
{
    const char *said = getenv("SYSDYN_THREADS");
    long found = said ? strtol(said, NULL, 10) : 0;
    if (found > 0)
        return found < MOST ? (int)found : MOST;
#ifdef CPU_COUNT
    cpu_set_t set;
    if (sched_getaffinity(0, sizeof set, &set) == 0)
        found = CPU_COUNT(&set);
#else
    found = sysconf(_SC_NPROCESSORS_ONLN);
#endif
    return found < 1 ? 1 : found < MOST ? (int)found : MOST;
}

int sd_threads(void)
{
    int known = atomic_load(&number);
    if (known == 0)
        atomic_store(&number, known = available());
    return known;
}

void sd_threads_use(int wanted)
{
    atomic_store(&number, wanted <= 0 ? 0 : wanted < MOST ? wanted : MOST);
}

/* one part of the job that `seen` numbers; 0: none is left of it */
static int take(uint32_t seen)
{
    uint64_t now = atomic_load(&ticket);
    while ((uint32_t)(now >> 32) == seen && (uint32_t)now > 0)
        if (atomic_compare_exchange_weak(&ticket, &now, now - 1)) {
            job(job_context, (int)(uint32_t)now - 1);
            if (atomic_fetch_sub(&left, 1) == 1 && atomic_load(&waiting)) {
                pthread_mutex_lock(&lock);
                pthread_cond_signal(&finished);
                pthread_mutex_unlock(&lock);
            }
            return 1;
        }
    return 0;
}

static void *serve(void *nothing)
{
    (void)nothing;
    for (;;) {
        for (int spin = 0; spin < SPIN && (uint32_t)atomic_load(&ticket) == 0; spin++)
            pause_briefly();
        if ((uint32_t)atomic_load(&ticket) == 0) {
            pthread_mutex_lock(&lock);
            atomic_fetch_add(&sleeping, 1);
            while ((uint32_t)atomic_load(&ticket) == 0)
                pthread_cond_wait(&wake, &lock);
            atomic_fetch_sub(&sleeping, 1);
            pthread_mutex_unlock(&lock);
        }
        uint32_t seen = (uint32_t)(atomic_load(&ticket) >> 32);
        while (take(seen))
            ;
    }
    return NULL;
}

/* as many threads as are wanted beside the asking one; signals are for the others of the process */
static void begin(int wanted)
{
    if (!prepared)
        pthread_atfork(NULL, NULL, forget);
    prepared = 1;
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    for (; begun < wanted; begun++) {
        pthread_t thread;
        if (pthread_create(&thread, NULL, serve, NULL))
            break;
        pthread_detach(thread);
    }
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

void sd_side_by_side(int parts, sd_part *work, void *context)
{
    int threads = sd_threads();
    if (parts < 2 || threads < 2 || atomic_flag_test_and_set(&busy)) {
        for (int part = parts - 1; part >= 0; part--)
            work(context, part);
        return;
    }
    if (begun < threads - 1)
        begin(threads - 1);
    job = work;
    job_context = context;
    atomic_store(&left, parts);
    uint32_t mine = (uint32_t)(atomic_load(&ticket) >> 32) + 1;
    atomic_store(&ticket, (uint64_t)mine << 32 | (uint32_t)parts);
    if (atomic_load(&sleeping)) {
        pthread_mutex_lock(&lock);
        pthread_cond_broadcast(&wake);
        pthread_mutex_unlock(&lock);
    }
    while (take(mine))
        ;
    for (int spin = 0; spin < SPIN && atomic_load(&left); spin++)
        pause_briefly();
    if (atomic_load(&left)) {
        pthread_mutex_lock(&lock);
        atomic_store(&waiting, 1);
        while (atomic_load(&left))
            pthread_cond_wait(&finished, &lock);
        atomic_store(&waiting, 0);
        pthread_mutex_unlock(&lock);
    }
    atomic_flag_clear(&busy);
}
