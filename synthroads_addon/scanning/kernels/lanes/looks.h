/* What is looked up or made of squares: images, ramps, colours in other ways to write them, checkers and bricks. */
#pragma once

#include "numbers.h"

/* An image; as `_Picture` in materials.py. */
typedef struct {
    const void *pixels; /* 4 numbers per pixel, the lowest row first */
    int32_t width, height;
    int32_t interpolation; /* 0 closest, 1 linear, 2 cubic */
    int32_t extension;     /* 0 repeat, 1 extend, 2 clip, 3 mirror */
    int32_t bytes;         /* 1: numbers are bytes, of which 255 is 1; 0: floats */
} Picture;

/* Images. */

INLINE int32_t pixel_of(int32_t at, int32_t size, int extension)
{
    switch (extension) {
    case 0:
        at %= size;
        return at < 0 ? at + size : at;
    case 1:
        return at < 0 ? 0 : at >= size ? size - 1 : at;
    case 2:
        return at < 0 || at >= size ? -1 : at;
    default: {
        int32_t m = at + (at < 0);
        m = (m < 0 ? -m : m) % (2 * size);
        return m >= size ? 2 * size - m - 1 : m;
    }
    }
}

/* Columns (or rows) that a place lies between, and their weights. */
static int neighbours(float at, int32_t size, const Picture *picture, int32_t *pixels, float *weights)
{
    float place = at * (float)size - (picture->interpolation ? 0.5f : 0.0f);
    /* What lies beyond all pixels is as far away as a number of 30 bits can say. */
    place = place != place ? 0.0f : clamp(place, -1073741824.0f, 1073741824.0f);
    int32_t low = (int32_t)place - (place < 0.0f); /* one too low below 0 at whole numbers, as Cycles has it */
    float t = place - (float)low;
    switch (picture->interpolation) {
    case 0:
        pixels[0] = pixel_of(low, size, picture->extension);
        weights[0] = 1.0f;
        return 1;
    case 1:
        for (int k = 0; k < 2; k++)
            pixels[k] = pixel_of(low + k, size, picture->extension);
        weights[0] = 1.0f - t, weights[1] = t;
        return 2;
    default:
        for (int k = 0; k < 4; k++)
            pixels[k] = pixel_of(low + k - 1, size, picture->extension);
        weights[0] = (((-1.0f / 6.0f) * t + 0.5f) * t - 0.5f) * t + (1.0f / 6.0f);
        weights[1] = ((0.5f * t - 1.0f) * t) * t + (2.0f / 3.0f);
        weights[2] = ((-0.5f * t + 0.5f) * t + 0.5f) * t + (1.0f / 6.0f);
        weights[3] = (1.0f / 6.0f) * t * t * t;
        return 4;
    }
}

static void look_up(const Picture *picture, float u, float v, float *result)
{
    int32_t columns[4], rows[4];
    float across[4], up[4];
    int wide = neighbours(u, picture->width, picture, columns, across);
    int high = neighbours(v, picture->height, picture, rows, up);
    float color[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    for (int row = 0; row < high; row++)
        for (int column = 0; column < wide; column++) {
            if (rows[row] < 0 || columns[column] < 0)
                continue;
            int64_t at = 4 * ((int64_t)rows[row] * picture->width + columns[column]);
            float weight = up[row] * across[column];
            for (int k = 0; k < 4; k++) {
                float value = picture->bytes ? (float)((const uint8_t *)picture->pixels)[at + k] * (1.0f / 255.0f)
                                             : ((const float *)picture->pixels)[at + k];
                color[k] = wide == 1 ? value : color[k] + weight * value;
            }
        }
    for (int k = 0; k < 4; k++)
        result[k * LANES] = color[k];
}

/* A table's value at a place from 0 to 1. */
INLINE float ramp(const float *table, float at, int size, int interpolate, int extrapolate)
{
    if (extrapolate && (at < 0.0f || at > 1.0f)) {
        float end = table[at < 0.0f ? 0 : size - 1], next = table[at < 0.0f ? 1 : size - 2];
        return end + (end - next) * (at < 0.0f ? -at : at - 1.0f) * (float)(size - 1);
    }
    float place = clamp(at, 0.0f, 1.0f) * (float)(size - 1);
    int32_t number = place == place ? (int32_t)place : 0;
    number = number < 0 ? 0 : number >= size ? size - 1 : number;
    float t = place - (float)number, value = table[number];
    return interpolate && t > 0.0f ? (1.0f - t) * value + t * table[number + 1] : value;
}

/* Colours. */

static void to_hsv(const float *rgb, float *hsv)
{
    float most = larger(rgb[0], larger(rgb[1], rgb[2])), least = smaller(rgb[0], smaller(rgb[1], rgb[2]));
    float range = most - least, s = most != 0.0f ? range / most : 0.0f, h = 0.0f;
    if (s != 0.0f) {
        float r = (most - rgb[0]) / range, g = (most - rgb[1]) / range, b = (most - rgb[2]) / range;
        h = (rgb[0] == most ? b - g : rgb[1] == most ? 2.0f + r - b : 4.0f + g - r) / 6.0f;
        h = h < 0.0f ? h + 1.0f : h;
    }
    hsv[0] = h, hsv[1] = s, hsv[2] = most;
}

static void from_hsv(const float *hsv, float *rgb)
{
    float h = hsv[0] == 1.0f ? 0.0f : hsv[0] * 6.0f, s = hsv[1], v = hsv[2], i = floored(h), f = h - i;
    float p = v * (1.0f - s), q = v * (1.0f - s * f), t = v * (1.0f - s * (1.0f - f));
    if (s == 0.0f)
        rgb[0] = rgb[1] = rgb[2] = v;
    else if (i == 0.0f)
        rgb[0] = v, rgb[1] = t, rgb[2] = p;
    else if (i == 1.0f)
        rgb[0] = q, rgb[1] = v, rgb[2] = p;
    else if (i == 2.0f)
        rgb[0] = p, rgb[1] = v, rgb[2] = t;
    else if (i == 3.0f)
        rgb[0] = p, rgb[1] = q, rgb[2] = v;
    else if (i == 4.0f)
        rgb[0] = t, rgb[1] = p, rgb[2] = v;
    else
        rgb[0] = v, rgb[1] = p, rgb[2] = q;
}

static void to_hsl(const float *rgb, float *hsl)
{
    float most = larger(rgb[0], larger(rgb[1], rgb[2])), least = smaller(rgb[0], smaller(rgb[1], rgb[2]));
    float l = smaller(1.0f, (most + least) / 2.0f), h = 0.0f, s = 0.0f;
    if (most != least) {
        float range = most - least;
        s = l > 0.5f ? range / (2.0f - most - least) : range / (most + least);
        if (most == rgb[0])
            h = (rgb[1] - rgb[2]) / range + (rgb[1] < rgb[2] ? 6.0f : 0.0f);
        else if (most == rgb[1])
            h = (rgb[2] - rgb[0]) / range + 2.0f;
        else
            h = (rgb[0] - rgb[1]) / range + 4.0f;
    }
    hsl[0] = h / 6.0f, hsl[1] = s, hsl[2] = l;
}

static void from_hsl(const float *hsl, float *rgb)
{
    float h = hsl[0] * 6.0f, chroma = (1.0f - absolute(2.0f * hsl[2] - 1.0f)) * hsl[1];
    float r = absolute(h - 3.0f) - 1.0f, g = 2.0f - absolute(h - 2.0f), b = 2.0f - absolute(h - 4.0f);
    rgb[0] = (clamp(r, 0.0f, 1.0f) - 0.5f) * chroma + hsl[2];
    rgb[1] = (clamp(g, 0.0f, 1.0f) - 0.5f) * chroma + hsl[2];
    rgb[2] = (clamp(b, 0.0f, 1.0f) - 0.5f) * chroma + hsl[2];
}

INLINE float to_linear(float c)
{
    float high = power((larger(c, 0.0f) + 0.055f) * (1.0f / 1.055f), 2.4f);
    return c < 0.04045f ? (c < 0.0f ? 0.0f : c * (1.0f / 12.92f)) : high;
}

/* Textures of squares and bricks. */

INLINE int32_t odd(float x)
{
    return whole(floored((x + 0.000001f) * 0.999999f)) & 1;
}

static float tint_of(uint32_t n)
{
    n = (n + 1013u) & 0x7FFFFFFFu;
    n = (n >> 13) ^ n;
    n = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7FFFFFFFu;
    return 0.5f * ((float)(int32_t)n / 1073741824.0f);
}

typedef struct {
    float offset, squash;
    int32_t offset_frequency, squash_frequency;
    int32_t fused; /* places in a brick are rounded once */
} Bond;

/* Writes a brick's tint, and the share of mortar. */
static void brick(float x, float y, float mortar, float smooth, float bias, float width, float height, Bond bond,
                  float *result)
{
    int32_t row = whole(floored(y / height));
    float shift = 0.0f;
    if (bond.offset_frequency && bond.squash_frequency) {
        width *= row % bond.squash_frequency ? 1.0f : bond.squash;
        shift = row % bond.offset_frequency ? 0.0f : width * bond.offset;
    }
    int32_t number = whole(floored((x + shift) / width));
    float across = (x + shift) - width * (float)number, up = y - height * (float)row;
    if (bond.fused) {
        across = (float)((double)(x + shift) - (double)width * number);
        up = (float)((double)y - (double)height * row);
    }
    result[0] = clamp(tint_of(((uint32_t)row << 16) + ((uint32_t)number & 0xFFFFu)) + bias, 0.0f, 1.0f);
    float edge = smaller(smaller(across, up), smaller(width - across, height - up));
    if (edge >= mortar)
        result[LANES] = 0.0f;
    else if (smooth == 0.0f)
        result[LANES] = 1.0f;
    else {
        float t = clamp((1.0f - edge / mortar) / smooth, 0.0f, 1.0f), square = t * t;
        result[LANES] = 3.0f * square - 2.0f * square * t;
    }
}
