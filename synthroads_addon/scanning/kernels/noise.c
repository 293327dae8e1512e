/* base.noise.noise_field: the same sums of octaves of value noise, operation by operation, for places side by side. */
#include "kernel.h"

#define LANES 32
#define FAR 2251799813685248.0     /* beyond it, halves can't be told from whole numbers */
#define SHIFT 6755399441055744.0   /* its sum with a number has that number's whole part in its lowest bits */

typedef union {
    double number;
    uint64_t bits;
} Double;

/* Writes the whole part of coordinates, as its lower bits, and what is beyond it. */
INLINE void part_coordinates(const double *restrict coordinate, uint32_t *restrict node, float *restrict share)
{
    int near = 1;
    for (int i = 0; i < LANES; i++) {
        Double sum;
        const double x = coordinate[i];
        sum.number = x + SHIFT;
        double whole = sum.number - SHIFT;
        const uint32_t over = whole > x;
        node[i] = (uint32_t)sum.bits - over;
        whole -= (double)over;
        share[i] = (float)(x - whole);
        near &= (x > -FAR) & (x < FAR);
    }
    if (near)
        return;
    for (int i = 0; i < LANES; i++) {
        const double x = coordinate[i];
        double whole = x;
        if (x > -2.0 * FAR && x < 2.0 * FAR) {
            whole = (double)(int64_t)x;
            whole -= (double)(whole > x);
        }
        node[i] = low_bits(whole);
        share[i] = (float)(x - whole);
    }
}

/* Turns shares of a cell into the weights of the nodes below and above. */
INLINE void weigh_nodes(const float *restrict share, float *restrict below, float *restrict above)
{
    for (int i = 0; i < LANES; i++) {
        float t = share[i], high = t * t;
        t *= -2.0f;
        t += 3.0f;
        high *= t;
        const float low = 1.0f - high, square = low * low;
        float scale = high * high;
        scale += square;
        scale = 1.0f / __builtin_sqrtf(scale);
        below[i] = low * scale;
        above[i] = high * scale;
    }
}

INLINE float value_of(uint32_t node)
{
    return (float)(int32_t)(mix_bits(node) * 0x846CA68Bu) * 0x1.bb67aep-31f; /* the root of 3 over 2^31 */
}

INLINE void add_octave(uint32_t key, float gain, const uint32_t *restrict x, const uint32_t *restrict y,
                       const uint32_t *restrict z, float (*restrict weight)[LANES], const float *restrict deviation,
                       float *restrict total)
{
    const uint32_t step_x = 0x9E3779B1u, step_y = 0x85EBCA77u, step_z = 0xC2B2AE3Du;
    for (int i = 0; i < LANES; i++) {
        float plane[2];
        for (int a = 0; a < 2; a++) {
            const uint32_t of_x = mix_bits(key + x[i] * step_x + (a ? step_x : 0u));
            float line[2];
            for (int b = 0; b < 2; b++) {
                const uint32_t of_y = mix_bits(of_x + y[i] * step_y + (b ? step_y : 0u)), of_z = of_y + z[i] * step_z;
                line[b] = value_of(of_z) * weight[4][i] + value_of(of_z + step_z) * weight[5][i];
            }
            plane[a] = line[0] * weight[2][i] + line[1] * weight[3][i];
        }
        const float octave = gain * (plane[0] * weight[0][i] + plane[1] * weight[1][i]);
        total[i] += deviation ? octave * deviation[i] : octave;
    }
}

/* Writes the field at places (count, 3). `cells`: per metre, one for all if `cells_step` is 0; `patch`: deviations
 * (count) along the two axes of patches, m, or none; `spread`: 2 over the squared length of correlation, in cells. */
INLINE void any_noise(int64_t count, const double *position, const double *cells, int64_t cells_step,
                      const uint32_t *keys, const float *gains, int64_t octaves, const double *along,
                      const double *across, double spread, double *result)
{
    double point[3][LANES], patch[2][LANES];
    float total[LANES], share[LANES], weight[6][LANES], deviation[LANES];
    uint32_t node[3][LANES];
    for (int64_t first = 0; first < count; first += LANES) {
        const int some = count - first < LANES ? (int)(count - first) : LANES;
        for (int i = 0; i < LANES; i++) {
            const int64_t at = first + (i < some ? i : 0); /* lanes that are left over repeat the first place */
            const double scale = cells[at * cells_step];
            for (int axis = 0; axis < 3; axis++)
                point[axis][i] = position[3 * at + axis] * scale;
            patch[0][i] = along ? along[at] * scale : 0.0;
            patch[1][i] = along ? across[at] * scale : 0.0;
            total[i] = 0.0f;
        }
        for (int64_t octave = 0; octave < octaves; octave++) {
            for (int i = 0; i < LANES; i++) {
                const double x = point[0][i], y = point[1][i], z = point[2][i];
                point[0][i] = (15.0 * x + y * 6.0 + z * -10.0) / 19.0;
                point[1][i] = (6.0 * x + y * 10.0 + z * 15.0) / 19.0;
                point[2][i] = (10.0 * x + y * -15.0 + z * 6.0) / 19.0;
            }
            for (int axis = 0; axis < 3; axis++) {
                part_coordinates(point[axis], node[axis], share);
                weigh_nodes(share, weight[2 * axis], weight[2 * axis + 1]);
            }
            for (int i = 0; along && i < LANES; i++) {
                const double wide = 1.0 + spread * (patch[0][i] * patch[0][i]);
                const double both = wide * (1.0 + spread * (patch[1][i] * patch[1][i]));
                deviation[i] = (float)(1.0 / __builtin_sqrt(__builtin_sqrt(both)));
                patch[0][i] *= 2.0;
                patch[1][i] *= 2.0;
            }
            add_octave(keys[octave], gains[octave], node[0], node[1], node[2], weight, along ? deviation : NULL,
                            total);
            for (int i = 0; i < LANES; i++)
                point[0][i] *= 2.0, point[1][i] *= 2.0, point[2][i] *= 2.0;
        }
        for (int i = 0; i < some; i++)
            result[first + i] = total[i];
    }
}

EXPORT_WIDE(void, noise,
            (int64_t count, const double *position, const double *cells, int64_t cells_step, const uint32_t *keys,
             const float *gains, int64_t octaves, const double *along, const double *across, double spread,
             double *result),
            (count, position, cells, cells_step, keys, gains, octaves, along, across, spread, result))
