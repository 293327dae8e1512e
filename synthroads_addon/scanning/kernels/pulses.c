/* What a block's pulses meet and send back: rays made, cast, placed on the planes of faces, followed through what lets
 * light pass, weighed and grouped into returns. The arithmetic of scanning/trace.py, scanning/scene and
 * scanning/returns.py in the very order in which NumPy does it there, so that the results are the same bytes. What
 * needs exp or arccos is left to NumPy, between `synthroads_first`, `synthroads_behind` and `synthroads_group`.
 */
#include "kernel.h"

#define INFINITE __builtin_inf()
#define CORNERS 4
#define BUFFER 1024 /* rays cast at once behind surfaces: whole packets of any width */

/* packets.c's synthroads_cast, and its `Rays`. */
typedef struct {
    const float *origin, *direction, *limit;
    int64_t limit_step;
} CastRays;
typedef void (*Cast)(void *casts, void *scene, int64_t count, const CastRays *rays, int32_t *found);

/* What is scanned and how, the same for all blocks; as `_Scene` in pulses.py. */
typedef struct {
    Cast cast;
    void *scene;
    int64_t rays;                                     /* K per pulse */
    const double *stretch, *in_plane, *across, *share; /* (K) of the rays: factors on axis and beam's axes; energy */
    int64_t faces;
    const double *planes;                              /* (4, faces) */
    const uint16_t *material;                          /* (faces) */
    const double *reflectivity, *facet_a, *facet_b;    /* (M) of materials, as all that follow */
    const double *transmission, *open_below, *gap_size;
    const uint8_t *pervious, *gappy, *shining;
    const double *corners;                             /* (CORNERS, 3) */
    double frame[3], gap_area;
    uint32_t gap_key;
    int32_t gaps;                                      /* whether leaves and gaps are told apart */
    double nearest, farthest, attenuation;
    double faintest, beyond, edge_on, closest, least_reflectance;
    float limit;
} Scene;

/* Hits whose surface sends light back the way that it came; as `_Shining` in pulses.py. NumPy adds what they do. */
typedef struct {
    int64_t *hit;
    double *cosine, *brightness, *share; /* brightness: without it */
    uint16_t *material;
} Shining;

/* Light that goes on behind surfaces; as `_Passed` in pulses.py. */
typedef struct {
    int64_t *ray; /* k * P + p */
    double *left, *start;
} Passed;

/* Hits, (K, P) or (N); as `_Met` in pulses.py. `fading`: the exponent of what the air leaves. */
typedef struct {
    int32_t *face;
    double *distance, *intensity, *weight, *fading;
} Met;

/* Hits behind surfaces, (N) at most; as `_Behind` in pulses.py. */
typedef struct {
    int64_t *ray;
    double *along;
    Met met;
} Behind;

/* P pulses; as `_Beams` in pulses.py. (3, P) each. */
typedef struct {
    int64_t pulses;
    const double *origin, *direction, *in_plane, *across;
} Beams;

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

/* A ray of a pulse. */
typedef struct {
    double origin[3], direction[3];
} Ray;

INLINE Ray ray_of(const Scene *scene, const Beams *beams, int64_t k, int64_t p)
{
    Ray ray;
    for (int i = 0; i < 3; i++) {
        int64_t at = i * beams->pulses + p;
        ray.origin[i] = beams->origin[at];
        ray.direction[i] = beams->direction[at];
        if (scene->rays > 1) {
            ray.direction[i] = ray.direction[i] * scene->stretch[k] + beams->in_plane[at] * scene->in_plane[k];
            ray.direction[i] += beams->across[at] * scene->across[k];
        }
    }
    return ray;
}

/* FacePlanes.intersect: the range to a face's plane, and n . d. */
INLINE double range_to(const Scene *scene, int32_t face, const double *origin, const double *direction,
                              double *along)
{
    const double *plane = scene->planes + face;
    double height = plane[3 * scene->faces] - plane[0] * origin[0], product = plane[0] * direction[0];
    for (int i = 1; i < 3; i++) {
        double normal = plane[i * scene->faces];
        product += normal * direction[i];
        height -= normal * origin[i];
    }
    *along = product;
    return height / product;
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
    return listed;
}

INLINE int finite(double x)
{
    return x > -INFINITE && x < INFINITE;
}

/* Casts all rays of pulses and writes their first hits, (K, P), and the rays that go on, ordered by ray and pulse.
 *
 * `lot`: pulses done together, 16 or a multiple. `rows`: (lot * K * 3) numbers each of origins and directions;
 * `turned`: (lot * K * 3) directions; `found`: (lot * K).
 * Returns the number of rays that go on; counts[0]: of shining hits.
 */
INLINE int64_t any_first(const Scene *scene, void *casts, const Beams *beams, const Met *met,
                         const Passed *passed, const Shining *shining, int64_t *counts, int64_t lot,
                         float *rows_of_origins, float *rows, double *turned, int32_t *found, int64_t *length)
{
    const int64_t rays = scene->rays, pulses = beams->pulses;
    int64_t shine = 0;
    for (int64_t k = 0; k < rays; k++)
        length[k] = 0;
    for (int64_t begin = 0; begin < pulses; begin += lot) {
        const int64_t count = pulses - begin < lot ? pulses - begin : lot, step = lot * rays;
        for (int i = 0; i < 3; i++) {
            const double *origin = beams->origin + i * pulses + begin, *axis = beams->direction + i * pulses + begin;
            const double *first = beams->in_plane + i * pulses + begin, *second = beams->across + i * pulses + begin;
            for (int64_t k = 0; k < rays; k++) {
                double *out = turned + i * step + k * lot;
                if (rays > 1) {
                    const double stretch = scene->stretch[k], x = scene->in_plane[k], y = scene->across[k];
                    for (int64_t p = 0; p < count; p++)
                        out[p] = axis[p] * stretch + first[p] * x + second[p] * y;
                } else {
                    for (int64_t p = 0; p < count; p++)
                        out[p] = axis[p];
                }
                for (int64_t p = 0; p < count; p++) {
                    rows[3 * (p * rays + k) + i] = (float)out[p];
                    rows_of_origins[3 * (p * rays + k) + i] = (float)origin[p];
                }
            }
        }
        const CastRays cast = {rows_of_origins, rows, &scene->limit, 0};
        scene->cast(casts, scene->scene, count * rays, &cast, found);
        for (int64_t k = 0; k < rays; k++) {
            for (int64_t p = 0; p < count; p++) {
                const int64_t at = k * pulses + begin + p;
                int32_t face = found[p * rays + k];
                double distance = INFINITE, along = 0.0, share = scene->share[k];
                Ray ray;
                if (face >= 0) {
                    for (int i = 0; i < 3; i++) {
                        ray.origin[i] = beams->origin[i * pulses + begin + p];
                        ray.direction[i] = turned[i * step + k * lot + p];
                    }
                    distance = range_to(scene, face, ray.origin, ray.direction, &along);
                }
                if (face < 0 || !finite(distance)) {
                    met->face[at] = -1;
                    met->distance[at] = INFINITE;
                    met->intensity[at] = met->weight[at] = 0.0;
                    if (met->fading)
                        met->fading[at] = -INFINITE;
                    continue;
                }
                met->face[at] = face;
                const uint16_t material = scene->material[face];
                double reached = distance < scene->nearest ? INFINITE : distance;
                if (scene->pervious[material] && distance < scene->farthest) {
                    double through = transmitted(scene, &ray, material, distance, share);
                    double left = share * through;
                    share *= 1.0 - through;
                    if (scene->gaps && through == 1.0)
                        reached = INFINITE;
                    if (left > scene->faintest * scene->share[k]) {
                        const int64_t last = k * pulses + length[k]++;
                        passed->ray[last] = at;
                        passed->left[last] = left;
                        passed->start[last] = distance;
                    }
                }
                shine += weigh(scene, met, at, material, along, reached, share, shining, shine);
            }
        }
    }
    counts[0] = shine;
    int64_t on = 0;
    for (int64_t k = 0; k < rays; k++) { /* each ray's own, one after the other */
        for (int64_t j = 0; j < length[k]; j++, on++) {
            const int64_t from = k * pulses + j;
            passed->ray[on] = passed->ray[from];
            passed->left[on] = passed->left[from];
            passed->start[on] = passed->start[from];
        }
    }
    return on;
}

EXPORT_WIDE(int64_t, first,
            (const Scene *scene, void *casts, const Beams *beams, const Met *met, const Passed *passed, const Shining
             *shining, int64_t *counts, int64_t lot, float *rows_of_origins, float *rows, double *turned, int32_t
             *found, int64_t *length),
            (scene, casts, beams, met, passed, shining, counts, lot, rows_of_origins, rows, turned, found, length))

/* Casts rays on from the surfaces that they have passed; writes the hits within reach, and those rays that go on again
 * into the same lists. Returns their number; counts: of hits, of shining ones. `rows`: (BUFFER, 3) each. */
INLINE int64_t any_behind(const Scene *scene, void *casts, const Beams *beams, const Passed *passed,
                          int64_t count, const Behind *behind, const Shining *shining, int64_t *counts,
                          float *rows_of_origins, float *rows, int32_t *found)
{
    const int64_t pulses = beams->pulses;
    int64_t on = 0, hits = 0, shine = 0;
    for (int64_t begin = 0; begin < count; begin += BUFFER) {
        const int64_t some = count - begin < BUFFER ? count - begin : BUFFER;
        for (int64_t j = 0; j < some; j++) {
            const int64_t at = passed->ray[begin + j];
            const Ray ray = ray_of(scene, beams, at / pulses, at % pulses);
            const double start = passed->start[begin + j] + scene->beyond;
            for (int i = 0; i < 3; i++) {
                rows_of_origins[3 * j + i] = (float)(ray.origin[i] + start * ray.direction[i]);
                rows[3 * j + i] = (float)ray.direction[i];
            }
        }
        const CastRays cast = {rows_of_origins, rows, &scene->limit, 0};
        scene->cast(casts, scene->scene, some, &cast, found);
        for (int64_t j = 0; j < some; j++) {
            if (found[j] < 0)
                continue;
            const int64_t at = passed->ray[begin + j], k = at / pulses;
            const Ray ray = ray_of(scene, beams, k, at % pulses);
            const double start = passed->start[begin + j] + scene->beyond, left = passed->left[begin + j];
            double place[3], along;
            for (int i = 0; i < 3; i++)
                place[i] = ray.origin[i] + start * ray.direction[i];
            double distance = range_to(scene, found[j], place, ray.direction, &along);
            if (!finite(distance))
                continue;
            distance = start + distance;
            const uint16_t material = scene->material[found[j]];
            const double through = transmitted(scene, &ray, material, distance, scene->share[k]);
            const double taken = left * (1.0 - through);
            if (taken > 0.0 && !(distance < scene->nearest || distance > scene->farthest) && distance < INFINITE) {
                behind->ray[hits] = at;
                behind->along[hits] = along;
                behind->met.face[hits] = found[j];
                shine += weigh(scene, &behind->met, hits, material, along, distance, taken, shining, shine);
                hits++;
            }
            if (left * through > scene->faintest * scene->share[k]) { /* behind what has been read */
                passed->ray[on] = at;
                passed->left[on] = left * through;
                passed->start[on++] = distance;
            }
        }
    }
    counts[0] = hits;
    counts[1] = shine;
    return on;
}

EXPORT_WIDE(int64_t, behind,
            (const Scene *scene, void *casts, const Beams *beams, const Passed *passed, int64_t count, const Behind
             *behind, const Shining *shining, int64_t *counts, float *rows_of_origins, float *rows, int32_t *found),
            (scene, casts, beams, passed, count, behind, shining, counts, rows_of_origins, rows, found))

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

/* Writes of the hits (count) of echoes: face, n . d, range of the hit and direction (3, count) of its ray. */
EXPORT void synthroads_describe(const Scene *scene, const Beams *beams, const Met *first, const Behind *late,
                                int64_t count, const int64_t *hit, int64_t *face, double *along, double *distance,
                                double *direction)
{
    const int64_t pulses = beams->pulses, size = scene->rays * pulses;
    for (int64_t i = 0; i < count; i++) {
        const int64_t behind = hit[i] - size, at = behind < 0 ? hit[i] : late->ray[behind];
        const Ray ray = ray_of(scene, beams, at / pulses, at % pulses);
        for (int j = 0; j < 3; j++)
            direction[j * count + i] = ray.direction[j];
        if (behind < 0) {
            face[i] = first->face[at];
            distance[i] = first->distance[at];
            range_to(scene, first->face[at], ray.origin, ray.direction, along + i);
        } else {
            face[i] = late->met.face[behind];
            distance[i] = late->met.distance[behind];
            along[i] = late->along[behind];
        }
    }
}
