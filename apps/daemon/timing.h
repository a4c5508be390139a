/// Cycle times of the recent past: last, 99th percentile, largest.
///
/// The percentile is taken over the last TIMING_RING cycles by the nearest-rank method; the largest
/// is that of all cycles since the start. timing_p99() sorts at most 1,024 numbers.
#ifndef VERGE_DAEMON_TIMING_H
#define VERGE_DAEMON_TIMING_H

#include <stdint.h>

enum { TIMING_RING = 1024 };

/// All zero is empty.
typedef struct timing {
    uint32_t ring[TIMING_RING]; ///< [us]
    uint64_t count;             ///< cycles ever added
    uint32_t last, max;         ///< [us]
} timing;

/// cycle_us below 0 count as 0, above a uint32_t as its largest value.
void timing_add(timing* self, int64_t cycle_us);
/// [us]; 0 while empty.
uint32_t timing_p99(const timing* self);

#endif
