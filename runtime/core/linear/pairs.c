/* Two stable counting sorts, the less significant number first (radix sort; Knuth, The Art of Computer Programming 3,
 * 5.2.5). */
#include "linear/pairs.h"

#include <stdlib.h>
#include <string.h>

/* to [n] := from in the order of key, equal ones as they stand; from NULL: 0..n-1; count [keys + 1]: room */
static void sort_by(int32_t n, int32_t keys, const int32_t *key, const int32_t *from, int32_t *to, int32_t *count)
{
    memset(count, 0, ((size_t)keys + 1) * sizeof *count);
    for (int32_t i = 0; i < n; i++)
        count[key[i] + 1]++;
    for (int32_t k = 0; k < keys; k++)
        count[k + 1] += count[k];
    for (int32_t i = 0; i < n; i++) {
        int32_t e = from ? from[i] : i;
        to[count[key[e]]++] = e;
    }
}

int64_t sd_pairs(int32_t n, int32_t firsts, int32_t seconds, const int32_t *first, const int32_t *second, int32_t *number,
                 int32_t *start, int32_t *each)
{
    int32_t most = firsts > seconds ? firsts : seconds, before = 0;
    int32_t *count = malloc(((size_t)most + 1) * sizeof *count);
    if (!count)
        return -1;
    int32_t *once = number, *twice = each; /* no place of an answer is written before what stood there was read */
    sort_by(n, seconds, second, NULL, once, count);
    sort_by(n, firsts, first, once, twice, count);
    int64_t found = 0;
    memset(start, 0, ((size_t)firsts + 1) * sizeof *start);
    for (int32_t i = 0; i < n; i++) {
        int32_t e = twice[i];
        if (!i || first[e] != first[before] || second[e] != second[before]) {
            each[found++] = second[e];
            start[first[e] + 1]++;
        }
        number[e] = (int32_t)(found - 1);
        before = e;
    }
    for (int32_t k = 0; k < firsts; k++)
        start[k + 1] += start[k];
    free(count);
    return found;
}

void sd_firsts(int32_t firsts, const int32_t *start, int32_t *first)
{
    for (int32_t k = 0; k < firsts; k++)
        for (int32_t i = start[k]; i < start[k + 1]; i++)
            first[i] = k;
}
