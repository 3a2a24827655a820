/* Levels of what double arithmetic leaves of a number, and how far beside it another one stands: runtime/tuning.py says of
 * each why it is that, and reads it from here (run/module.c).  A file gives one the name of what it decides there. */
#ifndef SYSDYN_TUNING_H
#define SYSDYN_TUNING_H

#define SD_BY_SUMS 1e-14 /* of its terms: a sum of a hundred */
#define SD_BY_FACTORS 1e-13 /* of the largest: a solution by factors */
#define SD_CANCELS 1e-12 /* of their magnitudes: a sum of terms that cancel */
#define SD_DEPENDENT 1e-11 /* of the largest: a pivot of a row that follows from others */
#define SD_MET 1e-10 /* of its terms: a row that Newton's method has met */
#define SD_SAME 1e-9 /* of its size: what two ways to one number differ by */
#define SD_INSTANT 1e-9 /* of the span: what two ways to one instant differ by */
#define SD_HALF_OF_ITS_DIGITS 1e-8 /* of its size, or a pivot's column: the root of EPS */
#define SD_OPEN 1e-7 /* of a unit vector, or the largest: where each of two has lost half of its digits */
#define SD_UNSEEN 1e-6 /* of its size: no result shows it */
#define SD_SLIGHT 1e-4 /* of its size: beyond a cube root of round-off */
#define SD_SMALL 1e-3 /* of its size: it says nothing beside that */
#define SD_PIVOT 0.1 /* of the largest entry of its column: what may pivot */
#define SD_GENERIC 0.7310585786300049 /* 1 / (1 + 1/e): no ratio of small numbers */

#endif
