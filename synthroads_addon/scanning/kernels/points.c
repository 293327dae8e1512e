/* What is worked out for each point after it was met: where its light comes from and goes to, where on its triangle it
 * lies, what is raised below it. NumPy's code is the reference, operation by operation:
 *   colour.colour.SeenPoints.towards_scanner, colour.reflection.reflected_sunlight,
 *   scene.surface_values.corner_shares and _interpolate, relief.micro_relief.shift_by_relief; more in loops/.
 *
 * What needs a power or an angle, and products by linear algebra, are NumPy's and given.
 */
#include "kernel.h"
#include "loops/axis.h"
#include "loops/columns.h"
#include "loops/placed.h"
#include "loops/records.h"

INLINE float larger(float a, float b)
{
    return a >= b || a != a ? a : b;
}

INLINE float smaller(float a, float b)
{
    return a <= b || a != a ? a : b;
}

INLINE float within(float value, float low, float high)
{
    return smaller(larger(value, low), high);
}

/* Writes unit vectors (count, 3) from places to where they were seen from (count, 3). */
INLINE void any_towards(int64_t count, const double *restrict place, const double *restrict seen_from,
                        float *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const float x = (float)(seen_from[3 * i] - place[3 * i]), y = (float)(seen_from[3 * i + 1] - place[3 * i + 1]);
        const float z = (float)(seen_from[3 * i + 2] - place[3 * i + 2]);
        const float length = larger(__builtin_sqrtf(x * x + y * y + z * z), 1e-9f);
        result[3 * i] = x / length;
        result[3 * i + 1] = y / length;
        result[3 * i + 2] = z / length;
    }
}

EXPORT_WIDE(void, towards, (int64_t count, const double *place, const double *seen_from, float *result),
            (count, place, seen_from, result))

/* Writes the cosines of the view, of the half vector to the normal, and of it to the view; `normal`, `view`: (count, 3).
 */
INLINE void any_halves(int64_t count, const float *restrict normal, const float *restrict view,
                       const float *restrict sun, float *restrict seen, float *restrict across, float *restrict between)
{
    for (int64_t i = 0; i < count; i++) {
        const float *n = normal + 3 * i, *v = view + 3 * i;
        float x = v[0] + sun[0], y = v[1] + sun[1], z = v[2] + sun[2];
        const float length = larger(__builtin_sqrtf(x * x + y * y + z * z), 1e-6f);
        x /= length, y /= length, z /= length;
        seen[i] = within(n[0] * v[0] + n[1] * v[1] + n[2] * v[2], 1e-4f, 1.0f);
        across[i] = within(n[0] * x + n[1] * y + n[2] * z, 0.0f, 1.0f);
        between[i] = v[0] * x + v[1] * y + v[2] * z;
    }
}

EXPORT_WIDE(void, halves,
            (int64_t count, const float *normal, const float *view, const float *sun, float *seen, float *across,
             float *between),
            (count, normal, view, sun, seen, across, between))

/* Tables of albedos; as `_Tables` in points.py. */
typedef struct {
    const float *once;      /* (rough, view) */
    const float *albedo;    /* (rough, view, level) */
    const double *average;  /* (rough) */
    int64_t roughs, views, levels;
    float first[3], scale[3]; /* of roughness, cosine of the view and root of the reflectance */
    float matt;             /* reflectance at a right angle of a specular of 1 */
    float brightest;        /* largest reflectance at a right angle */
} Tables;

/* Surfaces, (count) each but colours (count, 3). */
typedef struct {
    const float *color, *rough, *square, *metallic, *specular; /* `square`: fourth powers of roughnesses */
    const float *sun, *seen, *across, *between;                /* cosines */
    const float *rise;                                         /* fifth powers for Fresnel's reflectance of metals */
} Surfaces;

INLINE float smith(float square, float cosine)
{
    const float squared = larger(cosine * cosine, 1e-9f);
    return 0.5f * (__builtin_sqrtf(1.0f + square * (1.0f - squared) / squared) - 1.0f);
}

/* The step of a grid below a value, and how far it is to the next; 0 for what is no number. */
INLINE int64_t grid_step(float value, float first, float scale, int64_t last, float *share, int *none)
{
    const float scaled = within((value - first) * scale, 0.0f, (float)last);
    *none |= scaled != scaled;
    int64_t low = scaled > 0.0f ? (int32_t)scaled : 0;
    low = low < last - 1 ? low : last - 1;
    *share = (float)((double)scaled - (double)low);
    return low;
}

INLINE float bilinear(const float *table, int64_t entry, int64_t levels, int64_t row, float u, float v)
{
    const float low = table[entry] * (1.0f - v) + table[entry + levels] * v;
    const float high = table[entry + row] * (1.0f - v) + table[entry + (row + levels)] * v;
    return low * (1.0f - u) + high * u;
}

INLINE float compensation(float mean, float once, float average)
{
    const float missing = (1.0f - once) / once;
    return 1.0f + missing * mean * mean * average / (1.0f - mean * (1.0f - average));
}

/* Writes light (count, 3) that surfaces throw back; returns whether any place in the tables is none. */
INLINE int any_reflected(int64_t count, const Tables *t, const Surfaces *s, float *restrict result)
{
    const float *restrict color = s->color;
    int none = 0;
    for (int64_t i = 0; i < count; i++) {
        const float square = s->square[i], sun = s->sun[i], seen = s->seen[i], metallic = s->metallic[i];
        const float spread = s->across[i] * s->across[i] * (square - 1.0f) + 1.0f;
        const float distribution = square / (spread * spread);
        const float shadow = 1.0f / (1.0f + smith(square, sun) + smith(square, seen));
        const float gloss = sun > 0.0f ? distribution * shadow / (4.0f * seen) : 0.0f;

        float u, v, w;
        const int64_t of_rough = grid_step(s->rough[i], t->first[0], t->scale[0], t->roughs - 1, &u, &none);
        const int64_t of_view = grid_step(seen, t->first[1], t->scale[1], t->views - 1, &v, &none);
        const int64_t entry = of_rough * t->views + of_view;
        const float once = bilinear(t->once, entry, 1, t->views, u, v);
        const float average =
            (float)(t->average[of_rough] * (double)(1.0f - u) + t->average[of_rough + 1] * (double)u);

        const float level = smaller(t->matt * s->specular[i], t->brightest), root = __builtin_sqrtf(level);
        const int64_t of_level = grid_step(root, t->first[2], t->scale[2], t->levels - 1, &w, &none);
        const int64_t deep = entry * t->levels + of_level, row = t->views * t->levels;
        const float below = bilinear(t->albedo, deep, t->levels, row, u, v);
        const float above = bilinear(t->albedo, deep + 1, t->levels, row, u, v);
        const float albedo = below * (1.0f - w) + above * w;

        const float eta = (1.0f + root) / (1.0f - root), c = within(s->between[i], 0.0f, 1.0f);
        const float mean = level > 0.0f ? (eta - 1.0f) / (4.08567f + 1.00071f * eta) : 0.0f;
        const float g = __builtin_sqrtf(larger(eta * eta - 1.0f + c * c, 1e-12f));
        const float a = (g - c) / (g + c), b = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
        const float dielectric = level > 0.0f ? 0.5f * a * a * (1.0f + b * b) : 0.0f;

        const float share = (1.0f - metallic) * gloss * dielectric * compensation(mean, once, average);
        const float matt = (1.0f - metallic) * (1.0f - albedo) * sun;
        for (int j = 0; j < 3; j++) {
            const float base = color[3 * i + j];
            float light = base * matt + share;
            if (metallic > 0.0f) {
                const float fresnel = base + (1.0f - base) * s->rise[i], whole = base + (1.0f - base) / 21.0f;
                light += metallic * gloss * fresnel * compensation(whole, once, average);
            }
            result[3 * i + j] = light;
        }
    }
    return none;
}

EXPORT_WIDE(int, reflected, (int64_t count, const Tables *tables, const Surfaces *surfaces, float *result),
            (count, tables, surfaces, result))

/* Writes values (chosen, width) of points: their own where their material varies, else those of the material. `rows`:
 * of the points, or none for all; `own`: (points, width), or none; `means`: (materials, width). */
INLINE void any_layer(int64_t chosen, const int64_t *restrict rows, int64_t width, const float *restrict own,
                      const uint16_t *restrict material, const uint8_t *restrict varies, const float *restrict means,
                      float *restrict result)
{
    for (int64_t i = 0; i < chosen; i++) {
        const int64_t at = rows ? rows[i] : i, kind = material[at];
        const float *from = own && varies[kind] ? own + at * width : means + kind * width;
        for (int64_t j = 0; j < width; j++)
            result[i * width + j] = from[j];
    }
}

EXPORT_WIDE(void, layer,
            (int64_t chosen, const int64_t *rows, int64_t width, const float *own, const uint16_t *material,
             const uint8_t *varies, const float *means, float *result),
            (chosen, rows, width, own, material, varies, means, result))

#define LARGEST 1.7976931348623157e308

/* Sums of products in the order that NumPy's einsum has for three numbers. */
INLINE double product(const double *a, const double *b)
{
    return a[0] * b[0] + a[2] * b[2] + a[1] * b[1];
}

INLINE double share_of(double value)
{
    if (value != value)
        return 1.0 / 3.0;
    value = value > LARGEST ? LARGEST : value;
    return value > 0.0 ? value : 0.0;
}

/* Writes the weights (count, 3) of the corners of `faces` (count) at places (count, 3). */
INLINE void any_shares(int64_t count, const float *restrict vertices, const int32_t *restrict triangles,
                       const int64_t *restrict faces, const double *restrict place, double *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const int32_t *corner = triangles + 3 * faces[i];
        double u[3], v[3], w[3];
        for (int j = 0; j < 3; j++) {
            const double a = vertices[3 * (int64_t)corner[0] + j];
            u[j] = vertices[3 * (int64_t)corner[1] + j] - a;
            v[j] = vertices[3 * (int64_t)corner[2] + j] - a;
            w[j] = place[3 * i + j] - a;
        }
        const double uu = product(u, u), uv = product(u, v), vv = product(v, v), wu = product(w, u), wv = product(w, v);
        const double below = uu * vv - uv * uv;
        const double second = (vv * wu - uv * wv) / below, third = (uu * wv - uv * wu) / below;
        const double share[3] = {share_of(1.0 - second - third), share_of(second), share_of(third)};
        double sum = share[0] + share[1] + share[2];
        sum = sum > 1e-30 ? sum : 1e-30;
        for (int j = 0; j < 3; j++)
            result[3 * i + j] = share[j] / sum;
    }
}

EXPORT_WIDE(void, shares,
            (int64_t count, const float *vertices, const int32_t *triangles, const int64_t *faces, const double *place,
             double *result),
            (count, vertices, triangles, faces, place, result))

/* Writes values (4 each) between the corners of triangles into the rows `rows` (count) of `result`. `elements`: (T, 3)
 * rows of `values`; `mirrored`: by place that the mesh stands at, `use` (count); `shares`: of the rows, (N, 3). */
INLINE void any_interpolate(int64_t count, const int64_t *restrict rows, const int64_t *restrict use,
                            const int64_t *restrict triangle, const int32_t *restrict elements,
                            const uint8_t *restrict mirrored, const double *restrict shares,
                            const float *restrict values, float *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const int32_t *element = elements + 3 * triangle[i];
        const double *share = shares + 3 * rows[i];
        const double second = share[1], third = mirrored[use[i]] ? share[0] : share[2];
        const float *a = values + 4 * (int64_t)element[0], *b = values + 4 * (int64_t)element[1];
        const float *c = values + 4 * (int64_t)element[2];
        for (int j = 0; j < 4; j++) {
            const double first = a[j];
            double sum = first;
            sum += second * ((double)b[j] - first);
            sum += third * ((double)c[j] - first);
            result[4 * rows[i] + j] = (float)sum;
        }
    }
}

EXPORT_WIDE(void, interpolate,
            (int64_t count, const int64_t *rows, const int64_t *use, const int64_t *triangle, const int32_t *elements,
             const uint8_t *mirrored, const double *shares, const float *values, float *result),
            (count, rows, use, triangle, elements, mirrored, shares, values, result))

/* Writes places (count, 3) and ranges (count) shifted along normals by heights (count), 0 for those that stay. */
INLINE void any_raise(int64_t count, const double *restrict height, const double *restrict cosine,
                      const float *restrict normal, const double *restrict place, const double *restrict range,
                      double *restrict raised, double *restrict distance)
{
    for (int64_t i = 0; i < count; i++) {
        const double h = height[i], before = range[i];
        const int stays = h == 0.0;
        const double after = __builtin_sqrt(before * before - 2.0 * before * h * cosine[i] + h * h);
        distance[i] = stays ? before : after;
        for (int j = 0; j < 3; j++) {
            const double moved = place[3 * i + j] + h * (double)normal[3 * i + j];
            raised[3 * i + j] = stays ? place[3 * i + j] : moved;
        }
    }
}

EXPORT_WIDE(void, raise,
            (int64_t count, const double *height, const double *cosine, const float *normal, const double *place,
             const double *range, double *raised, double *distance),
            (count, height, cosine, normal, place, range, raised, distance))

/* Writes places (count, 3) and ranges (count) of which `rough` (chosen, ascending) are nearer along their beams, by
 * heights and cosines (chosen). `reach`: by material, within which a beam that grazes the relief meets some peak, m. */
INLINE void any_approach(int64_t count, int64_t chosen, const int64_t *restrict rough, const double *restrict height,
                         const double *restrict cosine, const uint16_t *restrict material,
                         const double *restrict reach, const float *restrict towards, const double *restrict place,
                         const double *restrict range, double *restrict moved, double *restrict distance)
{
    int64_t next = 0;
    for (int64_t i = 0; i < count; i++) {
        double nearer = 0.0;
        if (next < chosen && rough[next] == i) {
            const double h = height[next], c = cosine[next];
            double least = __builtin_sqrt(1.0 - c * c);
            least *= __builtin_fabs(h);
            least /= reach[material[i]];
            nearer = h / (c >= least || c != c ? c : least);
            next++;
        }
        distance[i] = range[i] - nearer;
        for (int j = 0; j < 3; j++)
            moved[3 * i + j] = nearer * (double)towards[3 * i + j] + place[3 * i + j];
    }
}

EXPORT_WIDE(void, approach,
            (int64_t count, int64_t chosen, const int64_t *rough, const double *height, const double *cosine,
             const uint16_t *material, const double *reach, const float *towards, const double *place,
             const double *range, double *moved, double *distance),
            (count, chosen, rough, height, cosine, material, reach, towards, place, range, moved, distance))


/* Writes light (count, 3), cut to 0 to 1: what the sun gives and what surfaces of these colours (count, 3) throw back of
 * the sky by their normals (count, 3). */
INLINE void any_daylight(int64_t count, const float *restrict sun, const float *restrict color,
                         const float *restrict normal, const float *restrict above, const float *restrict below,
                         float *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const float share = (1.0f + normal[3 * i + 2]) / 2.0f, rest = 1.0f - share;
        for (int j = 0; j < 3; j++) {
            const float sky = share * above[j] + rest * below[j];
            result[3 * i + j] = within(sun[3 * i + j] + color[3 * i + j] * sky, 0.0f, 1.0f);
        }
    }
}

EXPORT_WIDE(void, daylight,
            (int64_t count, const float *sun, const float *color, const float *normal, const float *above,
             const float *below, float *result),
            (count, sun, color, normal, above, below, result))

/* Writes 16-bit sRGB of linear values of 0 to 1; `power`: these to the power of 1 / 2.4. */
INLINE void any_encode(int64_t count, const float *restrict linear, const float *restrict power,
                       uint16_t *restrict result)
{
    for (int64_t i = 0; i < count; i++) {
        const float curve = 1.055f * power[i] - 0.055f;
        const float encoded = (linear[i] <= 0.0031308f ? 12.92f * linear[i] : curve) * 65535.0f + 0.5f;
        result[i] = (uint16_t)(int32_t)(encoded == encoded ? encoded : 0.0f);
    }
}

EXPORT_WIDE(void, encode, (int64_t count, const float *linear, const float *power, uint16_t *result),
            (count, linear, power, result))

/* Writes values (chosen, width) into rows of `result`, each component times its `scale` (width) if there is one. */
INLINE void any_spread(int64_t chosen, int64_t width, const int64_t *restrict rows, const float *restrict values,
                       const float *restrict scale, float *restrict result)
{
    for (int64_t i = 0; i < chosen; i++)
        for (int64_t j = 0; j < width; j++) {
            const float value = values[i * width + j];
            result[rows[i] * width + j] = scale ? value * scale[j] : value;
        }
}

EXPORT_WIDE(void, spread,
            (int64_t chosen, int64_t width, const int64_t *rows, const float *values, const float *scale,
             float *result),
            (chosen, width, rows, values, scale, result))

/* Writes vectors (chosen, 3) of rows of `source` into the first three of four numbers each; with a `shift` (3), what that
 * makes of them in this unit. */
INLINE void any_inputs(int64_t chosen, const int64_t *restrict rows, const double *restrict source,
                       const double *restrict shift, double unit, float *restrict result)
{
    for (int64_t i = 0; i < chosen; i++) {
        for (int j = 0; j < 3; j++) {
            const double value = source[3 * rows[i] + j];
            result[4 * i + j] = (float)(shift ? (value + shift[j]) / unit : value);
        }
        result[4 * i + 3] = 0.0f;
    }
}

EXPORT_WIDE(void, inputs,
            (int64_t chosen, const int64_t *rows, const double *source, const double *shift, double unit,
             float *result),
            (chosen, rows, source, shift, unit, result))
