/* Voronoi cells. */
#pragma once

#include "noise.h"

/* Voronoi cells, lane by lane. */

enum { F1, F2, SMOOTH_F1, TO_EDGE, RADIUS };
enum { EUCLIDEAN, MANHATTAN, CHEBYCHEV, MINKOWSKI };
#define VERY_FAR 3.402823466e+38f

typedef struct {
    int dimensions, of_floats, feature, metric, normalized;
    float detail, roughness, lacunarity, smoothness, exponent, randomness;
} Cells;

typedef struct {
    float distance, color[3], position[4];
} Cell;

/* The place of a cell's point in it, from 0 to 1, by Jenkins' hash of floats. */
static void point_of_floats(const int32_t *cell, int dimensions, float *place)
{
    uint32_t v[4] = {0, 0, 0, 0};
    for (int k = 0; k < dimensions; k++)
        v[k] = bits_of((float)cell[k]);
    if (dimensions == 2) {
        place[0] = share(hash2(v[0], v[1]));
        place[1] = share(hash3(v[0], v[1], bits_of(1.0f)));
    } else if (dimensions == 3) {
        place[0] = share(hash3(v[0], v[1], v[2]));
        place[1] = share(hash4(v[0], v[1], v[2], bits_of(1.0f)));
        place[2] = share(hash4(v[0], v[1], v[2], bits_of(2.0f)));
    } else {
        place[0] = share(hash4(v[0], v[1], v[2], v[3]));
        place[1] = share(hash4(v[3], v[0], v[1], v[2]));
        place[2] = share(hash4(v[2], v[3], v[0], v[1]));
        place[3] = share(hash4(v[1], v[2], v[3], v[0]));
    }
}

/* The same by the hash PCG; in one dimension by Jenkins'. */
static void point_in(const int32_t *cell, int dimensions, float *place)
{
    if (dimensions == 1) {
        place[0] = share(hash1(bits_of((float)cell[0])));
        return;
    }
    uint32_t v[4];
    for (int k = 0; k < dimensions; k++)
        v[k] = (uint32_t)cell[k] * 1664525u + 1013904223u;
    for (int round = 0; round < 2; round++) {
        if (dimensions == 2) {
            v[0] += v[1] * 1664525u;
            v[1] += v[0] * 1664525u;
        } else {
            v[0] += v[1] * v[dimensions - 1];
            v[1] += v[2] * v[0];
            v[2] += v[0] * v[1];
            if (dimensions == 4)
                v[3] += v[1] * v[2];
        }
        for (int k = 0; k < dimensions && round == 0; k++)
            v[k] ^= (uint32_t)((int32_t)v[k] >> 16);
    }
    for (int k = 0; k < dimensions; k++)
        place[k] = (float)(int32_t)(v[k] & 0x7FFFFFFFu) * (1.0f / 2147483648.0f);
}

static void color_of(const int32_t *cell, const Cells *cells, float *color)
{
    const int dimensions = cells->dimensions;
    if (cells->of_floats && dimensions > 1) {
        uint32_t v[4] = {0, 0, 0, 0};
        for (int k = 0; k < dimensions; k++)
            v[k] = bits_of((float)cell[k]);
        if (dimensions == 3) {
            point_of_floats(cell, 3, color);
            return;
        }
        int flat = dimensions == 2;
        color[0] = share(flat ? hash2(v[0], v[1]) : hash4(v[0], v[1], v[2], v[3]));
        color[1] = share(flat ? hash3(v[0], v[1], bits_of(1.0f)) : hash4(v[2], v[0], v[3], v[1]));
        color[2] = share(flat ? hash3(v[0], v[1], bits_of(2.0f)) : hash4(v[3], v[2], v[1], v[0]));
        return;
    }
    if (dimensions == 1) {
        uint32_t x = bits_of((float)cell[0]);
        color[0] = share(hash1(x));
        color[1] = share(hash2(x, bits_of(1.0f)));
        color[2] = share(hash2(x, bits_of(2.0f)));
        return;
    }
    const int32_t flat[3] = {cell[0], cell[1], 0};
    float four[4];
    point_in(dimensions == 2 ? flat : cell, dimensions == 2 ? 3 : dimensions, four);
    for (int k = 0; k < 3; k++)
        color[k] = four[k];
}

static float squared(const float *a, const float *b, int dimensions)
{
    float sum = 0.0f;
    for (int k = 0; k < dimensions; k++)
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sum;
}

static float between(const float *a, const float *b, const Cells *cells)
{
    if (cells->dimensions == 1)
        return absolute(b[0] - a[0]);
    if (cells->metric == EUCLIDEAN)
        return root(squared(a, b, cells->dimensions));
    float sum = 0.0f, most = 0.0f;
    for (int k = 0; k < cells->dimensions; k++) {
        float side = absolute(a[k] - b[k]);
        sum += cells->metric == MINKOWSKI ? power(side, cells->exponent) : side;
        most = larger(most, side);
    }
    if (cells->metric == MINKOWSKI)
        return power(sum, 1.0f / cells->exponent);
    return cells->metric == MANHATTAN ? sum : most;
}

/* Goes through the cells around one: `at` counts in each direction from -reach to reach, the first one fastest. */
static int next_cell(int32_t *at, int dimensions, int reach)
{
    for (int k = 0; k < dimensions; k++) {
        if (++at[k] <= reach)
            return 1;
        at[k] = -reach;
    }
    return 0;
}

#define AROUND(at, reach)                                                                                              \
    int32_t at[4] = {-(reach), -(reach), -(reach), -(reach)};                                                          \
    int more = 1;                                                                                                      \
    for (; more; more = next_cell(at, n, reach))

/* The cell `at` beside `base` (+ `home`), and its point relative to `base`. */
static void cell_point(const int32_t *base, const int32_t *at, const Cells *cells, int32_t *cell, float *point)
{
    for (int k = 0; k < cells->dimensions; k++)
        cell[k] = (int32_t)((uint32_t)base[k] + (uint32_t)at[k]);
    if (cells->of_floats && cells->dimensions > 1)
        point_of_floats(cell, cells->dimensions, point);
    else
        point_in(cell, cells->dimensions, point);
    for (int k = 0; k < cells->dimensions; k++)
        point[k] = (float)at[k] + point[k] * cells->randomness;
}

static float smooth_step(float x)
{
    return x < 0.0f ? 0.0f : x >= 1.0f ? 1.0f : (3.0f - 2.0f * x) * (x * x);
}

static Cell cell_of(const float *place, const Cells *cells)
{
    const int n = cells->dimensions;
    int32_t base[4], cell[4], nearest[4] = {0, 0, 0, 0}, second[4] = {0, 0, 0, 0};
    float local[4], point[4], first_point[4] = {0, 0, 0, 0}, second_point[4] = {0, 0, 0, 0}, floors[4];
    for (int k = 0; k < n; k++) {
        floors[k] = floored(place[k]);
        base[k] = whole(floors[k]);
        local[k] = place[k] - floors[k];
    }
    Cell result = {0.0f, {0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}};
    float found[4] = {0, 0, 0, 0};
    if (cells->feature == SMOOTH_F1 && cells->smoothness != 0.0f) {
        float h = -1.0f;
        AROUND(at, 2)
        {
            cell_point(base, at, cells, cell, point);
            float distance = between(point, local, cells), color[3];
            h = h == -1.0f ? 1.0f : smooth_step(0.5f + 0.5f * (result.distance - distance) / cells->smoothness);
            float correction = cells->smoothness * h * (1.0f - h);
            result.distance = mix(result.distance, distance, h) - correction;
            correction /= 1.0f + 3.0f * cells->smoothness;
            color_of(cell, cells, color);
            for (int k = 0; k < 3; k++)
                result.color[k] = mix(result.color[k], color[k], h) - correction;
            for (int k = 0; k < n; k++)
                found[k] = mix(found[k], point[k], h) - correction;
        }
    } else {
        int euclidean = cells->feature != F2 && cells->metric == EUCLIDEAN && n > 1;
        float least = VERY_FAR, next = VERY_FAR;
        AROUND(at, 1)
        {
            cell_point(base, at, cells, cell, point);
            float distance = euclidean ? squared(point, local, n) : between(point, local, cells);
            int closest = distance < least, other = !closest && distance < next;
            if (closest)
                next = least, least = distance;
            else if (other)
                next = distance;
            for (int k = 0; k < n; k++) {
                second[k] = closest ? nearest[k] : other ? cell[k] : second[k];
                second_point[k] = closest ? first_point[k] : other ? point[k] : second_point[k];
                nearest[k] = closest ? cell[k] : nearest[k];
                first_point[k] = closest ? point[k] : first_point[k];
            }
        }
        const int take_second = cells->feature == F2;
        result.distance = take_second ? next : euclidean ? root(least) : least;
        color_of(take_second ? second : nearest, cells, result.color);
        for (int k = 0; k < n; k++)
            found[k] = take_second ? second_point[k] : first_point[k];
    }
    for (int k = 0; k < n; k++)
        result.position[n == 1 ? 3 : k] = found[k] + floors[k];
    return result;
}

static float edge_distance(const float *place, const Cells *cells)
{
    const int n = cells->dimensions;
    int32_t base[4], cell[4];
    float local[4], point[4], closest[4] = {0, 0, 0, 0};
    for (int k = 0; k < n; k++) {
        float low = floored(place[k]);
        base[k] = whole(low);
        local[k] = place[k] - low;
    }
    if (n == 1) {
        float points[3];
        for (int32_t k = -1; k <= 1; k++)
            cell_point(base, &k, cells, cell, points + k + 1);
        return smaller(absolute((points[1] + points[0]) / 2.0f - local[0]),
                       absolute((points[1] + points[2]) / 2.0f - local[0]));
    }
    float least = VERY_FAR;
    {
        AROUND(at, 1)
        {
            cell_point(base, at, cells, cell, point);
            float distance = squared(point, local, n);
            int closer = distance < least;
            least = closer ? distance : least;
            for (int k = 0; k < n; k++)
                closest[k] = closer ? point[k] - local[k] : closest[k];
        }
    }
    least = VERY_FAR;
    AROUND(at, 1)
    {
        float size = 0.0f, along = 0.0f;
        cell_point(base, at, cells, cell, point);
        for (int k = 0; k < n; k++) {
            point[k] -= local[k];
            size += (point[k] - closest[k]) * (point[k] - closest[k]);
        }
        if (size > 0.0001f) {
            size = root(size);
            for (int k = 0; k < n; k++)
                along += (closest[k] + point[k]) / 2.0f * ((point[k] - closest[k]) / size);
            least = smaller(least, along);
        }
    }
    return least;
}

static float cell_radius(const float *place, const Cells *cells)
{
    const int n = cells->dimensions;
    int32_t base[4], cell[4], home[4] = {0, 0, 0, 0}, beside[4];
    float local[4], point[4], closest[4] = {0, 0, 0, 0}, neighbour[4] = {0, 0, 0, 0}, least = VERY_FAR;
    for (int k = 0; k < n; k++) {
        float low = floored(place[k]);
        base[k] = whole(low);
        local[k] = place[k] - low;
    }
    {
        AROUND(at, 1)
        {
            cell_point(base, at, cells, cell, point);
            float distance = squared(point, local, n);
            if (distance < least) {
                least = distance;
                for (int k = 0; k < n; k++)
                    closest[k] = point[k], home[k] = at[k];
            }
        }
    }
    least = VERY_FAR;
    AROUND(at, 1)
    {
        int32_t any = 0;
        for (int k = 0; k < n; k++) {
            any |= at[k];
            beside[k] = at[k] + home[k];
        }
        if (!any)
            continue;
        cell_point(base, beside, cells, cell, point);
        float distance = squared(closest, point, n);
        if (distance < least) {
            least = distance;
            for (int k = 0; k < n; k++)
                neighbour[k] = point[k];
        }
    }
    return root(squared(neighbour, closest, n)) / 2.0f;
}

/* Octaves of cells. Writes distance (or radius), colour and position. */
static void voronoi(const float *place, const Cells *cells, float *result)
{
    const int n = cells->dimensions, edges = cells->feature == TO_EDGE;
    Cell sum = {0.0f, {0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}};
    const float half = 0.5f + 0.5f * cells->randomness, zero[4] = {0, 0, 0, 0}, corner[4] = {half, half, half, half};
    if (cells->feature == RADIUS) {
        sum.distance = cell_radius(place, cells);
    } else {
        float farthest = edges ? half : between(zero, corner, cells) * (cells->feature == F2 ? 2.0f : 1.0f);
        float amplitude = 1.0f, scale = 1.0f, most = edges ? farthest : 0.0f, rest = cells->detail - floored(cells->detail);
        sum.distance = edges ? 8.0f : 0.0f;
        int alone = cells->detail == 0.0f || cells->roughness == 0.0f;
        for (int number = 0; (float)number <= ceiled(cells->detail); number++) {
            float scaled[4];
            for (int k = 0; k < n; k++)
                scaled[k] = place[k] * scale;
            Cell octave = {0.0f, {0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f, 0.0f}};
            if (edges)
                octave.distance = edge_distance(scaled, cells);
            else
                octave = cell_of(scaled, cells);
            if (alone) {
                sum = octave;
                most = edges ? most : 1.0f;
                break;
            }
            int last = (float)number > cells->detail;
            if (last && rest == 0.0f)
                break;
            if (edges) {
                float above = mix(most, farthest / scale, amplitude);
                float distance = mix(sum.distance, smaller(sum.distance, octave.distance / scale), amplitude);
                most = last ? mix(most, above, rest) : above;
                sum.distance = last ? mix(sum.distance, smaller(sum.distance, distance), rest) : distance;
            } else {
                Cell next = sum;
                next.distance += octave.distance * amplitude;
                for (int k = 0; k < 3; k++)
                    next.color[k] += octave.color[k] * amplitude;
                for (int k = 0; k < 4; k++)
                    next.position[k] = mix(sum.position[k], octave.position[k] / scale, amplitude);
                most = last ? mix(most, most + amplitude, rest) : most + amplitude;
                sum.distance = last ? mix(sum.distance, next.distance, rest) : next.distance;
                for (int k = 0; k < 3; k++)
                    sum.color[k] = last ? mix(sum.color[k], next.color[k], rest) : next.color[k];
                for (int k = 0; k < 4; k++)
                    sum.position[k] = last ? mix(sum.position[k], next.position[k], rest) : next.position[k];
            }
            scale *= cells->lacunarity;
            amplitude *= cells->roughness;
        }
        if (cells->normalized) {
            sum.distance /= edges ? most : most * farthest;
            for (int k = 0; k < 3; k++)
                sum.color[k] = edges ? sum.color[k] : sum.color[k] / most;
        }
    }
    result[0] = sum.distance;
    for (int k = 0; k < 3; k++)
        result[(1 + k) * LANES] = sum.color[k];
    for (int k = 0; k < 4; k++)
        result[(4 + k) * LANES] = sum.position[k];
}
