/* Numbers of the lanes: what processors and Cycles do to floats, and functions of real numbers without the C library,
 * whose results differ from platform to platform. */
#pragma once

#include "../kernel.h"

#define LANES 64
#define EACH _Pragma("clang loop interleave_count(1) unroll(disable)") for (int l = 0; l < LANES; l++)

typedef union {
    float f;
    uint32_t u;
} Bits;

typedef union {
    double f;
    uint64_t u;
} Bits64;

INLINE uint32_t bits_of(float x)
{
    return ((Bits){.f = x}).u;
}

INLINE float float_of(uint32_t x)
{
    return ((Bits){.u = x}).f;
}

INLINE float absolute(float x)
{
    return float_of(bits_of(x) & 0x7FFFFFFFu);
}

INLINE float smaller(float a, float b)
{
    return a < b ? a : b;
}

INLINE float larger(float a, float b)
{
    return a > b ? a : b;
}

INLINE float truncated(float x)
{
    int small = absolute(x) < 8388608.0f; /* beyond, all floats are whole numbers */
    float t = (float)(int32_t)(small ? x : 0.0f);
    return small ? t : x;
}

INLINE float floored(float x)
{
    float t = truncated(x);
    return t > x ? t - 1.0f : t;
}

INLINE float ceiled(float x)
{
    float t = truncated(x);
    return t < x ? t + 1.0f : t;
}

/* A float as int32, which what doesn't fit must not decide by itself. */
INLINE int32_t whole(float x)
{
    return absolute(x) < 2147483520.0f ? (int32_t)x : INT32_MIN;
}

INLINE float root(float x)
{
    return __builtin_elementwise_sqrt(x);
}

INLINE float safe_divide(float a, float b)
{
    float quotient = a / (b != 0.0f ? b : 1.0f);
    return b != 0.0f ? quotient : 0.0f;
}

INLINE float mix(float a, float b, float t)
{
    return a + t * (b - a);
}

INLINE float clamp(float a, float low, float high)
{
    return smaller(larger(a, low), high);
}

/* Functions of real numbers, in double precision: series whose first term left out is below 1e-11 of the result. */

#define TO_WHOLE 6755399441055744.0 /* 1.5 * 2^52: what is added to it is rounded to a whole number, in its low bits */

INLINE double exponential(double x)
{
    x = x < -200.0 ? -200.0 : x > 200.0 ? 200.0 : x;
    Bits64 k = {.f = x * 1.4426950408889634 + TO_WHOLE};
    double n = k.f - TO_WHOLE;
    double r = (x - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;
    double p = 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    Bits64 result = {.f = p};
    result.u += k.u << 52;
    return result.f;
}

/* Of a number above 0. */
INLINE double logarithm(double x)
{
    Bits64 m = {.f = x};
    int32_t e = (int32_t)(m.u >> 52) - 1023;
    m.u = (m.u & 0x000FFFFFFFFFFFFFull) | 0x3FF0000000000000ull;
    int above = m.f > 1.4142135623730951;
    double f = above ? m.f * 0.5 : m.f;
    double n = (double)(above ? e + 1 : e);
    double s = (f - 1.0) / (f + 1.0), t = s * s;
    double p = 1.0 / 15;
    p = p * t + 1.0 / 13;
    p = p * t + 1.0 / 11;
    p = p * t + 1.0 / 9;
    p = p * t + 1.0 / 7;
    p = p * t + 1.0 / 5;
    p = p * t + 1.0 / 3;
    p = p * t + 1.0;
    return n * 0.69314718055994530942 + 2.0 * s * p;
}

INLINE float power(float a, float b)
{
    float size = absolute(a);
    double p = exponential((double)b * logarithm(size > 0.0f ? size : 1.0f));
    float result = (float)p;
    float half = b * 0.5f;
    int odd = floored(half) != half;
    result = a < 0.0f && odd ? -result : result;
    result = a == 0.0f ? (b > 0.0f ? 0.0f : float_of(0x7F800000u)) : result;
    return b == 0.0f || a == 1.0f ? 1.0f : result;
}

INLINE float safe_power(float a, float b)
{
    float result = power(a, b);
    return a < 0.0f && b != truncated(b) ? 0.0f : result;
}

/* 4 / pi, 32 bits from each byte on. */
static const uint32_t FOUR_OF_PI[24] = {
    0x000000A2u, 0x0000A2F9u, 0x00A2F983u, 0xA2F9836Eu, 0xF9836E4Eu, 0x836E4E44u, 0x6E4E4415u, 0x4E441529u,
    0x441529FCu, 0x1529FC27u, 0x29FC2757u, 0xFC2757D1u, 0x2757D1F5u, 0x57D1F534u, 0xD1F534DDu, 0xF534DDC0u,
    0x34DDC0DBu, 0xDDC0DB62u, 0xC0DB6295u, 0xDB629599u, 0x6295993Cu, 0x95993C43u, 0x993C4390u, 0x3C439041u};

/* What is left of a large angle beyond whole quarter turns, and their number's last bits. */
static double reduced(float angle, int64_t *quarters)
{
    uint32_t u = bits_of(angle) & 0x7FFFFFFFu;
    const uint32_t *digits = FOUR_OF_PI + ((u >> 26) & 15);
    uint32_t m = ((u & 0x7FFFFFu) | 0x800000u) << ((u >> 23) & 7);
    uint64_t high = (uint64_t)(uint32_t)(m * digits[0]) << 32;
    uint64_t product = (high | ((uint64_t)m * digits[8] >> 32)) + (uint64_t)m * digits[4];
    uint64_t n = (product + (1ull << 61)) >> 62;
    product -= n << 62;
    double rest = (double)(int64_t)product * 3.4061215800304947e-19; /* pi / 2^63 */
    int negative = angle < 0.0f;
    *quarters = negative ? -(int64_t)n : (int64_t)n;
    return negative ? -rest : rest;
}

INLINE double sine_of(double r, int64_t quarters)
{
    double t = r * r;
    double s = -1.0 / 1307674368000.0;
    s = s * t + 1.0 / 6227020800.0;
    s = s * t - 1.0 / 39916800;
    s = s * t + 1.0 / 362880;
    s = s * t - 1.0 / 5040;
    s = s * t + 1.0 / 120;
    s = s * t - 1.0 / 6;
    s = s * t * r + r;
    double c = 1.0 / 20922789888000.0;
    c = c * t - 1.0 / 87178291200.0;
    c = c * t + 1.0 / 479001600;
    c = c * t - 1.0 / 3628800;
    c = c * t + 1.0 / 40320;
    c = c * t - 1.0 / 720;
    c = c * t + 1.0 / 24;
    c = c * t - 0.5;
    c = c * t + 1.0;
    double result = quarters & 1 ? c : s;
    return quarters & 2 ? -result : result;
}

#define LARGE_ANGLE 100000.0f

/* The sine of an angle of at most LARGE_ANGLE, after some quarter turns. */
INLINE double near_sine(float angle, int64_t turned)
{
    Bits64 k = {.f = (double)angle * 0.63661977236758134308 + TO_WHOLE};
    double n = k.f - TO_WHOLE;
    double r = ((double)angle - n * 1.57079632673412561417e+00) - n * 6.07710050650619224932e-11;
    return sine_of(r, (int64_t)k.u + turned);
}

static double far_sine(float angle, int64_t turned)
{
    if ((bits_of(angle) & 0x7F800000u) == 0x7F800000u)
        return (double)(angle - angle); /* no number */
    int64_t quarters;
    double r = reduced(angle, &quarters);
    return sine_of(r, quarters + turned);
}

INLINE double arctangent(double x)
{
    double size = x < 0.0 ? -x : x;
    int steep = size > 1.0;
    double t = steep ? 1.0 / size : size;
    int wide = t > 0.41421356237309503;
    double r = wide ? (t - 1.0) / (t + 1.0) : t;
    double s = r * r;
    double p = 1.0 / 29;
    p = 1.0 / 27 - p * s;
    p = 1.0 / 25 - p * s;
    p = 1.0 / 23 - p * s;
    p = 1.0 / 21 - p * s;
    p = 1.0 / 19 - p * s;
    p = 1.0 / 17 - p * s;
    p = 1.0 / 15 - p * s;
    p = 1.0 / 13 - p * s;
    p = 1.0 / 11 - p * s;
    p = 1.0 / 9 - p * s;
    p = 1.0 / 7 - p * s;
    p = 1.0 / 5 - p * s;
    p = 1.0 / 3 - p * s;
    p = 1.0 - p * s;
    p = p * r + (wide ? 0.78539816339744830962 : 0.0);
    p = steep ? 1.57079632679489661923 - p : p;
    return x < 0.0 ? -p : p;
}

/* The angle of (x, y); 0 of (0, 0) to the right, as the C library has it. */
INLINE double angle_of(float y, float x)
{
    double none = (double)x == 0.0 && (double)y == 0.0;
    double p = arctangent((double)y / (x == 0.0f ? (none ? 1.0 : 1e-300) : (double)x));
    int behind = bits_of(x) >> 31 && (x != 0.0f || none);
    double half = bits_of(y) >> 31 ? -3.14159265358979323846 : 3.14159265358979323846;
    p = behind ? p + half : p;
    return p;
}

INLINE double double_root(double x)
{
    return __builtin_elementwise_sqrt(x);
}

INLINE float arcsine(float x)
{
    double a = clamp(x, -1.0f, 1.0f), c = double_root((1.0 - a) * (1.0 + a));
    return (float)(c == 0.0 ? a * 1.57079632679489661923 : arctangent(a / c));
}

INLINE float arccosine(float x)
{
    double a = clamp(x, -1.0f, 1.0f), c = double_root(1.0 + a);
    return (float)(c == 0.0 ? 3.14159265358979323846 : 2.0 * arctangent(double_root(1.0 - a) / c));
}

/* e^x - e^-x, exact for small x too. */
INLINE double twice_sinh(double x)
{
    double e = exponential(x), t = x * x;
    double series = 2.0 * x * (1.0 + t / 6.0 * (1.0 + t / 20.0 * (1.0 + t / 42.0 * (1.0 + t / 72.0))));
    return t < 0.25 ? series : e - 1.0 / e;
}

INLINE double twice_cosh(double x)
{
    double e = exponential(x);
    return e + 1.0 / e;
}

/* What is left of a number after whole multiples of another, with the first one's sign. */
static float remainder_of(float a, float b)
{
    uint32_t x = bits_of(a) & 0x7FFFFFFFu, y = bits_of(b) & 0x7FFFFFFFu, sign = bits_of(a) & 0x80000000u;
    if (y == 0 || x >= 0x7F800000u || y > 0x7F800000u)
        return (a * b) / (a * b);
    if (x < y)
        return a;
    int32_t ex = (int32_t)(x >> 23), ey = (int32_t)(y >> 23);
    uint32_t mx = ex ? (x & 0x7FFFFFu) | 0x800000u : x << 1, my = ey ? (y & 0x7FFFFFu) | 0x800000u : y << 1;
    ex = ex ? ex : 0;
    ey = ey ? ey : 0;
    for (; ex > ey; ex--) {
        if (mx >= my)
            mx -= my;
        mx <<= 1;
    }
    if (mx >= my)
        mx -= my;
    if (mx == 0)
        return float_of(sign);
    for (; mx < 0x800000u; mx <<= 1)
        ey--;
    return ey > 0 ? float_of(sign | ((uint32_t)ey << 23) | (mx & 0x7FFFFFu)) : float_of(sign | (mx >> (1 - ey)));
}
