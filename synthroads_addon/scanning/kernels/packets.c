/* Casts many rays at a scene of Embree 4 in one call: in packets of the processor's width, or one by one.
 *
 * Embree's headers aren't needed: its functions come as pointers, and the few structures that they take are written
 * down here as Embree 4.4 has them (rtcore_ray.h, rtcore_common.h). packets.py checks the version, and compares what
 * comes out with single rays before any of it is used.
 *
 * Rays that run side by side are cast together, with the flag that says so; the others one by one, as Embree is slower
 * with packets of those. So it is where nearly every ray meets another face, as in a fine mesh: the packet before tells.
 * Rays are packed in the order in which they come, from the first of a call on: what a ray meets depends on the call
 * alone, never on threads.
 */
#include "rays.h"

#define INVALID 0xFFFFFFFFu
#define EVERY_FEATURE 0xFFFFFFFFu
#define WIDEST 16
#define LEAST_COMPONENT 1e-18f
/* Embree takes smaller components of directions for this number, a positive one. A packet that is followed together goes
 * by the signs that the components had before, and loses faces where negative ones so small stand beside larger ones. */

/* Rows of RTCRayHit4, 8 and 16, a number per ray in each; RTCRayHit is one of width 1, RTCRay ends before NORMAL. */
enum {
    ORIGIN = 0, NEAR = 3, DIRECTION = 4, TIME = 7, FAR = 8, MASK = 9, ID = 10, FLAGS = 11,
    NORMAL = 12, U = 15, V = 16, PRIMITIVE = 17, GEOMETRY = 18, INSTANCE = 19, INSTANCE_PRIMITIVE = 20, ROWS = 21
};

typedef union {
    float f;
    uint32_t u;
} Number;

/* RTCIntersectArguments and RTCOccludedArguments. */
typedef struct {
    uint32_t flags, features;
    void *context, *filter, *function;
    float minimum_width_factor;
} Arguments;

typedef void (*CastOne)(void *scene, void *ray, void *arguments);
typedef void (*CastPacket)(const int32_t *valid, void *scene, void *rays, void *arguments);

/* How rays are cast; as `_Casts` in packets.py. */
typedef struct {
    CastOne one;
    CastPacket packet;
    int32_t width;      /* rays per packet: 4, 8 or 16 */
    int32_t occluded;   /* 1: only whether a ray meets anything is asked; the functions are rtcOccluded's */
    uint32_t flags;     /* RTCRayQueryFlags of packets */
    float least_cosine; /* of the angles between the rays of a packet and its first */
    float widest;       /* distance of the rays' origins from that of the first, m */
    int32_t most_changes; /* of the face from one ray to the next, in the rays before that would have been a packet */
    int32_t changes;    /* in those; from call to call, where rays are cast by several */
} Casts;

/* Fills in what all rays have alike, and Embree leaves as it is. */
INLINE void prepare(Number *packet, const int width)
{
    for (int j = 0; j < width; j++) {
        packet[NEAR * width + j].f = packet[TIME * width + j].f = 0.0f;
        packet[MASK * width + j].u = INVALID;
        packet[ID * width + j].u = packet[FLAGS * width + j].u = 0;
        packet[INSTANCE * width + j].u = packet[INSTANCE_PRIMITIVE * width + j].u = INVALID;
    }
}

INLINE void fill(Number *packet, const CastRays *rays, int64_t first, int count, const int width)
{
    for (int j = 0; j < width; j++) {
        int64_t i = first + (j < count ? j : 0); /* lanes that are left over repeat the first ray, and aren't cast */
        for (int k = 0; k < 3; k++) {
            packet[(ORIGIN + k) * width + j].f = rays->origin[3 * i + k];
            float component = rays->direction[3 * i + k];
            int least = width > 1 && component < 0.0f && component > -LEAST_COMPONENT;
            packet[(DIRECTION + k) * width + j].f = least ? 0.0f : component;
        }
        packet[FAR * width + j].f = rays->limit[i * rays->limit_step];
        packet[PRIMITIVE * width + j].u = packet[GEOMETRY * width + j].u = INVALID;
    }
}

INLINE int32_t answer(const Number *packet, int j, int occluded, const int width)
{
    if (occluded)
        return packet[FAR * width + j].f < 0.0f; /* Embree sets it to minus infinity */
    return packet[GEOMETRY * width + j].u == INVALID ? -1 : (int32_t)packet[PRIMITIVE * width + j].u;
}

/* Whether all rays run beside the first; no if anything isn't a number. */
INLINE int coherent(const Number *packet, const Casts *casts, const int width)
{
    int32_t beside = 1;
    for (int j = 1; j < width; j++) {
        float cosine = 0.0f, square = 0.0f;
        for (int k = 0; k < 3; k++) {
            const Number *origin = packet + (ORIGIN + k) * width, *direction = packet + (DIRECTION + k) * width;
            float offset = origin[j].f - origin[0].f;
            cosine += direction[j].f * direction[0].f;
            square += offset * offset;
        }
        beside &= (cosine >= casts->least_cosine) & (square <= casts->widest * casts->widest);
    }
    return beside;
}

INLINE void cast_all(
    Casts *casts, void *scene, int64_t rays_in_all, const CastRays *rays, int32_t *found, const int width)
{
    Number packet[ROWS * WIDEST] __attribute__((aligned(64))), alone[ROWS] __attribute__((aligned(64)));
    int32_t valid[WIDEST] __attribute__((aligned(64)));
    Arguments single = {0, EVERY_FEATURE, NULL, NULL, NULL, 0.0f}, together = single;
    together.flags = casts->flags;
    int32_t changes = casts->changes;
    prepare(packet, width);
    prepare(alone, 1);
    for (int64_t first = 0; first < rays_in_all; first += width) {
        int count = rays_in_all - first < width ? (int)(rays_in_all - first) : width;
        fill(packet, rays, first, count, width);
        if (count > 1 && changes <= casts->most_changes && coherent(packet, casts, width)) {
            for (int j = 0; j < width; j++)
                valid[j] = j < count ? -1 : 0;
            casts->packet(valid, scene, packet, &together);
            for (int j = 0; j < count; j++)
                found[first + j] = answer(packet, j, casts->occluded, width);
        } else {
            for (int j = 0; j < count; j++) {
                fill(alone, rays, first + j, 1, 1);
                casts->one(scene, alone, &single);
                found[first + j] = answer(alone, 0, casts->occluded, 1);
            }
        }
        changes = 0;
        for (int j = 1; j < count; j++)
            changes += found[first + j] != found[first + j - 1];
    }
    casts->changes = changes;
}

/* Writes the number of the first face that each ray meets, -1 for none; or 1 where it meets anything, else 0. */
INLINE void any_cast(Casts *casts, void *scene, int64_t count, const CastRays *rays, int32_t *found)
{
    if (casts->width == 16)
        cast_all(casts, scene, count, rays, found, 16);
    else if (casts->width == 8)
        cast_all(casts, scene, count, rays, found, 8);
    else
        cast_all(casts, scene, count, rays, found, 4);
}

EXPORT_WIDE(void, cast, (Casts *casts, void *scene, int64_t count, const CastRays *rays, int32_t *found),
            (casts, scene, count, rays, found))
