/* What rays meet of what moves, nearer than what they have met before: scene/target.py's `_cast_moving` for each part, in
 * the very order of operations, rays in their order. Bundles of rays that pass a part by are ruled out before single
 * rays are, as scene/bundles.py does, by another bound that needs no arc cosine: neither rules out a ray that comes near.
 */
#include "rays.h"

#define BUNDLE 64 /* rays, or pulses with all their rays, that are ruled out together */
#define BOUNDS 12 /* numbers of a bundle */
#define SLACK 1e-6 /* far more than what is rounded */

/* A rigid body and its track; as `_Part` in moving.py. */
typedef struct {
    Cast cast;
    void *casts, *scene;
    int64_t first;          /* number of its first face among all */
    const double *planes;   /* (faces, 4), body frame */
    int64_t knots;
    double begin, spacing;  /* of the knots, s */
    const double *rotation, *position, *way; /* (9, knots), (3, knots), and of the middle of the ball around it */
    const uint8_t *present; /* (knots) */
    double radius, square, fastest; /* of the ball, m; squared; of its middle, m/s */
} Part;

/* Rays: the pulses' from the k-th of each on, or `count` of a list that go on at `start`. As `_Rays` in moving.py. */
typedef struct {
    int64_t from, count;
    const int64_t *list;
    const double *start, *step; /* step: NULL for the same everywhere */
    double beyond;
    const double *reach;        /* as far as a ray is followed, m: (K, P), or (count) */
    int32_t *face;              /* likewise, and all that follow */
    double *distance, *along;
    float limit;
} Rays;

/* Work space: bounds of bundles, which are near, and rays that are to be cast. As `MovingParts.cast` in moving.py has it. */
typedef struct {
    double *bounds, *turned;  /* (bundles, BOUNDS); (BUFFER, 6) */
    uint8_t *near;            /* (bundles) */
    int64_t *pending;         /* (BUFFER) */
    float *origins, *directions;
    int32_t *found;
} Work;

INLINE double between(const double *row, int64_t knot, double share)
{
    return (row[knot + 1] - row[knot]) * share + row[knot];
}

/* The knot before a time, and the share of the way to the next: knots._locate. */
INLINE int64_t locate(const Part *part, double time, double *share)
{
    const double last = (double)(part->knots - 2), at = (time - part->begin) / part->spacing;
    const int64_t knot = at > 0.0 ? (at < last ? (int64_t)at : part->knots - 2) : 0;
    *share = at - (double)knot;
    return knot;
}

/* The i-th ray: of a list, or as k * P + p. */
INLINE Ray ray_number(const Shape *shape, const Beams *beams, const Rays *rays, int64_t i, int64_t *pulse)
{
    const int64_t at = rays->list ? rays->list[i] : i;
    *pulse = at % beams->pulses;
    Ray ray = ray_of(shape, beams, at / beams->pulses, *pulse);
    if (rays->list) {
        const double start = rays->start[i] + (rays->step ? rays->step[i] : rays->beyond);
        for (int j = 0; j < 3; j++)
            ray.origin[j] = ray.origin[j] + start * ray.direction[j];
    }
    return ray;
}

/* What is left of a bundle while it is gathered: the axis of the pulse, or a ray of the list, and how far others of the
 * pulse are from that. */
INLINE Ray member(const Shape *shape, const Beams *beams, const Rays *rays, int64_t i, double *time)
{
    Ray ray;
    int64_t pulse = i;
    if (rays->list) {
        ray = ray_number(shape, beams, rays, i, &pulse);
    } else {
        for (int j = 0; j < 3; j++) {
            ray.origin[j] = beams->origin[j * beams->pulses + i];
            ray.direction[j] = beams->direction[j * beams->pulses + i];
        }
    }
    *time = beams->time[pulse];
    return ray;
}

/* Writes the bounds of bundles: middle and radius of the ball around the origins, axis of the cone, by how much a ray's
 * unit vector differs from it at most, the longest reach, middle of the times and half their spread. */
INLINE void bound(const Shape *shape, const Beams *beams, const Rays *rays, int64_t members, double *bounds)
{
    double width = 0.0, x = 0.0, y = 0.0; /* of a pulse's rays around its axis */
    for (int64_t k = 0; k < shape->rays && shape->rays > 1 && !rays->list; k++) {
        const double a = shape->in_plane[k], b = shape->across[k], c = shape->stretch[k] - 1.0;
        const double off = __builtin_sqrt(a * a + b * b + c * c);
        width = !shape->parallel && off > width ? off : width;
        x = (a < 0.0 ? -a : a) > x ? (a < 0.0 ? -a : a) : x;
        y = (b < 0.0 ? -b : b) > y ? (b < 0.0 ? -b : b) : y;
    }
    const int beside = shape->parallel && shape->rays > 1 && !rays->list;
    for (int64_t begin = 0; begin < members; begin += BUNDLE, bounds += BOUNDS) {
        const int64_t end = begin + BUNDLE < members ? begin + BUNDLE : members;
        double low[7], high[7], reach = 0.0, time, chord = 0.0;
        for (int j = 0; j < 7; j++)
            low[j] = INFINITE, high[j] = -INFINITE;
        for (int64_t i = begin; i < end; i++) {
            const Ray ray = member(shape, beams, rays, i, &time);
            for (int j = 0; j < 3; j++) {
                double room = 0.0;
                if (beside) {
                    const double a = beams->in_plane[j * beams->pulses + i], b = beams->across[j * beams->pulses + i];
                    room = (a < 0.0 ? -a : a) * x + (b < 0.0 ? -b : b) * y;
                }
                low[j] = ray.origin[j] - room < low[j] ? ray.origin[j] - room : low[j];
                high[j] = ray.origin[j] + room > high[j] ? ray.origin[j] + room : high[j];
                low[3 + j] = ray.direction[j] < low[3 + j] ? ray.direction[j] : low[3 + j];
                high[3 + j] = ray.direction[j] > high[3 + j] ? ray.direction[j] : high[3 + j];
            }
            low[6] = time < low[6] ? time : low[6];
            high[6] = time > high[6] ? time : high[6];
            if (rays->list)
                reach = rays->reach[i] > reach ? rays->reach[i] : reach;
        }
        for (int64_t k = rays->from; k < shape->rays && !rays->list; k++) {
            const double *row = rays->reach + k * beams->pulses;
            for (int64_t i = begin; i < end; i++)
                reach = row[i] > reach ? row[i] : reach;
        }
        double ball = 0.0, length = 0.0;
        for (int j = 0; j < 3; j++) {
            bounds[j] = (low[j] + high[j]) / 2.0;
            ball += (high[j] - low[j]) * (high[j] - low[j]);
            bounds[4 + j] = (low[3 + j] + high[3 + j]) / 2.0;
            length += bounds[4 + j] * bounds[4 + j];
        }
        bounds[3] = __builtin_sqrt(ball) / 2.0;
        for (int j = 0; j < 3; j++)
            bounds[4 + j] /= length > 0.0 ? __builtin_sqrt(length) : 1.0;
        for (int64_t i = begin; i < end; i++) {
            const Ray ray = member(shape, beams, rays, i, &time);
            double off = 0.0;
            for (int j = 0; j < 3; j++)
                off += (ray.direction[j] - bounds[4 + j]) * (ray.direction[j] - bounds[4 + j]);
            chord = off > chord ? off : chord;
        }
        bounds[7] = __builtin_sqrt(chord) + width + SLACK;
        bounds[8] = reach;
        bounds[9] = (low[6] + high[6]) / 2.0;
        bounds[10] = (high[6] - low[6]) / 2.0;
    }
}

/* Whether a ray of a bundle may come into the ball around a part. At s m along it, it is within the ball of origins and s
 * times the chord of the place s m along the axis. */
INLINE int touched(const Part *part, const double *bounds)
{
    double share, towards[3], ahead = 0.0, beside = 0.0;
    const int64_t knot = locate(part, bounds[9], &share);
    for (int j = 0; j < 3; j++) {
        towards[j] = between(part->way + j * part->knots, knot, share) - bounds[j];
        ahead += towards[j] * bounds[4 + j];
    }
    for (int j = 0; j < 3; j++) {
        const double off = towards[j] - ahead * bounds[4 + j];
        beside += off * off;
    }
    const double chord = bounds[7], room = part->radius + bounds[3] + part->fastest * bounds[10] + SLACK;
    double farthest = bounds[8];
    if (chord < 0.9) {
        const double end = (ahead + room) / (1.0 - chord);
        farthest = end < farthest ? end : farthest;
    }
    const double wide = room + farthest * chord;
    return farthest >= 0.0 && beside <= wide * wide && ahead - room <= farthest * (1.0 + chord);
}

/* Whether a ray comes into the ball within its reach: Bundles.rays_near. */
INLINE int comes_near(const Part *part, const Ray *ray, double reach, int64_t knot, double share)
{
    double towards[3], square = 0.0;
    for (int j = 0; j < 3; j++)
        towards[j] = between(part->way + j * part->knots, knot, share) - ray->origin[j];
    double ahead = towards[0] * ray->direction[0];
    ahead += towards[1] * ray->direction[1];
    ahead += towards[2] * ray->direction[2];
    ahead = ahead < 0.0 ? 0.0 : ahead;
    ahead = ahead > reach ? reach : ahead;
    for (int j = 0; j < 3; j++) {
        towards[j] -= ahead * ray->direction[j];
        square += towards[j] * towards[j];
    }
    return square <= part->square;
}

/* Casts the rays that wait, and keeps what they meet nearer than before. */
INLINE void cast_pending(const Part *part, const Rays *rays, const Work *work, int64_t count)
{
    const CastRays cast = {work->origins, work->directions, &rays->limit, 0};
    if (!count)
        return;
    part->cast(part->casts, part->scene, count, &cast, work->found);
    for (int64_t j = 0; j < count; j++) {
        const double *ray = work->turned + 6 * j;
        double along;
        if (work->found[j] < 0)
            continue;
        const double distance = range_to(part->planes, work->found[j], ray, ray + 3, &along);
        const int64_t i = work->pending[j];
        if (finite(distance) && distance < rays->distance[i]) {
            rays->face[i] = (int32_t)part->first + work->found[j];
            rays->distance[i] = distance;
            rays->along[i] = along;
        }
    }
}

/* Lets a ray that comes near a part wait in the part's own frame; returns 1 if it does. */
INLINE int let_wait(const Shape *shape, const Beams *beams, const Part *part, const Rays *rays, const Work *work,
                    int64_t i, int64_t waiting)
{
    int64_t pulse;
    double share, matrix[9], begin[3], *turned = work->turned + 6 * waiting;
    const Ray ray = ray_number(shape, beams, rays, i, &pulse);
    const int64_t knot = locate(part, beams->time[pulse], &share);
    if (!comes_near(part, &ray, rays->reach[i], knot, share) || !part->present[knot] || !part->present[knot + 1])
        return 0;
    for (int j = 0; j < 9; j++)
        matrix[j] = between(part->rotation + j * part->knots, knot, share);
    for (int j = 0; j < 3; j++)
        begin[j] = ray.origin[j] - between(part->position + j * part->knots, knot, share);
    for (int j = 0; j < 3; j++) {
        turned[j] = matrix[j] * begin[0] + matrix[3 + j] * begin[1] + matrix[6 + j] * begin[2];
        turned[3 + j] = matrix[j] * ray.direction[0] + matrix[3 + j] * ray.direction[1] + matrix[6 + j] * ray.direction[2];
        work->origins[3 * waiting + j] = (float)turned[j];
        work->directions[3 * waiting + j] = (float)turned[3 + j];
    }
    work->pending[waiting] = i;
    return 1;
}

/* Replaces hits by nearer ones on moving parts, one part after the other. */
INLINE void any_moving(const Shape *shape, const Beams *beams, int64_t count, const Part *parts, const Rays *rays,
                       const Work *work)
{
    const int64_t members = rays->list ? rays->count : beams->pulses, bundles = (members + BUNDLE - 1) / BUNDLE;
    const int64_t first = rays->list ? 0 : rays->from, last = rays->list ? 1 : shape->rays;
    bound(shape, beams, rays, members, work->bounds);
    for (const Part *part = parts; part < parts + count; part++) {
        int64_t waiting = 0, some = 0;
        for (int64_t bundle = 0; bundle < bundles; bundle++) {
            work->near[bundle] = (uint8_t)touched(part, work->bounds + BOUNDS * bundle);
            some += work->near[bundle];
        }
        for (int64_t k = first; k < last && some; k++) {
            for (int64_t bundle = 0; bundle < bundles; bundle++) {
                if (!work->near[bundle])
                    continue;
                const int64_t begin = bundle * BUNDLE, end = begin + BUNDLE < members ? begin + BUNDLE : members;
                for (int64_t i = begin; i < end; i++) {
                    waiting += let_wait(shape, beams, part, rays, work, k * members + i, waiting);
                    if (waiting == BUFFER) {
                        cast_pending(part, rays, work, waiting);
                        waiting = 0;
                    }
                }
            }
        }
        cast_pending(part, rays, work, waiting);
    }
}

EXPORT_WIDE(void, moving,
            (const Shape *shape, const Beams *beams, int64_t count, const Part *parts, const Rays *rays, const Work
             *work),
            (shape, beams, count, parts, rays, work))
