/* Rays of pulses, what they are cast at, and the planes of faces: what pulses.c, moving.c and packets.c have in common. */
#ifndef SYNTHROADS_RAYS_H
#define SYNTHROADS_RAYS_H

#include "kernel.h"

#define INFINITE __builtin_inf()
#define BUFFER 1024 /* rays cast at once out of many: whole packets of any width */

/* Rays, row by row; as `_Rays` in packets.py. */
typedef struct {
    const float *origin, *direction; /* 3 numbers per ray */
    const float *limit;              /* range within which a hit counts, m */
    int64_t limit_step;              /* 1: a limit per ray; 0: one for all */
} CastRays;

/* packets.c's synthroads_cast. */
typedef void (*Cast)(void *casts, void *scene, int64_t count, const CastRays *rays, int32_t *found);

/* The rays of a pulse; as `Shape` in beams.py. */
typedef struct {
    int64_t rays;                                      /* K per pulse */
    const double *stretch, *in_plane, *across, *share; /* (K): factors on axis and beam's axes; energy */
    int32_t parallel;                                  /* 1: they begin side by side; 0: they diverge */
} Shape;

/* P pulses; as `Beams` in beams.py. (3, P) each, and (P). Of parallel rays the beam's axes are as long as its range. */
typedef struct {
    int64_t pulses;
    const double *origin, *direction, *in_plane, *across, *time;
} Beams;

/* A ray of a pulse. */
typedef struct {
    double origin[3], direction[3];
} Ray;

INLINE Ray ray_of(const Shape *shape, const Beams *beams, int64_t k, int64_t p)
{
    Ray ray;
    for (int i = 0; i < 3; i++) {
        int64_t at = i * beams->pulses + p;
        ray.origin[i] = beams->origin[at];
        ray.direction[i] = beams->direction[at];
        if (shape->rays > 1 && shape->parallel) {
            ray.origin[i] += beams->in_plane[at] * shape->in_plane[k] + beams->across[at] * shape->across[k];
        } else if (shape->rays > 1) {
            ray.direction[i] = ray.direction[i] * shape->stretch[k] + beams->in_plane[at] * shape->in_plane[k];
            ray.direction[i] += beams->across[at] * shape->across[k];
        }
    }
    return ray;
}

/* FacePlanes.intersect: the range to the plane of a face, and n . d. `planes`: (faces, 4). */
INLINE double range_to(const double *planes, int32_t face, const double *origin, const double *direction,
                       double *along)
{
    const double *plane = planes + 4 * (int64_t)face;
    double height = plane[3] - plane[0] * origin[0], product = plane[0] * direction[0];
    for (int i = 1; i < 3; i++) {
        product += plane[i] * direction[i];
        height -= plane[i] * origin[i];
    }
    *along = product;
    return height / product;
}

INLINE int finite(double x)
{
    return x > -INFINITE && x < INFINITE;
}

#endif
