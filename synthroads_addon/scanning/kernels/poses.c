/* Turns vectors by the poses of a track at their times: knots.Track.at and pulses.turn_vectors, operation by operation. */
#include "kernel.h"

#define MOST 3 /* sets of vectors */

/* The value between two knots. */
INLINE double between(const double *row, int64_t knot, double share)
{
    return (row[knot + 1] - row[knot]) * share + row[knot];
}

/* Writes `sets` of turned vectors (3, count), and the positions (3, count). `rotation`: (9, knots), `position`: (3,
 * knots), of knots from `begin` on, `spacing` apart, s. `vectors`: (3, columns), which repeat: those from `first` on, or
 * `rows` (count) counted from there, none of which lies before the one before it. */
INLINE void any_turn(int64_t count, const double *times, double begin, double spacing, int64_t knots,
                     const double *rotation, const double *position, int64_t first, int64_t columns,
                     const int64_t *rows, int64_t sets, const double *const *vectors, double *const *turned,
                     double *place)
{
    const double last = (double)(knots - 2);
    int64_t passed = 0;
    for (int64_t i = 0; i < count; i++) {
        int64_t at = first + (rows ? rows[i] : i) - passed;
        while (at >= columns) {
            at -= columns;
            passed += columns;
        }
        double share = (times[i] - begin) / spacing, matrix[9];
        const int64_t knot = share > 0.0 ? (share < last ? (int64_t)share : knots - 2) : 0;
        share -= (double)knot;
        for (int j = 0; j < 9; j++)
            matrix[j] = between(rotation + j * knots, knot, share);
        for (int j = 0; j < 3; j++)
            place[j * count + i] = between(position + j * knots, knot, share);
        for (int64_t set = 0; set < sets && set < MOST; set++) {
            const double x = vectors[set][at], y = vectors[set][columns + at], z = vectors[set][2 * columns + at];
            for (int j = 0; j < 3; j++)
                turned[set][j * count + i] = matrix[3 * j] * x + matrix[3 * j + 1] * y + matrix[3 * j + 2] * z;
        }
    }
}

EXPORT_WIDE(void, turn,
            (int64_t count, const double *times, double begin, double spacing, int64_t knots, const double *rotation,
             const double *position, int64_t first, int64_t columns, const int64_t *rows, int64_t sets, const double
             *const *vectors, double *const *turned, double *place),
            (count, times, begin, spacing, knots, rotation, position, first, columns, rows, sets, vectors, turned,
             place))
