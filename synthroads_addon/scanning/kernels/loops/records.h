/* LAS records: cloud.formats.las, operation by operation. */
#include "../kernel.h"

/* Points and how they are stored; as `_Records` in points.py. */
typedef struct {
    const double *place; /* (count, 3) */
    const double *intensity, *time;
    const uint16_t *rgb; /* (count, 3) */
    const uint8_t *number, *of, *class_id, *codes;
    const float *angle;
    const uint16_t *strip;
    double offset[3], per_step, brightness;
    float per_angle;
    int32_t classes;
} Points;

#define SHIFT 6755399441055744.0 /* its sum with a number rounds this, halves to even ones */

/* Fills in LAS records of format 7 (LAS 1.4 R15, table 15), `size` bytes each; extremes of coordinates (2, 3), points by
 * return (16). Returns 0, and what is filled in means nothing, where a value doesn't fit. */
INLINE int any_pack(int64_t count, const Points *p, int64_t size, uint8_t *restrict records, double *restrict extremes,
                    int64_t *restrict by_return)
{
    int fits = 1;
    for (int64_t i = 0; i < count; i++) {
        uint8_t *restrict record = records + i * size;
        for (int j = 0; j < 3; j++) {
            const double steps = (p->place[3 * i + j] - p->offset[j]) * p->per_step;
            const double whole = (steps + SHIFT) - SHIFT;
            const int inside = whole >= -2147483648.0 && whole < 2147483648.0;
            const int32_t stored = inside ? (int32_t)whole : 0;
            fits &= inside;
            extremes[j] = whole < extremes[j] ? whole : extremes[j];
            extremes[3 + j] = whole > extremes[3 + j] ? whole : extremes[3 + j];
            __builtin_memcpy(record + 4 * j, &stored, 4);
        }
        const double bright = (p->intensity[i] * p->brightness + SHIFT) - SHIFT, time = p->time[i];
        const double angle = ((double)(p->angle[i] * p->per_angle) + SHIFT) - SHIFT;
        const uint8_t number = p->number[i], of = p->of[i], class_id = p->class_id[i];
        const int usual = bright >= 0.0 && bright <= 65535.0 && angle >= -30000.0 && angle <= 30000.0 &&
                          __builtin_fabs(time) <= 1.7976931348623157e308 && number <= 15 && of <= 15 &&
                          class_id < p->classes;
        fits &= usual;
        if (!usual)
            continue;
        const uint16_t intensity = (uint16_t)(int32_t)bright, source = (uint16_t)(p->strip[i] + 1);
        const int16_t scan_angle = (int16_t)(int32_t)angle;
        __builtin_memcpy(record + 12, &intensity, 2);
        record[14] = (uint8_t)(number | of << 4);
        record[15] = 0;
        record[16] = p->codes[class_id];
        record[17] = 0;
        __builtin_memcpy(record + 18, &scan_angle, 2);
        __builtin_memcpy(record + 20, &source, 2);
        __builtin_memcpy(record + 22, &time, 8);
        __builtin_memcpy(record + 30, p->rgb + 3 * i, 6);
        by_return[number]++;
    }
    return fits;
}

EXPORT_WIDE(int, pack,
            (int64_t count, const Points *points, int64_t size, uint8_t *records, double *extremes, int64_t *by_return),
            (count, points, size, records, extremes, by_return))
