/* Noise: the hash that all random numbers come from, Perlin's noise, and its octaves added up. */
#pragma once

#include "numbers.h"

/* Bob Jenkins' hash (lookup3). */

#define ROTATE(x, k) (((x) << (k)) | ((x) >> (32 - (k))))

INLINE uint32_t final_hash(uint32_t a, uint32_t b, uint32_t c)
{
    c ^= b, c -= ROTATE(b, 14);
    a ^= c, a -= ROTATE(c, 11);
    b ^= a, b -= ROTATE(a, 25);
    c ^= b, c -= ROTATE(b, 16);
    a ^= c, a -= ROTATE(c, 4);
    b ^= a, b -= ROTATE(a, 14);
    c ^= b, c -= ROTATE(b, 24);
    return c;
}

#define SEED(n) (0xDEADBEEFu + ((n) << 2) + 13u)

INLINE uint32_t hash1(uint32_t x)
{
    return final_hash(SEED(1u) + x, SEED(1u), SEED(1u));
}

INLINE uint32_t hash2(uint32_t x, uint32_t y)
{
    return final_hash(SEED(2u) + x, SEED(2u) + y, SEED(2u));
}

INLINE uint32_t hash3(uint32_t x, uint32_t y, uint32_t z)
{
    return final_hash(SEED(3u) + x, SEED(3u) + y, SEED(3u) + z);
}

INLINE uint32_t hash4(uint32_t x, uint32_t y, uint32_t z, uint32_t w)
{
    uint32_t a = SEED(4u) + x, b = SEED(4u) + y, c = SEED(4u) + z;
    a -= c, a ^= ROTATE(c, 4), c += b;
    b -= a, b ^= ROTATE(a, 6), a += c;
    c -= b, c ^= ROTATE(b, 8), b += a;
    a -= c, a ^= ROTATE(c, 16), c += b;
    b -= a, b ^= ROTATE(a, 19), a += c;
    c -= b, c ^= ROTATE(b, 4), b += a;
    return final_hash(a + w, b, c);
}

/* uint32 to float through two halves, as there is no instruction for it before AVX-512; rounded once, as that one. */
INLINE float share(uint32_t n)
{
    double value = (double)(int32_t)(n >> 1) * 2.0 + (double)(int32_t)(n & 1);
    return (float)value * (1.0f / 4294967296.0f);
}

/* Perlin's noise, from -1 to 1. */

INLINE float fade(float t)
{
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

INLINE float signed_by(float x, uint32_t hash, int bit)
{
    return float_of(bits_of(x) ^ ((hash >> bit) << 31));
}

INLINE float gradient1(uint32_t h, float x)
{
    return signed_by(1.0f + (float)(int32_t)(h & 7), h, 3) * x;
}

INLINE float gradient2(uint32_t h, float x, float y)
{
    h &= 7;
    float u = h < 4 ? x : y, v = 2.0f * (h < 4 ? y : x);
    return signed_by(u, h, 0) + signed_by(v, h, 1);
}

INLINE float gradient3(uint32_t h, float x, float y, float z)
{
    h &= 15;
    float u = h < 8 ? x : y, t = (h & 13) == 12 ? x : z, v = h < 4 ? y : t;
    return signed_by(u, h, 0) + signed_by(v, h, 1);
}

INLINE float gradient4(uint32_t h, float x, float y, float z, float w)
{
    h &= 31;
    float u = h < 24 ? x : y, v = h < 16 ? y : z, s = h < 8 ? z : w;
    return signed_by(u, h, 0) + signed_by(v, h, 1) + signed_by(s, h, 2);
}

/* Noise repeats itself every 100 km, as floats have too few digits for more. */
INLINE float wrapped(float x)
{
    float far = absolute(x) >= 1000000.0f ? 0.5f : 0.0f;
    return x - 100000.0f * truncated(x / 100000.0f) + far;
}

INLINE float perlin1(float x)
{
    float X = floored(x), f = x - X;
    uint32_t a = (uint32_t)(int32_t)X;
    return 0.25f * mix(gradient1(hash1(a), f), gradient1(hash1(a + 1), f - 1.0f), fade(f));
}

INLINE float perlin2(float x, float y)
{
    float X = floored(x), Y = floored(y), f = x - X, g = y - Y;
    uint32_t a = (uint32_t)(int32_t)X, b = (uint32_t)(int32_t)Y;
    float u = fade(f), v = fade(g), f1 = f - 1.0f, g1 = g - 1.0f;
    float low = mix(gradient2(hash2(a, b), f, g), gradient2(hash2(a + 1, b), f1, g), u);
    float high = mix(gradient2(hash2(a, b + 1), f, g1), gradient2(hash2(a + 1, b + 1), f1, g1), u);
    return 0.6616f * mix(low, high, v);
}

INLINE float perlin3(float x, float y, float z)
{
    float X = floored(x), Y = floored(y), Z = floored(z), f = x - X, g = y - Y, h = z - Z;
    uint32_t a = (uint32_t)(int32_t)X, b = (uint32_t)(int32_t)Y, c = (uint32_t)(int32_t)Z;
    float u = fade(f), v = fade(g), w = fade(h), f1 = f - 1.0f, g1 = g - 1.0f, h1 = h - 1.0f;
    float a00 = mix(gradient3(hash3(a, b, c), f, g, h), gradient3(hash3(a + 1, b, c), f1, g, h), u);
    float a10 = mix(gradient3(hash3(a, b + 1, c), f, g1, h), gradient3(hash3(a + 1, b + 1, c), f1, g1, h), u);
    float a01 = mix(gradient3(hash3(a, b, c + 1), f, g, h1), gradient3(hash3(a + 1, b, c + 1), f1, g, h1), u);
    float a11 =
        mix(gradient3(hash3(a, b + 1, c + 1), f, g1, h1), gradient3(hash3(a + 1, b + 1, c + 1), f1, g1, h1), u);
    return 0.9820f * mix(mix(a00, a10, v), mix(a01, a11, v), w);
}

static float cube4(uint32_t a, uint32_t b, uint32_t c, uint32_t d, float f, float g, float h, float i, float u, float v,
                   float w)
{
    float side[4];
    for (uint32_t k = 0; k < 4; k++) {
        uint32_t p = b + (k & 1), q = c + (k >> 1);
        float y = k & 1 ? g - 1.0f : g, z = k >> 1 ? h - 1.0f : h;
        side[k] = mix(gradient4(hash4(a, p, q, d), f, y, z, i), gradient4(hash4(a + 1, p, q, d), f - 1.0f, y, z, i), u);
    }
    return mix(mix(side[0], side[1], v), mix(side[2], side[3], v), w);
}

static float perlin4(float x, float y, float z, float w)
{
    float X = floored(x), Y = floored(y), Z = floored(z), W = floored(w), f = x - X, g = y - Y, h = z - Z, i = w - W;
    uint32_t a = (uint32_t)(int32_t)X, b = (uint32_t)(int32_t)Y, c = (uint32_t)(int32_t)Z, d = (uint32_t)(int32_t)W;
    float u = fade(f), v = fade(g), t = fade(h);
    float low = cube4(a, b, c, d, f, g, h, i, u, v, t);
    return 0.8344f * mix(low, cube4(a, b, c, d + 1, f, g, h, i - 1.0f, u, v, t), fade(i));
}

/* One octave: `out` of `place` (registers of its coordinates) times the lanes' scales. */
static void seldom_octave(float *restrict out, const float *const *place, const float *restrict scale, int dimensions)
{
    const float *restrict x = place[0], *restrict y = place[1], *restrict z = place[2], *restrict w = place[3];
    if (dimensions == 1)
        EACH out[l] = perlin1(wrapped(scale[l] * x[l]));
    else if (dimensions == 2)
        EACH out[l] = perlin2(wrapped(scale[l] * x[l]), wrapped(scale[l] * y[l]));
    else
        for (int l = 0; l < LANES; l++)
            out[l] = perlin4(wrapped(scale[l] * x[l]), wrapped(scale[l] * y[l]), wrapped(scale[l] * z[l]),
                             wrapped(scale[l] * w[l]));
}

INLINE void octave3(float *restrict out, const float *const *place, const float *restrict scale)
{
    const float *restrict x = place[0], *restrict y = place[1], *restrict z = place[2];
    EACH out[l] = perlin3(wrapped(scale[l] * x[l]), wrapped(scale[l] * y[l]), wrapped(scale[l] * z[l]));
}

static void octave3_usual(float *restrict out, const float *const *place, const float *restrict scale)
{
    octave3(out, place, scale);
}

typedef void (*Octave)(float *, const float *const *, const float *);

/* How octaves are added up. */
typedef struct {
    const float *detail, *roughness, *lacunarity, *offset, *gain;
    int dimensions, kind, normalized;
} Fractal;

enum { MULTIFRACTAL, FBM, HYBRID, RIDGED, HETERO };

/* Octaves added up in each lane, as many as its `detail` says. `spare` are five registers. */
INLINE void brownian(float *restrict out, const float *const *place, const Fractal *fractal, float *spare,
                     Octave octave)
{
    float *restrict scale = spare, *restrict amplitude = spare + LANES, *restrict sum = spare + 2 * LANES,
          *restrict most = spare + 3 * LANES, *restrict done = spare + 4 * LANES;
    const float *restrict detail = fractal->detail, *restrict roughness = fractal->roughness,
                *restrict lacunarity = fractal->lacunarity;
    const int normalized = fractal->normalized;
    float octaves = 0.0f;
    for (int l = 0; l < LANES; l++) {
        octaves = larger(octaves, ceiled(detail[l]));
        scale[l] = amplitude[l] = 1.0f;
        sum[l] = most[l] = done[l] = 0.0f;
    }
    int last = (int)octaves;
    for (int n = 0; n <= last; n++) {
        if (fractal->dimensions == 3)
            octave(out, place, scale);
        else
            seldom_octave(out, place, scale, fractal->dimensions);
        float number = (float)n;
        EACH
        {
            float steps = truncated(detail[l]), rest = detail[l] - steps;
            float next = sum[l] + out[l] * amplitude[l], above = most[l] + amplitude[l];
            int inside = number <= steps, between = (number == steps + 1.0f) & (rest != 0.0f);
            float scaled = mix(0.5f * sum[l] / most[l] + 0.5f, 0.5f * next / above + 0.5f, rest);
            float mixed = normalized ? scaled : mix(sum[l], next, rest);
            done[l] = between ? 1.0f : done[l];
            sum[l] = inside ? next : between ? mixed : sum[l];
            most[l] = inside ? above : most[l];
            amplitude[l] = amplitude[l] * roughness[l];
            scale[l] = scale[l] * lacunarity[l];
        }
    }
    EACH
    {
        float scaled = 0.5f * sum[l] / most[l] + 0.5f;
        out[l] = normalized && done[l] == 0.0f ? scaled : sum[l];
    }
}

/* The other ways to add them up: their places grow from octave to octave. `spare` are eight registers. */
static void seldom_fractal(float *restrict out, const float *const *place, const Fractal *fractal, float *spare)
{
    float *amplitude = spare, *sum = spare + LANES, *weight = spare + 2 * LANES, *one = spare + 3 * LANES;
    float *moved = spare + 4 * LANES;
    const float *const own[4] = {moved, moved + LANES, moved + 2 * LANES, moved + 3 * LANES};
    const int kind = fractal->kind, later = kind == HETERO || kind == RIDGED;
    float octaves = 0.0f;
    for (int l = 0; l < LANES; l++) {
        octaves = larger(octaves, ceiled(fractal->detail[l]));
        one[l] = weight[l] = 1.0f;
        amplitude[l] = later ? fractal->roughness[l] : 1.0f;
        sum[l] = kind == MULTIFRACTAL ? 1.0f : 0.0f;
        for (int k = 0; k < fractal->dimensions; k++)
            moved[k * LANES + l] = place[k][l];
    }
    int last = (int)octaves;
    for (int n = 0; n <= last; n++) {
        if (fractal->dimensions == 3)
            octave3_usual(out, own, one);
        else
            seldom_octave(out, own, one, fractal->dimensions);
        for (int l = 0; l < LANES; l++) {
            float number = (float)n, steps = truncated(fractal->detail[l]), rest = fractal->detail[l] - steps;
            float offset = fractal->offset[l], gain = fractal->gain[l];
            int inside = number <= steps, between = number == steps + 1.0f && rest != 0.0f;
            float part = inside ? 1.0f : rest;
            if (kind == MULTIFRACTAL && (inside || between)) {
                sum[l] *= (inside ? amplitude[l] : rest * amplitude[l]) * out[l] + 1.0f;
            } else if (kind == HETERO && (inside || between)) {
                float more = (out[l] + offset) * amplitude[l] * sum[l];
                sum[l] = n == 0 ? offset + out[l] : sum[l] + part * more;
            } else if (kind == HYBRID && (inside || between) && weight[l] > 0.001f) {
                float strength = smaller(weight[l], 1.0f), signal = (out[l] + offset) * amplitude[l];
                sum[l] += part * strength * signal;
                weight[l] = inside ? strength * (gain * signal) : weight[l];
            } else if (kind == RIDGED && inside) {
                float signal = offset - absolute(out[l]);
                signal *= signal;
                signal *= n == 0 ? 1.0f : clamp(weight[l] * gain, 0.0f, 1.0f);
                weight[l] = signal;
                sum[l] += n == 0 ? signal : signal * amplitude[l];
            }
            amplitude[l] *= later && n == 0 ? 1.0f : fractal->roughness[l];
            for (int k = 0; k < fractal->dimensions; k++)
                moved[k * LANES + l] *= fractal->lacunarity[l];
        }
    }
    for (int l = 0; l < LANES; l++)
        out[l] = sum[l];
}
