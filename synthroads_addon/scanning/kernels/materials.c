/* Works out materials at many places: an interpreter of programs that materials.py holds, 64 places at a time.
 *
 * A program is a list of instructions on registers; a register has a number for each of the places that are worked out
 * together (its lanes). What the numbers mean follows Cycles' kernel (Blender), so that both give the same; the shape of
 * a node tree is the compiler's business, see blender/materials/programs.
 *
 * Nothing of the C library is used: its functions differ from platform to platform. Those that are needed are worked
 * out in double precision, which for most numbers gives the nearest float (lanes/numbers.h).
 */
#include "kernel.h"
#include "lanes/cells.h"
#include "lanes/looks.h"
#include "lanes/noise.h"
#include "lanes/numbers.h"

#define WORDS 16

/* Operations, in the order of `Op` in program.py. */
enum {
    LOAD, STORE, ADD, SUBTRACT, MULTIPLY, DIVIDE, SAFE_DIVIDE, MINIMUM, MAXIMUM, LESS, LESS_EQUAL, EQUAL, SELECT,
    ABSOLUTE, NEGATE, FLOOR, CEIL, TRUNCATE, SQRT, SIGN, EXPONENT, LOGARITHM, POWER, SINE, COSINE, TANGENT, ARCSINE,
    ARCCOSINE, ARCTANGENT, ARCTAN2, SINH, COSH, TANH, REMAINDER, HASH, OCTAVE, FRACTAL, VORONOI, IMAGE, RAMP, TO_HSV,
    FROM_HSV, TO_HSL, FROM_HSL, TO_LINEAR, CHECKER, BRICK, MULTIPLY_ADD
};

/* A program; as `_Program` in materials.py. */
typedef struct {
    const int32_t *code; /* WORDS numbers per instruction: what, where to, and what of */
    const float *tables;
    const Picture *pictures;
    int32_t uniform; /* instructions at the front that give the same everywhere */
    int32_t whole;   /* all instructions */
    int32_t scratch; /* register from which on operations may use registers themselves */
} Program;

/* Places; as `_Places` in materials.py. */
typedef struct {
    const float *const *inputs; /* 4 numbers per place each */
    float *const *outputs;      /* as many numbers per place as `widths` says */
    const int32_t *widths;
    int64_t count;
} Places;

/* The interpreter. */

#define ONE(name, result)                                                                                              \
    case name:                                                                                                         \
        EACH                                                                                                           \
        {                                                                                                              \
            float a = p[l];                                                                                            \
            d[l] = result;                                                                                             \
        }                                                                                                              \
        break;
#define TWO(name, result)                                                                                              \
    case name:                                                                                                         \
        EACH                                                                                                           \
        {                                                                                                              \
            float a = p[l], b = q[l];                                                                                  \
            d[l] = result;                                                                                             \
        }                                                                                                              \
        break;

/* The sine after quarter turns, of any angle. */
INLINE void sines(float *restrict d, const float *restrict p, int64_t turned)
{
    int far = 0;
    EACH
    {
        float a = absolute(p[l]) <= LARGE_ANGLE ? p[l] : 0.0f;
        far |= !(absolute(p[l]) <= LARGE_ANGLE);
        d[l] = (float)near_sine(a, turned);
    }
    if (far)
        for (int l = 0; l < LANES; l++)
            if (!(absolute(p[l]) <= LARGE_ANGLE))
                d[l] = (float)far_sine(p[l], turned);
}

static void tangents(float *d, const float *p)
{
    for (int l = 0; l < LANES; l++) {
        int near = absolute(p[l]) <= LARGE_ANGLE;
        d[l] = (float)(near ? near_sine(p[l], 0) / near_sine(p[l], 1) : far_sine(p[l], 0) / far_sine(p[l], 1));
    }
}

/* Operations that only few materials have, lane by lane. */
static void seldom(const int32_t *i, float *r, const Program *program)
{
    float *d = r + i[1] * LANES;
    const float *p = r + i[2] * LANES, *q = r + i[3] * LANES, *s = r + i[4] * LANES;
    for (int l = 0; l < LANES; l++) {
        float three[3] = {p[l], 0.0f, 0.0f}, result[3] = {0.0f, 0.0f, 0.0f};
        if (i[0] >= TO_HSV && i[0] <= FROM_HSL)
            three[1] = q[l], three[2] = s[l];
        switch (i[0]) {
        case ARCSINE:
            d[l] = arcsine(p[l]);
            break;
        case ARCCOSINE:
            d[l] = arccosine(p[l]);
            break;
        case ARCTANGENT:
            d[l] = (float)arctangent(p[l]);
            break;
        case ARCTAN2:
            d[l] = (float)angle_of(p[l], q[l]);
            break;
        case SINH:
            d[l] = (float)(twice_sinh(p[l]) * 0.5);
            break;
        case COSH:
            d[l] = (float)(twice_cosh(p[l]) * 0.5);
            break;
        case TANH:
            d[l] = absolute(p[l]) > 20.0f ? (p[l] < 0.0f ? -1.0f : 1.0f) : (float)(twice_sinh(p[l]) / twice_cosh(p[l]));
            break;
        case REMAINDER:
            d[l] = remainder_of(p[l], q[l]);
            break;
        case TO_HSV:
            to_hsv(three, result);
            break;
        case FROM_HSV:
            from_hsv(three, result);
            break;
        case TO_HSL:
            to_hsl(three, result);
            break;
        case FROM_HSL:
            from_hsl(three, result);
            break;
        case IMAGE:
            look_up(program->pictures + i[4], p[l], q[l], d + l);
            break;
        case BRICK: {
            const float *b = r + i[5] * LANES, *w = r + i[6] * LANES, *h = r + i[7] * LANES, *m = r + i[8] * LANES;
            const Bond bond = {r[i[9] * LANES], r[i[10] * LANES], i[11], i[12], i[13]};
            brick(p[l], q[l], s[l], b[l], w[l], h[l], m[l], bond, d + l);
            break;
        }
        case VORONOI: {
            float place[4];
            for (int k = 0; k < 4; k++)
                place[k] = r[i[2 + k] * LANES + l];
            const Cells cells = {i[12] & 7,
                                 i[12] >> 3,
                                 i[13],
                                 i[14],
                                 i[15],
                                 r[i[6] * LANES + l],
                                 r[i[7] * LANES + l],
                                 r[i[8] * LANES + l],
                                 r[i[9] * LANES + l],
                                 r[i[10] * LANES + l],
                                 r[i[11] * LANES + l]};
            voronoi(place, &cells, d + l);
            break;
        }
        default:
            break;
        }
        if (i[0] >= TO_HSV && i[0] <= FROM_HSL)
            for (int k = 0; k < 3; k++)
                d[k * LANES + l] = result[k];
    }
}

/* Runs instructions on the places from `start` on. */
INLINE void execute(const Program *program, int from, int to, float *r, const Places *places, int64_t start,
                    Octave octave)
{
    const int64_t here = places->count - start;
    const int count = here < LANES ? (int)here : LANES;
    for (int at = from; at < to; at++) {
        const int32_t *i = program->code + (int64_t)at * WORDS;
        float *restrict d = r + i[1] * LANES;
        const float *p = r + i[2] * LANES, *q = r + i[3] * LANES, *s = r + i[4] * LANES;
        switch (i[0]) {
        case LOAD: {
            const float *input = places->inputs[i[2]] + 4 * start + i[3];
            for (int l = 0; l < LANES; l++)
                d[l] = input[4 * (l < count ? l : count - 1)];
            break;
        }
        case STORE: {
            const int width = places->widths[i[3]];
            float *output = places->outputs[i[3]] + start * width + i[4];
            for (int l = 0; l < count; l++)
                output[l * width] = p[l];
            break;
        }
            TWO(ADD, a + b)
            TWO(SUBTRACT, a - b)
            TWO(MULTIPLY, a * b)
            TWO(DIVIDE, a / b)
            TWO(SAFE_DIVIDE, safe_divide(a, b))
            TWO(MINIMUM, smaller(a, b))
            TWO(MAXIMUM, larger(a, b))
            TWO(LESS, a < b ? 1.0f : 0.0f)
            TWO(LESS_EQUAL, a <= b ? 1.0f : 0.0f)
            TWO(EQUAL, a == b ? 1.0f : 0.0f)
            TWO(POWER, safe_power(a, b))
            ONE(ABSOLUTE, absolute(a))
            ONE(NEGATE, -a)
            ONE(FLOOR, floored(a))
            ONE(CEIL, ceiled(a))
            ONE(TRUNCATE, truncated(a))
            ONE(SQRT, root(a))
            ONE(SIGN, a == 0.0f ? 0.0f : a < 0.0f ? -1.0f : 1.0f)
            ONE(EXPONENT, (float)exponential(a))
            ONE(LOGARITHM, (float)logarithm(a))
            ONE(TO_LINEAR, to_linear(a))
        case MULTIPLY_ADD: /* rounded once */
            EACH d[l] = (float)((double)p[l] * (double)q[l] + (double)s[l]);
            break;
        case SELECT:
            EACH d[l] = p[l] != 0.0f ? q[l] : s[l];
            break;
        case SINE:
            sines(d, p, 0);
            break;
        case COSINE:
            sines(d, p, 1);
            break;
        case TANGENT:
            tangents(d, p);
            break;
        case HASH: {
            const float *w = r + i[5] * LANES;
            switch (i[6]) {
            case 1:
                EACH d[l] = share(hash1(bits_of(p[l])));
                break;
            case 2:
                EACH d[l] = share(hash2(bits_of(p[l]), bits_of(q[l])));
                break;
            case 3:
                EACH d[l] = share(hash3(bits_of(p[l]), bits_of(q[l]), bits_of(s[l])));
                break;
            default:
                EACH d[l] = share(hash4(bits_of(p[l]), bits_of(q[l]), bits_of(s[l]), bits_of(w[l])));
            }
            break;
        }
        case OCTAVE: {
            const float *const place[4] = {p, q, s, r + i[5] * LANES};
            if (i[7] == 3)
                octave(d, place, r + i[6] * LANES);
            else
                seldom_octave(d, place, r + i[6] * LANES, i[7]);
            break;
        }
        case FRACTAL: {
            const float *const place[4] = {p, q, s, r + i[5] * LANES};
            const Fractal fractal = {r + i[6] * LANES, r + i[7] * LANES, r + i[8] * LANES, r + i[9] * LANES,
                                     r + i[10] * LANES, i[11], i[12], i[13]};
            if (fractal.kind == FBM)
                brownian(d, place, &fractal, r + program->scratch * LANES, octave);
            else
                seldom_fractal(d, place, &fractal, r + program->scratch * LANES);
            break;
        }
        case RAMP:
            for (int l = 0; l < LANES; l++)
                d[l] = ramp(program->tables + i[3], p[l], i[4], i[5], i[6]);
            break;
        case CHECKER:
            EACH d[l] = (odd(p[l]) == odd(q[l])) == odd(s[l]) ? 1.0f : 0.0f;
            break;
        default:
            seldom(i, r, program);
        }
    }
}

INLINE void execute_all(const Program *program, float *registers, const Places *places, Octave octave)
{
    /* The instructions at the front are run once, before the first places. */
    int from = 0;
    for (int64_t start = 0; start < places->count; start += LANES) {
        execute(program, from, program->whole, registers, places, start, octave);
        from = program->uniform;
    }
}

#if defined(__x86_64__)
#define WIDE __attribute__((target("avx2")))

WIDE static void octave3_wide(float *restrict out, const float *const *place, const float *restrict scale)
{
    octave3(out, place, scale);
}

WIDE static void execute_wide(const Program *program, float *registers, const Places *places)
{
    execute_all(program, registers, places, octave3_wide);
}
#endif

static void execute_usual(const Program *program, float *registers, const Places *places)
{
    execute_all(program, registers, places, octave3_usual);
}

/* Writes the outputs at all places. `registers` hold the program's constants, and are any beside them; `narrow` keeps
 * to the instructions that every processor of the platform has, which gives the same more slowly. */
EXPORT void synthroads_materials(const Program *program, float *registers, const Places *places, int32_t narrow)
{
#if defined(__x86_64__)
    if (!narrow && has_avx2()) {
        execute_wide(program, registers, places);
        return;
    }
#endif
    (void)narrow;
    execute_usual(program, registers, places);
}

/* The compiler copies structures by it. */
__attribute__((visibility("hidden"), no_builtin("memcpy"))) void *memcpy(void *to, const void *from, size_t count)
{
    for (size_t k = 0; k < count; k++)
        ((char *)to)[k] = ((const char *)from)[k];
    return to;
}

#if defined(_WIN32)
/* Without the C runtime a library that computes with floats has to have this itself. */
int _fltused = 0;
#endif
