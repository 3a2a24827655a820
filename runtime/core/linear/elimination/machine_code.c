/* Machine code of lists of sums: see machine_code.h. */
#if defined(__linux__) && !defined(_GNU_SOURCE)
#define _GNU_SOURCE /* memfd_create */
#endif
#include "linear/elimination/machine_code.h"

#include <stdlib.h>
#include <string.h>

static int permitted = 1;

void sd_code_allow(int allowed)
{
    permitted = allowed;
}

int sd_code_early(void)
{
    return permitted > 1;
}

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(SD_INTERPRETED)
#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

int sd_code_possible(void)
{
    return permitted && __builtin_cpu_supports("avx");
}

#define LONGEST 10     /* bytes of an instruction */
#define LEAST 16384    /* bytes of the pages of one code: what a run wants is less mostly, */
#define MOST 262144    /* and of those that are kept at most */
#define SPARES 4
#define IN_A_PAIR 8    /* instructions at most */
#define IN_A_SUM 8
#define NEVER INT32_MAX
#define REGISTERS 16

/* where the arrays stand: rdi, rsi, rdx, rcx, r8, r9 */
static const uint8_t base[SD_ARRAYS] = {7, 6, 2, 1, 8, 9};
/* registers xmm: three to work in, two constants, and those that keep numbers of places */
enum place { PRODUCT = 0, OTHER = 1, TURNED = 2, CONSTANT = 3, MASK = 4, KEPT = 5 };
enum prefix { PACKED = 1, SCALAR = 3 };
enum operation {
    LOAD = 0x10, STORE = 0x11, TWICE = 0x12, UPPER = 0x15, COPY = 0x28, AND = 0x54, XOR = 0x57, PLUS = 0x58, TIMES = 0x59, MINUS = 0x5c,
    OVER = 0x5e, GREATER = 0x5f, ADD_ACROSS = 0x7c, EXCHANGE = 0xc6, MINUS_PLUS = 0xd0
};

/* A list while it is written.  Which numbers stay in registers: those that are used soonest again (Belady).  after: the
 * next sum that uses a place, for each use: of the pairs, then of sources, factors `by` and targets. */
typedef struct writer {
    uint8_t *at;
    const sd_list *list;
    int32_t size;                             /* bytes of a number */
    enum sd_numbers numbers;
    int32_t held[REGISTERS], next[REGISTERS]; /* place that a register keeps, -1: none; the sum that uses it next */
    int32_t *where;                           /* of a place: its register, 0: none */
    int32_t *after;
} writer;

static enum prefix whole(const writer *w)
{
    return w->numbers == SD_COMPLEX_NUMBERS ? PACKED : SCALAR;
}

/* the operation and what stands before it (VEX): target, other: registers, of which the upper eight have a bit here */
static inline void begin(writer *w, enum prefix prefix, enum operation operation, unsigned target, unsigned first, unsigned other)
{
    const uint32_t head = 0x41c4 | (target < 8) << 15 | (other < 8) << 13 | (~first & 15) << 19
        | (uint32_t)prefix << 16 | (uint32_t)operation << 24;
    memcpy(w->at, &head, sizeof head);
}

/* target := first operation other */
static inline void registers(writer *w, enum prefix prefix, enum operation operation, int target, int first, int other)
{
    begin(w, prefix, operation, (unsigned)target, (unsigned)first, (unsigned)other);
    w->at[4] = (uint8_t)(0xc0 | (target & 7) << 3 | (other & 7));
    w->at += 5;
}

/* target := first operation what is at a place, or its imaginary part; first 0 where there is none */
static inline void memory(writer *w, enum prefix prefix, enum operation operation, int target, int first, int32_t place, int imaginary)
{
    int array = 0;
    while (array < SD_ARRAYS - 1 && place >= w->list->end[array])
        array++;
    int32_t distance = (array ? place - w->list->end[array - 1] : place) * w->size + 8 * imaginary;
    begin(w, prefix, operation, (unsigned)target, (unsigned)first, base[array]);
    w->at[4] = (uint8_t)(0x80 | (target & 7) << 3 | (base[array] & 7));
    memcpy(w->at + 5, &distance, sizeof distance);
    w->at += 9;
}

/* --- which numbers stay in registers ------------------------------------------------------------------------------ */

static int32_t *after_source(const writer *w, int32_t s) { return w->after + 2 * w->list->pairs + s; }
static int32_t *after_by(const writer *w, int32_t s) { return w->after + 2 * w->list->pairs + w->list->sums + s; }
static int32_t *after_target(const writer *w, int32_t s) { return w->after + 2 * w->list->pairs + 2 * w->list->sums + s; }

static inline int uses_by(const sd_sum *sum) { return sum->kind == SD_SUM_TIMES || sum->kind == SD_SUM_LESS; }

/* the next use behind each use; works in `where` */
static void look_ahead(writer *w, int32_t places)
{
    const sd_list *list = w->list;
    int32_t *soonest = w->where;
    for (int32_t i = 0; i < places; i++)
        soonest[i] = NEVER;
    for (int32_t s = list->sums - 1; s >= 0; s--) {
        const sd_sum *sum = &list->sum[s];
        *after_target(w, s) = soonest[sum->target];
        *after_source(w, s) = sum->source < 0 ? NEVER : soonest[sum->source];
        *after_by(w, s) = uses_by(sum) ? soonest[sum->by] : NEVER;
        for (int32_t p = 2 * sum->first; p < 2 * sum->last; p++)
            w->after[p] = soonest[list->pair[p]];
        for (int32_t p = 2 * sum->first; p < 2 * sum->last; p++)
            soonest[list->pair[p]] = s;
        if (sum->source >= 0)
            soonest[sum->source] = s;
        if (uses_by(sum))
            soonest[sum->by] = s;
    }
    memset(w->where, 0, (size_t)places * sizeof *w->where);
}

static void let_go(writer *w, int place)
{
    if (w->held[place] >= 0)
        w->where[w->held[place]] = 0;
    w->held[place] = -1;
    w->next[place] = NEVER;
}

/* the register whose number is used last */
static int last_used(const writer *w)
{
    int found = KEPT;
    for (int r = KEPT + 1; r < REGISTERS && w->next[found] < NEVER; r++)
        if (w->next[r] > w->next[found])
            found = r;
    return found;
}

/* a register for the sum at hand, which stays its own until it is kept or let go */
static int take(writer *w)
{
    int r = last_used(w);
    let_go(w, r);
    w->next[r] = -1;
    return r;
}

/* the register has the number of a place from now on, which the sum `next` uses */
static void keep(writer *w, int r, int32_t place, int32_t next)
{
    if (w->where[place])
        let_go(w, w->where[place]);
    if (next == NEVER) {
        let_go(w, r);
        return;
    }
    w->held[r] = place;
    w->next[r] = next;
    w->where[place] = r;
}

/* a register that has the number of a place: one that keeps it from now on, where that is worth it, or `scratch` */
static int fetch(writer *w, int32_t place, int32_t next, int scratch)
{
    int r = w->where[place];
    if (r) {
        w->next[r] = next;
        return r;
    }
    r = next < NEVER ? last_used(w) : scratch; /* not used again: worth no register */
    if (w->next[r] <= next)
        r = scratch;
    else
        let_go(w, r);
    memory(w, whole(w), LOAD, r, 0, place, 0);
    if (r != scratch)
        keep(w, r, place, next);
    return r;
}

/* --- operations of numbers ---------------------------------------------------------------------------------------- */

/* target := a register's number times that of a place */
static void multiply(writer *w, int target, int a, int32_t place)
{
    int b = w->where[place];
    if (w->numbers == SD_REAL_NUMBERS) {
        if (b)
            registers(w, SCALAR, TIMES, target, a, b);
        else
            memory(w, SCALAR, TIMES, target, a, place, 0);
        return;
    }
    if (b) {
        registers(w, SCALAR, TWICE, OTHER, 0, b);
        registers(w, PACKED, UPPER, TURNED, b, b);
    } else {
        memory(w, SCALAR, TWICE, OTHER, 0, place, 0);
        memory(w, SCALAR, TWICE, TURNED, 0, place, 1);
    }
    registers(w, PACKED, TIMES, OTHER, a, OTHER); /* (a.re b.re, a.im b.re) */
    registers(w, PACKED, EXCHANGE, PRODUCT, a, a);
    *w->at++ = 1;
    registers(w, PACKED, TIMES, TURNED, PRODUCT, TURNED); /* (a.im b.im, a.re b.im) */
    registers(w, PACKED, MINUS_PLUS, target, OTHER, TURNED);
}

/* target := the product of pair p */
static void pair_product(writer *w, int32_t p, int target)
{
    const int32_t *pair = w->list->pair + 2 * p, *after = w->after + 2 * p;
    /* the one that is used sooner again is worth a register */
    int first = w->where[pair[0]] ? 0 : w->where[pair[1]] ? 1 : after[0] <= after[1] ? 0 : 1;
    int a = fetch(w, pair[first], after[first], PRODUCT);
    multiply(w, target, a, pair[1 - first]);
    if (w->where[pair[1 - first]])
        w->next[w->where[pair[1 - first]]] = after[1 - first];
}

/* value := the larger of it, zero before the first, and the size of PRODUCT */
static void enlarge(writer *w, int value, int first)
{
    int size = first && w->numbers == SD_REAL_NUMBERS ? value : PRODUCT;
    registers(w, PACKED, AND, size, PRODUCT, MASK);
    if (w->numbers == SD_COMPLEX_NUMBERS)
        registers(w, PACKED, ADD_ACROSS, PRODUCT, PRODUCT, PRODUCT);
    if (size != value)
        registers(w, SCALAR, GREATER, value, value, PRODUCT);
}

static void invert(writer *w, int target, int value)
{
    if (w->numbers == SD_REAL_NUMBERS) {
        registers(w, SCALAR, OVER, target, CONSTANT, value);
        return;
    }
    registers(w, PACKED, TIMES, PRODUCT, value, value);
    registers(w, PACKED, ADD_ACROSS, PRODUCT, PRODUCT, PRODUCT);
    registers(w, PACKED, XOR, OTHER, value, CONSTANT);
    registers(w, PACKED, OVER, target, OTHER, PRODUCT);
}

/* a register with the source of a sum: that which keeps it, not to be taken before it is read, or `value` */
static int begin_sum(writer *w, int32_t s, int value)
{
    const sd_sum *sum = &w->list->sum[s];
    int32_t source = sum->source;
    if (source < 0) {
        if (sum->kind != SD_SUM_LARGEST || sum->first == sum->last || w->numbers == SD_COMPLEX_NUMBERS)
            registers(w, PACKED, XOR, value, value, value);
    } else if (w->where[source]) {
        w->next[w->where[source]] = -1;
        return w->where[source];
    } else {
        memory(w, whole(w), LOAD, value, 0, source, 0);
    }
    return value;
}

/* value := first operation the number of a place */
static void combine(writer *w, enum operation operation, int value, int first, int32_t place)
{
    if (w->where[place])
        registers(w, whole(w), operation, value, first, w->where[place]);
    else
        memory(w, whole(w), operation, value, first, place, 0);
}

/* value := what the sum's kind makes of the sum in `from` */
static void end_sum(writer *w, int32_t s, int value, int from)
{
    const sd_sum *sum = &w->list->sum[s];
    if (uses_by(sum)) {
        if (sum->kind == SD_SUM_TIMES)
            multiply(w, value, from, sum->by);
        else
            combine(w, MINUS, value, from, sum->by);
        if (w->where[sum->by])
            w->next[w->where[sum->by]] = *after_by(w, s);
    } else if (sum->kind == SD_SUM_INVERSE) {
        invert(w, value, from);
    } else if (from != value) {
        registers(w, PACKED, COPY, value, 0, from);
    }
}

/* value := products, then the source */
static void add_up(writer *w, int32_t s, int value)
{
    const sd_sum *sum = &w->list->sum[s];
    for (int32_t p = sum->first; p < sum->last; p++) {
        int product = p == sum->first ? value : PRODUCT;
        pair_product(w, p, product);
        if (product != value)
            registers(w, whole(w), PLUS, value, value, product);
    }
    if (sum->source < 0)
        return;
    combine(w, PLUS, value, value, sum->source);
    if (w->where[sum->source])
        w->next[w->where[sum->source]] = *after_source(w, s);
}

/* value := source less products, and what the kind makes of it */
static void take_off(writer *w, int32_t s, int value)
{
    const sd_sum *sum = &w->list->sum[s];
    int source = begin_sum(w, s, value), from = source;
    for (int32_t p = sum->first; p < sum->last; p++) {
        pair_product(w, p, PRODUCT);
        if (sum->kind == SD_SUM_LARGEST)
            enlarge(w, value, p == sum->first);
        else
            registers(w, whole(w), MINUS, value, from, PRODUCT);
        from = value;
    }
    end_sum(w, s, value, from);
    if (source != value)
        w->next[source] = *after_source(w, s);
}

static void write_sum(writer *w, int32_t s)
{
    const sd_sum *sum = &w->list->sum[s];
    int value = take(w);
    if (sum->kind == SD_SUM_PLUS && sum->first < sum->last)
        add_up(w, s, value);
    else
        take_off(w, s, value);
    memory(w, whole(w), STORE, value, 0, sum->target, 0);
    keep(w, value, sum->target, *after_target(w, s));
}

/* --- code of two lists ---------------------------------------------------------------------------------------------- */

static void write_list(writer *w, const sd_list *list, int32_t places)
{
    const int32_t constant = list->end[0] - 2;
    w->list = list;
    look_ahead(w, places);
    for (int r = 0; r < REGISTERS; r++) {
        w->held[r] = -1;
        w->next[r] = NEVER;
    }
    memory(w, whole(w), LOAD, CONSTANT, 0, constant, 0);
    memory(w, whole(w), LOAD, MASK, 0, constant + 1, 0);
    for (int32_t s = 0; s < list->sums; s++)
        write_sum(w, s);
    *w->at++ = 0xc3; /* ret */
}

/* the number of places that a list names */
static int32_t places_of(const sd_list *list, int32_t least)
{
    for (const sd_sum *sum = list->sum, *end = sum + list->sums; sum < end; sum++) {
        least = sum->target < least ? least : sum->target + 1;
        least = sum->source < least ? least : sum->source + 1;
        least = sum->by < least ? least : sum->by + 1;
    }
    for (int32_t p = 0; p < 2 * list->pairs; p++)
        least = list->pair[p] < least ? least : list->pair[p] + 1;
    return least;
}

static size_t room_of(const sd_list *list)
{
    return LONGEST * (IN_A_SUM * (size_t)list->sums + IN_A_PAIR * (size_t)list->pairs + 3);
}

/* 0: both lists are written.  What was executed there before was so long ago: the processor has nothing of it on its way */
static int write_lists(sd_code *code, const sd_list *first, const sd_list *second, enum sd_numbers numbers)
{
    int32_t places = places_of(first, places_of(second, 0));
    int32_t pairs = first->pairs > second->pairs ? first->pairs : second->pairs;
    int32_t sums = first->sums > second->sums ? first->sums : second->sums;
    int32_t *work = malloc((size_t)(places + 2 * pairs + 3 * sums) * sizeof *work + 1);
    if (!work)
        return 1;
    writer w = {.at = code->written, .size = numbers == SD_COMPLEX_NUMBERS ? 16 : 8, .numbers = numbers, .where = work,
                .after = work + places};
    write_list(&w, first, places);
    const uint8_t *start = code->run, *next = code->run + (w.at - code->written);
    write_list(&w, second, places);
    free(work);
    memcpy(&code->first, &start, sizeof start); /* a function's address is no object's in C */
    memcpy(&code->second, &next, sizeof next);
    return 0;
}

/* pages of codes that are no more */
static sd_code *spare[SPARES];
static int forks;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void count_fork(void)
{
    __atomic_add_fetch(&forks, 1, __ATOMIC_ACQ_REL);
}

static void watch_forks(void)
{
    pthread_atfork(count_fork, NULL, NULL);
}

/* nobody else may see what is written on them */
static int is_own(const sd_code *code)
{
    return code->forks == __atomic_load_n(&forks, __ATOMIC_ACQUIRE);
}

static void give_back(sd_code *code)
{
    if (code->written)
        munmap(code->written, code->size);
    if (code->run)
        munmap(code->run, code->size);
    free(code);
}

static void *seen(int file, size_t size, int how)
{
    void *at = mmap(NULL, size, how, MAP_SHARED, file, 0);
    return at == MAP_FAILED ? NULL : at;
}

/* new pages of `size` bytes; NULL where the system gives none that may be executed */
static sd_code *new_pages(size_t size)
{
    sd_code *code = pthread_once(&once, watch_forks) ? NULL : calloc(1, sizeof *code);
    int file = code ? memfd_create("sysdyn", MFD_CLOEXEC) : -1;
    if (file >= 0 && ftruncate(file, (off_t)size) == 0) {
        code->size = size;
        code->forks = __atomic_load_n(&forks, __ATOMIC_ACQUIRE);
        code->written = seen(file, size, PROT_READ | PROT_WRITE);
        code->run = seen(file, size, PROT_READ | PROT_EXEC);
    }
    if (file >= 0)
        close(file);
    if (code && !(code->written && code->run)) {
        give_back(code);
        return NULL;
    }
    return code;
}

/* pages of `size` bytes or more: spare ones, or new */
static sd_code *pages(size_t size)
{
    for (int k = 0; k < SPARES; k++) {
        sd_code *code = __atomic_exchange_n(&spare[k], NULL, __ATOMIC_ACQ_REL);
        if (code && code->size >= size && is_own(code))
            return code;
        sd_code_free(code);
    }
    return new_pages(size);
}

sd_code *sd_code_new(const sd_list *first, const sd_list *second, enum sd_numbers numbers)
{
    size_t size = (room_of(first) + room_of(second) + 4095) / 4096 * 4096;
    sd_code *code = sd_code_possible() ? pages(size > LEAST ? size : LEAST) : NULL;
    if (code && write_lists(code, first, second, numbers)) {
        sd_code_free(code);
        return NULL;
    }
    return code;
}

void sd_code_free(sd_code *code)
{
    for (int k = 0; code && k < SPARES && code->size <= MOST && is_own(code); k++) {
        sd_code *none = NULL;
        if (__atomic_compare_exchange_n(&spare[k], &none, code, 0, __ATOMIC_ACQ_REL, __ATOMIC_RELAXED))
            return;
    }
    if (code)
        give_back(code);
}
#else
int sd_code_possible(void)
{
    return 0;
}

sd_code *sd_code_new(const sd_list *first, const sd_list *second, enum sd_numbers numbers)
{
    (void)first, (void)second, (void)numbers, (void)permitted;
    return NULL;
}

void sd_code_free(sd_code *code)
{
    (void)code;
}
#endif
