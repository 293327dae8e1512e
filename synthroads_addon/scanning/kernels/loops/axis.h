/* Stations on an alignment: road.alignment.Alignment._evaluate and _find_feet, operation by operation. */
#include "../kernel.h"

/* Pieces of an alignment; as `_Pieces` in points.py. */
typedef struct {
    const double *borders; /* (pieces - 1), ascending */
    const double *middles, *halves, *bends, *slopes, *headings;
    const double *series_x, *series_y; /* (terms + 1, pieces) */
    int64_t pieces, terms;
} Pieces;

/* Writes x, y, heading and curvature (4, count) at stations. */
INLINE void any_evaluate(int64_t count, const double *restrict station, const Pieces *p, double *restrict result)
{
    const double *restrict series_x = p->series_x, *restrict series_y = p->series_y;
    int64_t at = 0;
    for (int64_t i = 0; i < count; i++) {
        const double s = station[i];
        /* The number of borders that aren't above it; neighbours mostly lie on one piece. */
        if (!((at == 0 || p->borders[at - 1] <= s) && (at == p->pieces - 1 || s < p->borders[at]))) {
            int64_t low = 0, high = p->pieces - 1;
            while (low < high) {
                const int64_t middle = (low + high) / 2;
                if (s < p->borders[middle])
                    high = middle;
                else
                    low = middle + 1;
            }
            at = low;
        }
        const double u = s - p->middles[at], v = u / p->halves[at];
        double x = series_x[p->terms * p->pieces + at], y = series_y[p->terms * p->pieces + at];
        for (int64_t n = p->terms - 1; n >= 0; n--) {
            x = x * v + series_x[n * p->pieces + at];
            y = y * v + series_y[n * p->pieces + at];
        }
        const double bend = p->bends[at], slope = p->slopes[at] * u;
        result[i] = x;
        result[count + i] = y;
        result[2 * count + i] = p->headings[at] + u * (bend + 0.5 * slope);
        result[3 * count + i] = bend + slope;
    }
}

EXPORT_WIDE(void, evaluate, (int64_t count, const double *station, const Pieces *pieces, double *result),
            (count, station, pieces, result))

/* Feet of points on an alignment that are still sought; as `_Feet` in points.py. */
typedef struct {
    const double *x, *y;                  /* of all points, as what follows */
    double *station, *low, *high;         /* of feet, and within which they are */
    double *along, *offset;
    int64_t *active;                      /* (count) points whose feet are sought, ascending */
    const double *px, *py, *cosine, *sine, *bend; /* (count) of the axis at their stations, as what follows */
    double *turn, *lever;                 /* for the angle at the centre of the circle of curvature */
} Feet;

/* Measures from the axis, and narrows the brackets. */
INLINE void any_measure(int64_t count, const Feet *f)
{
    for (int64_t i = 0; i < count; i++) {
        const int64_t at = f->active[i];
        const double dx = f->x[at] - f->px[i], dy = f->y[at] - f->py[i], s = f->station[at];
        const double g = dx * f->cosine[i] + dy * f->sine[i], d = dy * f->cosine[i] - dx * f->sine[i];
        f->along[at] = g;
        f->offset[at] = d;
        f->low[at] = g > 0.0 ? s : f->low[at];
        f->high[at] = g < 0.0 ? s : f->high[at];
        f->turn[i] = f->bend[i] * g;
        f->lever[i] = 1.0 - f->bend[i] * d;
    }
}

EXPORT_WIDE(void, measure, (int64_t count, const Feet *feet), (count, feet))

/* Steps to where the feet seem to be, by the angles (count); returns how many are still sought, which come first. */
INLINE int64_t any_step(int64_t count, const Feet *f, const double *restrict angle)
{
    int64_t left = 0;
    for (int64_t i = 0; i < count; i++) {
        const int64_t at = f->active[i];
        const double s = f->station[at], turn = f->turn[i], low = f->low[at], high = f->high[at];
        const double arc = __builtin_fabs(turn) > 1e-9 ? angle[i] / f->bend[i] : f->along[at] / f->lever[i];
        double target = s + arc;
        target = target >= low && target <= high ? target : 0.5 * (low + high);
        f->station[at] = target;
        if (__builtin_fabs(target - s) > 1e-7)
            f->active[left++] = at;
    }
    return left;
}

EXPORT_WIDE(int64_t, step, (int64_t count, const Feet *feet, const double *angle), (count, feet, angle))

/* Lists, for points one after the other, which nodes of an axis, all about a middle, may be next to their feet: those
 * at a local minimum of distance that lies within `spacing` of the least. Returns their number. `square`: (nodes). */
INLINE int64_t any_candidates(int64_t count, const double *restrict x, const double *restrict y, int64_t nodes,
                              const double *restrict node_x, const double *restrict node_y, const double *middle,
                              double spacing, double *restrict square, int64_t *restrict owner,
                              int64_t *restrict column)
{
    int64_t found = 0;
    for (int64_t i = 0; i < count; i++) {
        const double px = x[i] - middle[0], py = y[i] - middle[1], length = px * px + py * py;
        double least = __builtin_inf();
        for (int64_t k = 0; k < nodes; k++) { /* less the point's own part, which is the same for all */
            const double qx = node_x[k] - middle[0], qy = node_y[k] - middle[1];
            square[k] = px * (-2.0 * qx) + py * (-2.0 * qy) + (qx * qx + qy * qy);
            least = square[k] < least ? square[k] : least;
        }
        const double from = least + length > 0.0 ? least + length : 0.0, reach = __builtin_sqrt(from) + spacing;
        const double bound = reach * reach - length;
        for (int64_t k = 0; k < nodes; k++) {
            const int falls = k == 0 || square[k] < square[k - 1];
            const int rises = k == nodes - 1 || !(square[k + 1] < square[k]);
            if (square[k] <= bound && falls && rises) {
                owner[found] = i;
                column[found++] = k;
            }
        }
    }
    return found;
}

EXPORT_WIDE(int64_t, candidates,
            (int64_t count, const double *x, const double *y, int64_t nodes, const double *node_x,
             const double *node_y, const double *middle, double spacing, double *square, int64_t *owner,
             int64_t *column),
            (count, x, y, nodes, node_x, node_y, middle, spacing, square, owner, column))
