/* Points of echoes: where each was measured and where it was seen, and what it is of. NumPy's code is the reference,
 * operation by operation: scan.BlockScan._points and _seen_targets of a scene in which nothing moves. */
#include "../kernel.h"

#define DEGREES 57.29577951308232 /* 180 / pi, as NumPy's rad2deg has it */

/* Echoes and their pulses; as `_Echoes` in points.py. */
typedef struct {
    const int64_t *pulse, *hit;            /* (count) */
    const double *range;                   /* (count) measured */
    const int64_t *face;                   /* (hits), as what follows */
    const double *along, *distance;
    const double *direction, *begin;       /* (3, hits); begin: NULL for where the pulses do */
    int64_t hits;
    const double *time, *scan_angle;       /* (pulses) */
    const double *origin;                  /* (3, pulses), as what follows */
    const double *measured_origin, *measured_direction;
    int64_t pulses;
    const double *planes;                  /* (faces, 4) */
    int64_t faces;
    const uint8_t *class_id;               /* (faces), as what follows */
    const uint32_t *instance_id;
    const uint16_t *material;
    double map_origin[3], epoch;
} Echoes;

/* Points (count); as `_Placed` in points.py. Those from `position` on: NULL where nobody asks. */
typedef struct {
    double *xyz, *gps_time;                /* (count, 3), (count) */
    float *scan_angle;                     /* degrees */
    uint8_t *class_id;
    uint32_t *instance_id;
    uint16_t *material;
    double *position, *scanner, *normal;   /* (count, 3) */
    float *narrow_normal;
    double *time;
} Placed;

INLINE int within_length(int64_t number, int64_t length)
{
    return number >= 0 && number < length;
}

/* Returns whether all pulses, hits and faces are there; if not, what is written means nothing. */
INLINE int any_place(int64_t count, const Echoes *e, const Placed *p)
{
    for (int64_t i = 0; i < count; i++) {
        const int64_t pulse = e->pulse[i], hit = e->hit[i];
        if (!within_length(pulse, e->pulses) || !within_length(hit, e->hits) || !within_length(e->face[hit], e->faces))
            return 0;
        const int64_t face = e->face[hit];
        const double range = e->range[i], side = e->along[hit] > 0.0 ? -1.0 : 1.0;
        for (int j = 0; j < 3; j++) {
            double place = e->measured_direction[j * e->pulses + pulse] * range;
            place += e->measured_origin[j * e->pulses + pulse];
            p->xyz[3 * i + j] = place + e->map_origin[j];
        }
        p->gps_time[i] = e->time[pulse] + e->epoch;
        p->scan_angle[i] = (float)(e->scan_angle[pulse] * DEGREES);
        p->class_id[i] = e->class_id[face];
        p->instance_id[i] = e->instance_id[face];
        p->material[i] = e->material[face];
        if (!p->position)
            continue;
        p->time[i] = e->time[pulse];
        for (int j = 0; j < 3; j++) {
            const double begin = e->begin ? e->begin[j * e->hits + hit] : e->origin[j * e->pulses + pulse];
            const double normal = e->planes[4 * face + j] * side;
            p->scanner[3 * i + j] = begin;
            p->position[3 * i + j] = begin + e->distance[hit] * e->direction[j * e->hits + hit];
            p->normal[3 * i + j] = normal;
            p->narrow_normal[3 * i + j] = (float)normal;
        }
    }
    return 1;
}

EXPORT_WIDE(int, place, (int64_t count, const Echoes *echoes, const Placed *placed), (count, echoes, placed))

/* Writes which surfaces face the sun, and places (3, count) so far off them, by `normal` and `position` (count, 3). */
INLINE void any_face_sun(int64_t count, const double *restrict normal, const double *restrict position,
                         const double *sun, double off, uint8_t *restrict facing, double *restrict begin)
{
    for (int64_t i = 0; i < count; i++) {
        const double *n = normal + 3 * i;
        facing[i] = sun[0] * n[0] + sun[1] * n[1] + sun[2] * n[2] > 0.0;
        for (int j = 0; j < 3; j++)
            begin[j * count + i] = n[j] * off + position[3 * i + j];
    }
}

EXPORT_WIDE(void, face_sun,
            (int64_t count, const double *normal, const double *position, const double *sun, double off,
             uint8_t *facing, double *begin),
            (count, normal, position, sun, off, facing, begin))
