/* What a block's pulses meet and send back: rays made, cast, placed on the planes of faces, followed through what lets
 * light pass, weighed and grouped into returns. The arithmetic of scanning/trace.py, scanning/scene and
 * scanning/returns.py in the very order in which NumPy does it there, so that the results are the same bytes. What
 * needs exp or arccos is left to NumPy, between `synthroads_first`, `synthroads_behind` and `synthroads_group`.
 * Where more is asked of rays before they are weighed, whether they meet what moves (moving.c), or what clear materials
 * let through, they are cast and weighed one after the other: `synthroads_cast_first` and `synthroads_weigh_first`.
 */
#include "rays.h"

#define CORNERS 4

/* What is scanned and how, the same for all blocks; as `_Scene` in pulses.py. */
typedef struct {
    Cast cast;
    void *scene;
    const Shape *shape;
    const double *planes;                              /* (faces, 4) of what doesn't move */
    const uint16_t *material;                          /* of all faces */
    const double *reflectivity, *facet_a, *facet_b;    /* (M) of materials, as all that follow */
    const double *transmission, *open_below, *gap_size;
    const uint8_t *pervious, *gappy, *shining, *clear;
    const double *corners;                             /* (CORNERS, 3) */
    double frame[3], gap_area;
    uint32_t gap_key;
    int32_t gaps, open;                                /* whether leaves and gaps are told apart; any is, or panes are */
    double nearest, farthest, attenuation;
    double faintest, beyond, beyond_clear, edge_on, closest, least_reflectance;
    float limit;
} Scene;

/* Hits whose surface sends light back the way that it came; as `ShiningHits` in hits.py. NumPy adds what they do. */
typedef struct {
    int64_t *hit;
    double *cosine, *brightness, *share; /* brightness: without it */
    uint16_t *material;
} Shining;

/* Light that goes on behind surfaces; as `Passed` in hits.py. `face`, `step`: NULL where nothing is clear in places. */
typedef struct {
    int64_t *ray; /* k * P + p */
    double *left, *start, *step;
    int32_t *face;
} Passed;

/* Hits, (K, P) or (N); as `Met` in hits.py. `fading`: the exponent of what the air leaves. `along` is NULL where
 * rays are weighed as they are cast, `share`, of the energy that a surface takes, where it isn't asked for. */
typedef struct {
    int32_t *face;
    double *distance, *intensity, *weight, *fading, *along, *share;
} Met;

/* Hits behind surfaces, (N) at most; as `Behind` in hits.py. */
typedef struct {
    int64_t *ray;
    Met met;
} Behind;

/* What rays on their way behind surfaces meet, (N) each, and the share that it lets through, no number where its
 * material says so; NULL where all do. As `Ahead` in hits.py. */
typedef struct {
    int32_t *face;
    double *distance, *along;
    const double *through;
} Ahead;

INLINE double floor_of(double x)
{
    if (!(x > -4503599627370496.0 && x < 4503599627370496.0)) /* whole already, or no number */
        return x;
    double whole = (double)(int64_t)x;
    return whole - (double)(whole > x);
}

/* base.noise.hash_cells */
INLINE uint32_t hash_cell(const double *cell, uint32_t key)
{
    uint32_t node = mix_bits(low_bits(cell[0]) * 0x9E3779B1u + key);
    node = mix_bits(node + low_bits(cell[1]) * 0x85EBCA77u);
    node = mix_bits(node + low_bits(cell[2]) * 0xC2B2AE3Du);
    node *= 0x846CA68Bu;
    return node ^ (node >> 15);
}

/* The share of its light that a ray keeps behind a material. */
INLINE double transmitted(const Scene *scene, const Ray *ray, uint16_t material, double distance, double share)
{
    if (!scene->gaps || !scene->gappy[material])
        return scene->transmission[material];
    double size = scene->gap_size[material], radius = __builtin_sqrt(scene->gap_area * share) * distance;
    double spread = radius / size, middle[3], open = 0.0;
    for (int i = 0; i < 3; i++)
        middle[i] = (ray->origin[i] + distance * ray->direction[i] + scene->frame[i]) / size;
    for (int corner = 0; corner < CORNERS; corner++) {
        double cell[3];
        for (int i = 0; i < 3; i++)
            cell[i] = floor_of(middle[i] + scene->corners[3 * corner + i] * spread);
        open += (double)hash_cell(cell, scene->gap_key) < scene->open_below[material] ? 1.0 : 0.0;
    }
    return open / CORNERS;
}

/* Writes what a hit sends back; returns 1 where it also shines, which is then listed. */
INLINE int weigh(const Scene *scene, const Met *met, int64_t at, uint16_t material, double along,
                        double distance, double share, const Shining *shining, int64_t shine)
{
    double cosine = along < 0.0 ? -along : along, reach = distance < scene->closest ? scene->closest : distance;
    double reflectivity = scene->reflectivity[material];
    double brightness = cosine * scene->facet_a[material];
    brightness += (1.0 - cosine * cosine) * scene->facet_b[material];
    brightness *= reflectivity;
    int listed = 0;
    if (!(cosine > scene->edge_on)) {
        brightness = 0.0;
    } else if (scene->shining[material]) {
        shining->hit[shine] = at;
        shining->cosine[shine] = cosine;
        shining->brightness[shine] = brightness;
        shining->share[shine] = share;
        shining->material[shine] = material;
        listed = 1;
    }
    met->distance[at] = distance;
    met->intensity[at] = distance > 0.0 ? brightness * share / (reach * reach) : 0.0;
    met->weight[at] =
        (reflectivity > scene->least_reflectance ? reflectivity : scene->least_reflectance) * share;
    if (met->fading)
        met->fading[at] = reach * -scene->attenuation;
    if (met->share)
        met->share[at] = share;
    return listed;
}

/* How far rays go on behind a surface that they have passed, m. */
INLINE double step_behind(const Scene *scene, uint16_t material)
{
    return scene->clear[material] ? scene->beyond_clear : scene->beyond;
}

/* Writes the first hit of a ray; where light goes on behind it, lists the ray as the next of its k's. Returns 1 where
 * the hit shines. `through`: no number where the material says it. `ray`: only needed where that lets light pass. */
INLINE int settle_first(const Scene *scene, const Met *met, const Passed *passed, int64_t *length,
                        const Shining *shining, int64_t shine, int64_t k, int64_t p, int64_t pulses, const Ray *ray,
                        int32_t face, double distance, double along, double through)
{
    const int64_t at = k * pulses + p;
    if (face < 0 || !finite(distance)) {
        met->face[at] = -1;
        met->distance[at] = INFINITE;
        met->intensity[at] = met->weight[at] = 0.0;
        if (met->fading)
            met->fading[at] = -INFINITE;
        if (met->share)
            met->share[at] = scene->shape->share[k];
        return 0;
    }
    met->face[at] = face;
    const uint16_t material = scene->material[face];
    double reached = distance < scene->nearest ? INFINITE : distance, share = scene->shape->share[k];
    if (scene->pervious[material] && distance < scene->farthest) {
        if (through != through)
            through = transmitted(scene, ray, material, distance, share);
        double left = share * through;
        share *= 1.0 - through;
        if (scene->open && through == 1.0)
            reached = INFINITE;
        if (left > scene->faintest * scene->shape->share[k]) {
            const int64_t last = k * pulses + length[k]++;
            passed->ray[last] = at;
            passed->left[last] = left;
            passed->start[last] = distance;
            if (passed->face) {
                passed->face[last] = face;
                passed->step[last] = step_behind(scene, material);
            }
        }
    }
    return weigh(scene, met, at, material, along, reached, share, shining, shine);
}

/* Makes the rays of some pulses, from the k-th ray of each on, and casts them, a pulse's together.
 *
 * `lot`: pulses done together, 16 or a multiple. `rows`: (lot * K * 3) numbers each of origins and directions;
 * `turned`: (lot * K * 3) directions; `found`: (count, K - from).
 */
INLINE void cast_lot(const Scene *scene, void *casts, const Beams *beams, int64_t begin, int64_t count, int64_t from,
                     int64_t lot, float *rows_of_origins, float *rows, double *turned, int32_t *found)
{
    const Shape *shape = scene->shape;
    const int64_t rays = shape->rays, some = rays - from, pulses = beams->pulses, step = lot * rays;
    for (int i = 0; i < 3; i++) {
        const double *origin = beams->origin + i * pulses + begin, *axis = beams->direction + i * pulses + begin;
        const double *first = beams->in_plane + i * pulses + begin, *second = beams->across + i * pulses + begin;
        for (int64_t k = from; k < rays; k++) {
            double *out = turned + i * step + k * lot;
            const int64_t column = k - from;
            if (rays > 1 && !shape->parallel) {
                const double stretch = shape->stretch[k], x = shape->in_plane[k], y = shape->across[k];
                for (int64_t p = 0; p < count; p++)
                    out[p] = axis[p] * stretch + first[p] * x + second[p] * y;
            } else {
                for (int64_t p = 0; p < count; p++)
                    out[p] = axis[p];
            }
            for (int64_t p = 0; p < count; p++) {
                rows[3 * (p * some + column) + i] = (float)out[p];
                rows_of_origins[3 * (p * some + column) + i] = (float)origin[p];
            }
            if (rays > 1 && shape->parallel) {
                const double x = shape->in_plane[k], y = shape->across[k];
                for (int64_t p = 0; p < count; p++)
                    rows_of_origins[3 * (p * some + column) + i] = (float)(origin[p] + (first[p] * x + second[p] * y));
            }
        }
    }
    const CastRays cast = {rows_of_origins, rows, &scene->limit, 0};
    scene->cast(casts, scene->scene, count * some, &cast, found);
}

/* Puts the rays that go on, listed by k, one after the other; returns their number. */
INLINE int64_t close_up(int64_t rays, int64_t pulses, const int64_t *length, const Passed *passed)
{
    int64_t on = 0;
    for (int64_t k = 0; k < rays; k++) {
        for (int64_t j = 0; j < length[k]; j++, on++) {
            const int64_t from = k * pulses + j;
            passed->ray[on] = passed->ray[from];
            passed->left[on] = passed->left[from];
            passed->start[on] = passed->start[from];
            if (passed->face) {
                passed->face[on] = passed->face[from];
                passed->step[on] = passed->step[from];
            }
        }
    }
    return on;
}

/* Casts all rays of pulses and writes their first hits, (K, P), and the rays that go on, ordered by ray and pulse.
 *
 * For `lot` and what follows it see `cast_lot`. Returns the number of rays that go on; counts[0]: of shining hits.
 */
INLINE int64_t any_first(const Scene *scene, void *casts, const Beams *beams, const Met *met,
                         const Passed *passed, const Shining *shining, int64_t *counts, int64_t lot,
                         float *rows_of_origins, float *rows, double *turned, int32_t *found, int64_t *length)
{
    const int64_t rays = scene->shape->rays, pulses = beams->pulses, step = lot * rays;
    int64_t shine = 0;
    for (int64_t k = 0; k < rays; k++)
        length[k] = 0;
    for (int64_t begin = 0; begin < pulses; begin += lot) {
        const int64_t count = pulses - begin < lot ? pulses - begin : lot;
        cast_lot(scene, casts, beams, begin, count, 0, lot, rows_of_origins, rows, turned, found);
        for (int64_t k = 0; k < rays; k++) {
            for (int64_t p = 0; p < count; p++) {
                const int32_t face = found[p * rays + k];
                double distance = INFINITE, along = 0.0;
                Ray ray;
                if (face >= 0) {
                    for (int i = 0; i < 3; i++) {
                        ray.origin[i] = beams->origin[i * pulses + begin + p];
                        ray.direction[i] = turned[i * step + k * lot + p];
                    }
                    distance = range_to(scene->planes, face, ray.origin, ray.direction, &along);
                }
                shine += settle_first(scene, met, passed, length, shining, shine, k, begin + p, pulses, &ray, face,
                                      distance, along, __builtin_nan(""));
            }
        }
    }
    counts[0] = shine;
    return close_up(rays, pulses, length, passed);
}

EXPORT_WIDE(int64_t, first,
            (const Scene *scene, void *casts, const Beams *beams, const Met *met, const Passed *passed, const Shining
             *shining, int64_t *counts, int64_t lot, float *rows_of_origins, float *rows, double *turned, int32_t
             *found, int64_t *length),
            (scene, casts, beams, met, passed, shining, counts, lot, rows_of_origins, rows, turned, found, length))

/* Writes face, range and n . d of what the rays of pulses meet of what doesn't move, from the k-th of each on. */
INLINE void any_cast_first(const Scene *scene, void *casts, const Beams *beams, const Met *met, int64_t from,
                           int64_t lot, float *rows_of_origins, float *rows, double *turned, int32_t *found)
{
    const int64_t rays = scene->shape->rays, pulses = beams->pulses, step = lot * rays;
    for (int64_t begin = 0; begin < pulses; begin += lot) {
        const int64_t count = pulses - begin < lot ? pulses - begin : lot;
        cast_lot(scene, casts, beams, begin, count, from, lot, rows_of_origins, rows, turned, found);
        for (int64_t k = from; k < rays; k++) {
            for (int64_t p = 0; p < count; p++) {
                const int64_t at = k * pulses + begin + p;
                const int32_t face = found[p * (rays - from) + k - from];
                double distance = INFINITE, along = 0.0;
                if (face >= 0) {
                    Ray ray;
                    if (scene->shape->parallel) {
                        ray = ray_of(scene->shape, beams, k, begin + p);
                    } else {
                        for (int i = 0; i < 3; i++) {
                            ray.origin[i] = beams->origin[i * pulses + begin + p];
                            ray.direction[i] = turned[i * step + k * lot + p];
                        }
                    }
                    distance = range_to(scene->planes, face, ray.origin, ray.direction, &along);
                }
                const int hit = face >= 0 && finite(distance);
                met->face[at] = hit ? face : -1;
                met->distance[at] = hit ? distance : INFINITE;
                met->along[at] = along;
            }
        }
    }
}

EXPORT_WIDE(void, cast_first,
            (const Scene *scene, void *casts, const Beams *beams, const Met *met, int64_t from, int64_t lot, float
             *rows_of_origins, float *rows, double *turned, int32_t *found),
            (scene, casts, beams, met, from, lot, rows_of_origins, rows, turned, found))

/* Does with what was met what `synthroads_first` does. `through`: (K, P) as in `Ahead`, or NULL. */
INLINE int64_t any_weigh_first(const Scene *scene, const Beams *beams, const Met *met, const double *through,
                               const Passed *passed, const Shining *shining, int64_t *counts, int64_t *length)
{
    const int64_t rays = scene->shape->rays, pulses = beams->pulses;
    int64_t shine = 0;
    for (int64_t k = 0; k < rays; k++) {
        length[k] = 0;
        for (int64_t p = 0; p < pulses; p++) {
            const int64_t at = k * pulses + p;
            const int32_t face = met->face[at];
            Ray ray;
            if (face >= 0 && scene->pervious[scene->material[face]])
                ray = ray_of(scene->shape, beams, k, p);
            shine += settle_first(scene, met, passed, length, shining, shine, k, p, pulses, &ray, face,
                                  met->distance[at], met->along[at], through ? through[at] : __builtin_nan(""));
        }
    }
    counts[0] = shine;
    return close_up(rays, pulses, length, passed);
}

EXPORT_WIDE(int64_t, weigh_first,
            (const Scene *scene, const Beams *beams, const Met *met, const double *through, const Passed *passed, const
             Shining *shining, int64_t *counts, int64_t *length),
            (scene, beams, met, through, passed, shining, counts, length))

/* How far along its ray, m, light goes on that has passed a surface. */
INLINE double onward(const Scene *scene, const Passed *passed, int64_t j)
{
    return passed->start[j] + (passed->step ? passed->step[j] : scene->beyond);
}

/* Casts rays on from the surfaces that they have passed; writes what they meet of what doesn't move, and how far behind
 * where they go on. `rows`: (BUFFER, 3) each. */
INLINE void any_cast_behind(const Scene *scene, void *casts, const Beams *beams, const Passed *passed, int64_t count,
                            const Ahead *ahead, float *rows_of_origins, float *rows)
{
    const int64_t pulses = beams->pulses;
    for (int64_t begin = 0; begin < count; begin += BUFFER) {
        const int64_t some = count - begin < BUFFER ? count - begin : BUFFER;
        int32_t *found = ahead->face + begin;
        for (int64_t j = 0; j < some; j++) {
            const int64_t at = passed->ray[begin + j];
            const Ray ray = ray_of(scene->shape, beams, at / pulses, at % pulses);
            const double start = onward(scene, passed, begin + j);
            for (int i = 0; i < 3; i++) {
                rows_of_origins[3 * j + i] = (float)(ray.origin[i] + start * ray.direction[i]);
                rows[3 * j + i] = (float)ray.direction[i];
            }
        }
        const CastRays cast = {rows_of_origins, rows, &scene->limit, 0};
        scene->cast(casts, scene->scene, some, &cast, found);
        for (int64_t j = 0; j < some; j++) {
            ahead->distance[begin + j] = INFINITE;
            if (found[j] < 0)
                continue;
            const int64_t at = passed->ray[begin + j];
            const Ray ray = ray_of(scene->shape, beams, at / pulses, at % pulses);
            const double start = onward(scene, passed, begin + j);
            double place[3];
            for (int i = 0; i < 3; i++)
                place[i] = ray.origin[i] + start * ray.direction[i];
            const double distance = range_to(scene->planes, found[j], place, ray.direction,
                                             ahead->along + begin + j);
            if (finite(distance))
                ahead->distance[begin + j] = distance;
            else
                found[j] = -1;
        }
    }
}

EXPORT_WIDE(void, cast_behind,
            (const Scene *scene, void *casts, const Beams *beams, const Passed *passed, int64_t count, const Ahead
             *ahead, float *rows_of_origins, float *rows),
            (scene, casts, beams, passed, count, ahead, rows_of_origins, rows))

/* Writes the hits behind surfaces that are within reach, and those rays that go on again into the same lists. Returns
 * their number; counts: of hits, of shining ones. */
INLINE int64_t any_weigh_behind(const Scene *scene, const Beams *beams, const Passed *passed, int64_t count,
                                const Ahead *ahead, const Behind *behind, const Shining *shining, int64_t *counts)
{
    const int64_t pulses = beams->pulses;
    int64_t on = 0, hits = 0, shine = 0;
    for (int64_t j = 0; j < count; j++) {
        const int32_t face = ahead->face[j];
        if (face < 0)
            continue;
        const int64_t at = passed->ray[j], k = at / pulses;
        const double distance = onward(scene, passed, j) + ahead->distance[j], left = passed->left[j];
        const double along = ahead->along[j], share = scene->shape->share[k];
        const uint16_t material = scene->material[face];
        double through = ahead->through ? ahead->through[j] : __builtin_nan("");
        if (through != through) {
            const Ray ray = ray_of(scene->shape, beams, k, at % pulses);
            through = transmitted(scene, &ray, material, distance, share);
        }
        double step = step_behind(scene, material);
        if (passed->face && face == passed->face[j]) { /* no ray meets a flat face twice */
            through = 1.0;
            step = 4.0 * passed->step[j];
        }
        const double taken = left * (1.0 - through);
        if (taken > 0.0 && !(distance < scene->nearest || distance > scene->farthest) && distance < INFINITE) {
            behind->ray[hits] = at;
            behind->met.along[hits] = along;
            behind->met.face[hits] = face;
            shine += weigh(scene, &behind->met, hits, material, along, distance, taken, shining, shine);
            hits++;
        }
        if (left * through > scene->faintest * share) { /* behind what has been read */
            passed->ray[on] = at;
            passed->left[on] = left * through;
            passed->start[on] = distance;
            if (passed->face) {
                passed->face[on] = face;
                passed->step[on] = step;
            }
            on++;
        }
    }
    counts[0] = hits;
    counts[1] = shine;
    return on;
}

EXPORT_WIDE(int64_t, weigh_behind,
            (const Scene *scene, const Beams *beams, const Passed *passed, int64_t count, const Ahead *ahead, const
             Behind *behind, const Shining *shining, int64_t *counts),
            (scene, beams, passed, count, ahead, behind, shining, counts))

/* A sum as NumPy's `add` makes it of numbers side by side: in eight parts, of long rows by halves. */
static double sum_in_parts(const double *values, int64_t count)
{
    if (count < 8) {
        double sum = -0.0;
        for (int64_t i = 0; i < count; i++)
            sum += values[i];
        return sum;
    }
    if (count > 128) {
        int64_t half = count / 2;
        half -= half % 8;
        return sum_in_parts(values, half) + sum_in_parts(values + half, count - half);
    }
    double part[8];
    for (int i = 0; i < 8; i++)
        part[i] = values[i];
    int64_t i = 8;
    for (; i < count - count % 8; i += 8)
        for (int j = 0; j < 8; j++)
            part[j] += values[i + j];
    double sum = ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
    for (; i < count; i++)
        sum += values[i];
    return sum;
}

/* As `add.reduceat`: the first, and the sum of the others. */
static double sum_of_group(const double *values, int64_t count)
{
    return count == 1 ? values[0] : values[0] + sum_in_parts(values + 1, count - 1);
}

/* Room for the hits of one pulse. `sorted`, `offset`, `power`, and in the end `key`, are in the order of ranges. */
typedef struct {
    int64_t *hit, *order, *spare;
    double *key, *reach, *weight, *energy, *sorted, *offset, *power;
} Lists;

/* Returns the indices of hits by their keys, equal ones in the order in which they came (merge sort). */
static int64_t *sort_hits(const Lists *lists, int64_t count)
{
    int64_t *from = lists->order, *to = lists->spare;
    for (int64_t i = 0; i < count; i++)
        from[i] = i;
    for (int64_t width = 1; width < count; width *= 2) {
        for (int64_t low = 0; low < count; low += 2 * width) {
            int64_t middle = low + width < count ? low + width : count;
            int64_t high = middle + width < count ? middle + width : count, a = low, b = middle;
            for (int64_t i = low; i < high; i++)
                to[i] = a < middle && (b >= high || lists->key[from[a]] <= lists->key[from[b]]) ? from[a++] : from[b++];
        }
        int64_t *last = from;
        from = to;
        to = last;
    }
    return from;
}

/* Echoes; as `_Echoes` in pulses.py. */
typedef struct {
    int64_t *pulse, *hit;
    double *range, *intensity, *weight;
} Echoes;

/* Splits the hits of one pulse where ranges are apart by more than the resolution; returns the number of echoes. */
static int64_t split_pulse(const Lists *lists, int64_t count, int64_t pulse, double resolution, const Echoes *echoes,
                           int64_t last)
{
    const int64_t *order = sort_hits(lists, count);
    int64_t made = last;
    for (int64_t i = 0; i < count; i++)
        lists->sorted[i] = lists->reach[order[i]];
    for (int64_t first = 0, end; first < count; first = end) {
        const double begin = lists->sorted[first];
        int64_t brightest = first;
        for (end = first + 1; end < count && !(lists->sorted[end] - lists->sorted[end - 1] > resolution); end++)
            ;
        double *offset = lists->offset, *power = lists->power, *weight = lists->key; /* keys are done with */
        for (int64_t i = first; i < end; i++) {
            weight[i] = lists->weight[order[i]];
            power[i] = lists->energy[order[i]];
            offset[i] = weight[i] * (lists->sorted[i] - begin);
            brightest = power[i] > power[brightest] ? i : brightest;
        }
        const double total = sum_of_group(weight + first, end - first);
        echoes->pulse[made] = pulse;
        echoes->hit[made] = lists->hit[order[brightest]];
        echoes->range[made] = begin + sum_of_group(offset + first, end - first) / total;
        echoes->intensity[made] = sum_of_group(power + first, end - first);
        echoes->weight[made++] = total;
    }
    return made - last;
}

/* Adds the k-th rays of pulses side by side to their pulses' sums. */
INLINE void add_rays(int64_t count, double k, const Met *first, int64_t row, const double *restrict nearest,
                     double *restrict total, double *restrict near, double *restrict energy, double *restrict most,
                     double *restrict brightest)
{
    const double *restrict distance = first->distance + row, *restrict weight = first->weight + row;
    const double *restrict power = first->intensity + row, *restrict fading = first->fading + row;
    for (int64_t p = 0; p < count; p++) {
        const double received = first->fading ? power[p] * fading[p] : power[p];
        total[p] += weight[p];
        near[p] += (distance[p] - nearest[p]) * weight[p];
        energy[p] += received;
        brightest[p] = received > most[p] ? k : brightest[p];
        most[p] = received > most[p] ? received : most[p];
    }
}

/* Writes the nearest and the farthest range of the rays of pulses side by side. */
INLINE void find_limits(int64_t count, int64_t rays, const double *restrict distance, int64_t pulses,
                        double *restrict nearest, double *restrict farthest)
{
    for (int64_t p = 0; p < count; p++)
        nearest[p] = INFINITE, farthest[p] = -INFINITE;
    for (int64_t k = 0; k < rays; k++) {
        const double *restrict row = distance + k * pulses;
        for (int64_t p = 0; p < count; p++) {
            nearest[p] = row[p] < nearest[p] ? row[p] : nearest[p];
            farthest[p] = row[p] > farthest[p] ? row[p] : farthest[p];
        }
    }
}

/* Groups hits into echoes, by pulse and range: returns.group_returns. Returns their number.
 *
 * `first`: (K, P) hits; `late`: (count) behind surfaces, `ray` of each. Where `fading` is there, it holds factors now.
 * `head`: (P), `next`: (count) for chains of a pulse's late hits. `sums`: (8, lot).
 */
INLINE int64_t any_group(int64_t rays, int64_t pulses, const Met *first, int64_t count, const Behind *late,
                         double resolution, int64_t lot, double *sums, int64_t *head, int64_t *tail,
                         int64_t *next, const Lists *lists, const Echoes *echoes)
{
    double *nearest = sums, *farthest = sums + lot, *total = sums + 2 * lot, *near = sums + 3 * lot;
    double *energy = sums + 4 * lot, *most = sums + 5 * lot, *brightest = sums + 6 * lot;
    double *base = sums + 7 * lot, reach = 1.0;
    int64_t made = 0;
    for (int64_t p = 0; p < pulses; p++)
        head[p] = -1;
    for (int64_t j = 0; j < count; j++) {
        const int64_t p = late->ray[j] % pulses;
        next[j] = -1;
        if (head[p] < 0)
            head[p] = j;
        else
            next[tail[p]] = j;
        tail[p] = j;
        reach = late->met.distance[j] > reach ? late->met.distance[j] : reach;
    }
    for (int pass = 0; pass < 2; pass++) { /* first only how far the hits of pulses that are split lie at most */
        for (int64_t begin = 0; begin < pulses; begin += lot) {
            const int64_t some = pulses - begin < lot ? pulses - begin : lot;
            find_limits(some, rays, first->distance + begin, pulses, nearest, farthest);
            if (pass == 0) {
                for (int64_t p = 0; p < some; p++) {
                    if (farthest[p] <= nearest[p] + resolution && farthest[p] < INFINITE && head[begin + p] < 0)
                        continue;
                    for (int64_t k = 0; k < rays; k++) {
                        const double distance = first->distance[k * pulses + begin + p];
                        reach = distance < INFINITE && distance > reach ? distance : reach;
                    }
                }
                continue;
            }
            for (int64_t p = 0; p < some; p++) {
                total[p] = near[p] = energy[p] = brightest[p] = 0.0, most[p] = -INFINITE;
                base[p] = farthest[p] < INFINITE ? nearest[p] : 0.0;
            }
            for (int64_t k = 0; k < rays; k++)
                add_rays(some, (double)k, first, k * pulses + begin, base, total, near, energy, most, brightest);
            for (int64_t p = 0; p < some; p++) {
                const int64_t pulse = begin + p;
                if (farthest[p] <= nearest[p] + resolution && farthest[p] < INFINITE && head[pulse] < 0) {
                    echoes->pulse[made] = pulse;
                    echoes->hit[made] = (int64_t)brightest[p] * pulses + pulse;
                    echoes->range[made] = rays == 1 ? nearest[p] : nearest[p] + near[p] / total[p];
                    echoes->intensity[made] = energy[p];
                    echoes->weight[made++] = total[p];
                    continue;
                }
                int64_t hits = 0;
                for (int64_t k = 0; k < rays; k++) {
                    const int64_t at = k * pulses + pulse;
                    if (!(first->distance[at] < INFINITE))
                        continue;
                    lists->hit[hits] = at;
                    lists->reach[hits] = first->distance[at];
                    lists->weight[hits] = first->weight[at];
                    lists->energy[hits++] = first->intensity[at] * (first->fading ? first->fading[at] : 1.0);
                }
                for (int64_t j = head[pulse]; j >= 0; j = next[j]) {
                    lists->hit[hits] = rays * pulses + j;
                    lists->reach[hits] = late->met.distance[j];
                    lists->weight[hits] = late->met.weight[j];
                    lists->energy[hits++] = late->met.intensity[j] * (late->met.fading ? late->met.fading[j] : 1.0);
                }
                for (int64_t j = 0; j < hits; j++)
                    lists->key[j] = (double)pulse * (2.0 * reach) + lists->reach[j];
                made += split_pulse(lists, hits, pulse, resolution, echoes, made);
            }
        }
    }
    return made;
}

EXPORT_WIDE(int64_t, group,
            (int64_t rays, int64_t pulses, const Met *first, int64_t count, const Behind *late, double resolution,
             int64_t lot, double *sums, int64_t *head, int64_t *tail, int64_t *next, const Lists *lists, const Echoes
             *echoes),
            (rays, pulses, first, count, late, resolution, lot, sums, head, tail, next, lists, echoes))

/* Writes of the hits (count) of echoes: face, n . d, range of the hit, begin and direction (3, count) of its ray. */
EXPORT void synthroads_describe(const Scene *scene, const Beams *beams, const Met *first, const Behind *late,
                                int64_t count, const int64_t *hit, int64_t *face, double *along, double *distance,
                                double *begin, double *direction)
{
    const int64_t pulses = beams->pulses, size = scene->shape->rays * pulses;
    for (int64_t i = 0; i < count; i++) {
        const int64_t behind = hit[i] - size, at = behind < 0 ? hit[i] : late->ray[behind];
        const Ray ray = ray_of(scene->shape, beams, at / pulses, at % pulses);
        const Met *met = behind < 0 ? first : &late->met;
        const int64_t row = behind < 0 ? hit[i] : behind;
        for (int j = 0; j < 3; j++) {
            direction[j * count + i] = ray.direction[j];
            if (begin)
                begin[j * count + i] = ray.origin[j];
        }
        face[i] = met->face[row];
        distance[i] = met->distance[row];
        if (met->along)
            along[i] = met->along[row];
        else
            range_to(scene->planes, met->face[row], ray.origin, ray.direction, along + i);
    }
}
