/* What every kernel needs: what its library shows, whether the processor has AVX2, and what it was compiled from.
 *
 * Kernels call nothing of the C library and take no more than a page of stack, so that libraries stand alone.
 */
#ifndef SYNTHROADS_KERNEL_H
#define SYNTHROADS_KERNEL_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#ifndef SOURCE
#define SOURCE "unknown"
#endif

#define INLINE static inline __attribute__((always_inline))

/* Defines synthroads_NAME by an INLINE function any_NAME, compiled for any processor and for those with AVX2. What is
 * wider does the same operations on more numbers at once: the results are the same, bit for bit. For tests the version
 * for any processor is there as synthroads_NAME_narrow as well. */
#if defined(__x86_64__)
#define EXPORT_WIDE(type, name, parameters, arguments) \
    __attribute__((target("avx2"), noinline)) static type wide_##name parameters { return any_##name arguments; } \
    EXPORT type synthroads_##name##_narrow parameters { return any_##name arguments; } \
    EXPORT type synthroads_##name parameters \
    { \
        return has_avx2() ? wide_##name arguments : synthroads_##name##_narrow arguments; \
    }

/* Whether the processor has AVX2, and the system keeps its registers. */
static inline int has_avx2(void)
{
    static int known; /* 0: not yet asked; threads that ask at once find the same */
    if (!known) {
        uint32_t a = 0, b, c = 0, d, low, high;
        int found = 0;
        __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
        const uint32_t leaves = a;
        a = 1, c = 0;
        __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
        if (leaves >= 7 && (c >> 27 & 1) && (c >> 28 & 1)) { /* OSXSAVE, AVX */
            __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
            a = 7, c = 0;
            __asm__ volatile("cpuid" : "+a"(a), "=b"(b), "+c"(c), "=d"(d));
            found = (low & 6) == 6 && (b >> 5 & 1);
        }
        known = found ? 2 : 1;
    }
    return known == 2;
}
#else
#define EXPORT_WIDE(type, name, parameters, arguments) \
    EXPORT type synthroads_##name parameters { return any_##name arguments; }
#endif

/* The lower bits of a whole number as C's conversion to int64 has them on this processor, beyond its range as well. */
INLINE uint32_t low_bits(double whole)
{
    if (whole >= -9223372036854775808.0 && whole < 9223372036854775808.0)
        return (uint32_t)(uint64_t)(int64_t)whole;
#if defined(__aarch64__)
    return whole > 0.0 ? 0xFFFFFFFFu : 0u;
#else
    return 0u;
#endif
}

/* base.noise mixes the bits of hashes so. */
INLINE uint32_t mix_bits(uint32_t node)
{
    node ^= node >> 15;
    node *= 0x7FEB352Du;
    return node ^ (node >> 13);
}

/* The SHA-256 of the source that this was compiled from, for library.py to see whether it is today's. */
EXPORT const char *synthroads_source(void)
{
    return SOURCE;
}

#if defined(_WIN32)
/* Without the C runtime, of which nothing is used, a library has to have this itself. */
int __stdcall DllMainCRTStartup(void *module, unsigned long reason, void *reserved)
{
    (void)module, (void)reason, (void)reserved;
    return 1;
}
#endif

#endif
