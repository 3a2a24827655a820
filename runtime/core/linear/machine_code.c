/* Machine code of lists of sums: see machine_code.h. */
#if defined(__linux__) && !defined(_DEFAULT_SOURCE)
#define _DEFAULT_SOURCE
#endif
#include "linear/machine_code.h"

#include <stdlib.h>
#include <string.h>

static int permitted = 1;

void sd_code_allow(int allowed)
{
    permitted = allowed;
}

#if defined(__x86_64__) && defined(__linux__) && !defined(SD_INTERPRETED)
#include <sys/mman.h>

#define LONGEST 8   /* bytes of an instruction */
#define OUTSIDE 7   /* rdi */
#define CELL 6      /* rsi */

enum operation { LOAD = 0x10, STORE = 0x11, TIMES = 0x59, MINUS = 0x5c, OVER = 0x5e, GREATER = 0x5f };
enum whole { COPY = 0x28, AND = 0x54, XOR = 0x57 };
enum place { VALUE = 0, PRODUCT = 1, ONE = 6, MASK = 7 }; /* registers xmm */

/* scalar operation of a register and a place in memory */
static uint8_t *memory(uint8_t *at, enum operation operation, enum place value, int32_t place, int32_t inside)
{
    int32_t distance = 8 * (place < inside ? place : place - inside);
    const uint8_t head[4] = {0xf2, 0x0f, (uint8_t)operation, (uint8_t)(0x80 | value << 3 | (place < inside ? CELL : OUTSIDE))};
    memcpy(at, head, sizeof head);
    memcpy(at + sizeof head, &distance, sizeof distance);
    return at + sizeof head + sizeof distance;
}

/* operation of two registers; prefix 0xf2: scalar, 0x66: of all bits */
static uint8_t *registers(uint8_t *at, uint8_t prefix, int operation, enum place value, enum place other)
{
    const uint8_t code[4] = {prefix, 0x0f, (uint8_t)operation, (uint8_t)(0xc0 | value << 3 | other)};
    memcpy(at, code, sizeof code);
    return at + sizeof code;
}

static uint8_t *emit(uint8_t *at, const sd_sum *sum, const int32_t *pair, int32_t inside)
{
    enum place result = VALUE;
    at = sum->source < 0 ? registers(at, 0x66, XOR, VALUE, VALUE) : memory(at, LOAD, VALUE, sum->source, inside);
    for (int32_t p = sum->first; p < sum->last; p++) {
        at = memory(at, LOAD, PRODUCT, pair[2 * p], inside);
        at = memory(at, TIMES, PRODUCT, pair[2 * p + 1], inside);
        if (sum->kind == SD_SUM_LARGEST) {
            at = registers(at, 0x66, AND, PRODUCT, MASK);
            at = registers(at, 0xf2, GREATER, VALUE, PRODUCT);
        } else {
            at = registers(at, 0xf2, MINUS, VALUE, PRODUCT);
        }
    }
    if (sum->kind == SD_SUM_TIMES)
        at = memory(at, TIMES, VALUE, sum->by, inside);
    if (sum->kind == SD_SUM_INVERSE) {
        at = registers(at, 0x66, COPY, PRODUCT, ONE);
        at = registers(at, 0xf2, OVER, PRODUCT, VALUE);
        result = PRODUCT;
    }
    return memory(at, STORE, result, sum->target, inside);
}

static uint8_t *emit_list(uint8_t *at, const sd_list *list, int32_t inside, int32_t one, int32_t mask)
{
    at = memory(at, LOAD, ONE, one, inside);
    at = memory(at, LOAD, MASK, mask, inside);
    for (int32_t s = 0; s < list->sums; s++)
        at = emit(at, &list->sum[s], list->pair, inside);
    *at++ = 0xc3; /* ret */
    return at;
}

sd_code *sd_code_new(const sd_list *factor, const sd_list *solve, int32_t inside, int32_t one, int32_t mask)
{
    size_t operations = 4 * (size_t)(factor->sums + solve->sums) + 4 * (size_t)(factor->pairs + solve->pairs) + 8;
    sd_code *code = permitted ? calloc(1, sizeof *code) : NULL;
    if (!code)
        return NULL;
    code->size = (operations * LONGEST + 4095) / 4096 * 4096;
    code->page = mmap(NULL, code->size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (code->page == MAP_FAILED) {
        free(code);
        return NULL;
    }
    uint8_t *start = code->page, *next = emit_list(start, factor, inside, one, mask);
    emit_list(next, solve, inside, one, mask);
    if (mprotect(code->page, code->size, PROT_READ | PROT_EXEC)) {
        sd_code_free(code);
        return NULL;
    }
    memcpy(&code->factor, &start, sizeof start); /* a function's address is no object's in C */
    memcpy(&code->solve, &next, sizeof next);
    return code;
}

void sd_code_free(sd_code *code)
{
    if (!code)
        return;
    munmap(code->page, code->size);
    free(code);
}
#else
sd_code *sd_code_new(const sd_list *factor, const sd_list *solve, int32_t inside, int32_t one, int32_t mask)
{
    (void)factor, (void)solve, (void)inside, (void)one, (void)mask, (void)permitted;
    return NULL;
}

void sd_code_free(sd_code *code)
{
    (void)code;
}
#endif
