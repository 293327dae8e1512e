/* Faces by the columns towards the sun that they lie in, and the places that nothing in their column can shade. */
#include "../kernel.h"

/* Columns side by side, a grid across a direction; as `_Columns` in points.py. Lengths are in cells of the grid but for
 * those of places and planes. */
typedef struct {
    double axes[6];     /* two vectors across the direction, over the cells' width */
    double low[2];      /* of the grid, along these */
    int64_t columns[2];
    double margin;      /* by which faces and edges are wider than they are */
    double direction[3];
    double above;       /* how far from a face's plane a place surely is on one of its sides, m */
} Columns;

/* The cells that an interval along one of the axes touches. */
INLINE void cells_between(double low, double high, int64_t count, int64_t *first, int64_t *last)
{
    *first = low > 0.0 ? (low < (double)count ? (int64_t)low : count) : 0;
    *last = high < (double)count ? (high >= 0.0 ? (int64_t)high : -1) : count - 1;
}

INLINE void place_in_grid(const Columns *grid, const double *place, double *at)
{
    for (int k = 0; k < 2; k++) {
        const double *axis = grid->axes + 3 * k;
        at[k] = axis[0] * place[0] + axis[1] * place[1] + axis[2] * place[2] - grid->low[k];
    }
}

/* A face as it is seen in the grid: its corners, and for each edge a normal inwards and where what is inside begins. */
typedef struct {
    double at[3][2], normal[3][2], bound[3];
} Outline;

INLINE void see_face(const Columns *grid, const float *restrict vertices, const int32_t *corners, Outline *seen)
{
    for (int j = 0; j < 3; j++) {
        const float *vertex = vertices + 3 * (int64_t)corners[j];
        const double place[3] = {vertex[0], vertex[1], vertex[2]};
        place_in_grid(grid, place, seen->at[j]);
    }
    const double(*at)[2] = (const double(*)[2])seen->at;
    const double one = (at[1][0] - at[0][0]) * (at[2][1] - at[0][1]), other = (at[2][0] - at[0][0]) * (at[1][1] - at[0][1]);
    const double side = one < other ? -1.0 : 1.0;
    for (int j = 0; j < 3; j++) {
        const double *a = at[j], *b = at[(j + 1) % 3];
        const double x = side * (a[1] - b[1]), y = side * (b[0] - a[0]);
        seen->normal[j][0] = x;
        seen->normal[j][1] = y;
        seen->bound[j] = x * a[0] + y * a[1] - grid->margin * (__builtin_fabs(x) + __builtin_fabs(y));
    }
}

/* Adds the faces to the cells that they touch, or may: to `counts` (cells), or into the room that `starts` (cells + 1)
 * leaves for each in `list`, by what of it is `filled` (cells). */
INLINE void any_sort_faces(const Columns *grid, int64_t faces, const float *restrict vertices,
                           const int32_t *restrict triangles, uint32_t *restrict counts,
                           const uint32_t *restrict starts, uint8_t *restrict filled, int32_t *restrict list)
{
    for (int64_t face = 0; face < faces; face++) {
        Outline seen;
        int64_t first[2], last[2];
        see_face(grid, vertices, triangles + 3 * face, &seen);
        for (int k = 0; k < 2; k++) {
            double low = seen.at[0][k], high = low;
            for (int j = 1; j < 3; j++) {
                low = seen.at[j][k] < low ? seen.at[j][k] : low;
                high = seen.at[j][k] > high ? seen.at[j][k] : high;
            }
            cells_between(low - grid->margin, high + grid->margin, grid->columns[k], first + k, last + k);
        }
        for (int64_t row = first[1]; row <= last[1]; row++) {
            for (int64_t column = first[0]; column <= last[0]; column++) {
                const int64_t cell = row * grid->columns[0] + column;
                int outside = 0;
                for (int j = 0; j < 3; j++) { /* by the corner of the cell that is farthest inside */
                    const double x = (double)(column + (seen.normal[j][0] > 0.0));
                    const double y = (double)(row + (seen.normal[j][1] > 0.0));
                    outside |= seen.normal[j][0] * x + seen.normal[j][1] * y < seen.bound[j];
                }
                if (outside)
                    continue;
                if (counts)
                    counts[cell]++;
                else if (filled[cell] < starts[cell + 1] - starts[cell])
                    list[starts[cell] + filled[cell]++] = (int32_t)face;
            }
        }
    }
}

EXPORT_WIDE(void, sort_faces,
            (const Columns *grid, int64_t faces, const float *vertices, const int32_t *triangles, uint32_t *counts,
             const uint32_t *starts, uint8_t *filled, int32_t *list),
            (grid, faces, vertices, triangles, counts, starts, filled, list))

/* Whether a place (in the grid `at`) isn't surely beyond a face's plane, and not surely beside it either. */
INLINE int may_hide(const Columns *grid, const float *restrict vertices, const int32_t *corners, const double *plane,
                    const double *place, const double *at)
{
    double towards = 0.0, height = -plane[3];
    for (int k = 0; k < 3; k++) {
        towards += plane[k] * grid->direction[k];
        height += plane[k] * place[k];
    }
    if ((towards < 0.0 ? -height : height) > grid->above)
        return 0;
    Outline seen;
    int beside = 0;
    see_face(grid, vertices, corners, &seen);
    for (int j = 0; j < 3; j++)
        beside |= seen.normal[j][0] * at[0] + seen.normal[j][1] * at[1] < seen.bound[j];
    return !beside;
}

/* Writes which places (3, count) lie in a column of which faces are listed and have none of these towards the sun. */
INLINE void any_clear(const Columns *grid, int64_t count, const double *restrict places,
                      const float *restrict vertices, const int32_t *restrict triangles,
                      const double *restrict planes, const uint32_t *restrict starts, const int32_t *restrict list,
                      uint8_t *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const double place[3] = {places[i], places[count + i], places[2 * count + i]};
        double at[2];
        place_in_grid(grid, place, at);
        result[i] = 0;
        if (!(at[0] >= 0.0 && at[1] >= 0.0 && at[0] < (double)grid->columns[0] && at[1] < (double)grid->columns[1]))
            continue;
        const int64_t cell = (int64_t)at[1] * grid->columns[0] + (int64_t)at[0];
        const uint32_t begin = starts[cell], end = starts[cell + 1];
        uint32_t next = begin;
        while (next < end) {
            const int64_t face = list[next];
            if (may_hide(grid, vertices, triangles + 3 * face, planes + 4 * face, place, at))
                break;
            next++;
        }
        result[i] = begin < end && next == end;
    }
}

EXPORT_WIDE(void, clear,
            (const Columns *grid, int64_t count, const double *places, const float *vertices, const int32_t *triangles,
             const double *planes, const uint32_t *starts, const int32_t *list, uint8_t *result),
            (grid, count, places, vertices, triangles, planes, starts, list, result))
