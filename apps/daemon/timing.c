#include "timing.h"

#include <string.h>

static void sort_up(uint32_t* values, uint32_t count);

void timing_add(timing* self, int64_t cycle_us)
{
    const int64_t bounded = cycle_us < 0 ? 0 : cycle_us > UINT32_MAX ? UINT32_MAX : cycle_us;
    self->last = (uint32_t)bounded;
    self->max = self->last > self->max ? self->last : self->max;
    self->ring[self->count % TIMING_RING] = self->last;
    self->count++;
}

uint32_t timing_p99(const timing* self)
{
    if (self->count == 0) {
        return 0;
    }
    const uint32_t count = self->count < TIMING_RING ? (uint32_t)self->count : TIMING_RING;
    uint32_t sorted[TIMING_RING];
    memcpy(sorted, self->ring, count * sizeof sorted[0]);
    sort_up(sorted, count);
    const uint32_t rank = (count * 99 + 99) / 100; // nearest rank: the ceiling of 0.99 n
    return sorted[rank - 1];
}

/// Shell's sort with Ciura's gaps. qsort() of the C library may allocate; this one does not.
static void sort_up(uint32_t* values, uint32_t count)
{
    static const uint32_t GAPS[] = { 701, 301, 132, 57, 23, 10, 4, 1 };
    for (uint32_t g = 0; g < sizeof GAPS / sizeof GAPS[0]; g++) {
        const uint32_t gap = GAPS[g];
        for (uint32_t i = gap; i < count; i++) {
            const uint32_t value = values[i];
            uint32_t j = i;
            for (; j >= gap && values[j - gap] > value; j -= gap) {
                values[j] = values[j - gap];
            }
            values[j] = value;
        }
    }
}
