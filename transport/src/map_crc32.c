/// The checksum of a road. It is over numbers, not over the text of a file, so that two programs
/// with the same road agree.
#include "verge/wire.h"

#include "codec.h"
#include "crc32.h"

#include <assert.h>
#include <string.h>

static uint32_t add_lane(uint32_t crc, const verge_lane_def* lane);
static uint32_t add_stretches(uint32_t crc, bool given, const verge_stretch* of, uint32_t count);
static uint32_t add_int(uint32_t crc, int32_t value);
static uint32_t add_double(uint32_t crc, double value);

/// The lane with the smallest id above `above`; null: none.
static const verge_lane_def* next_lane(const verge_road_def* road, int64_t above)
{
    const verge_lane_def* found = NULL;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        const verge_lane_def* lane = &road->lanes[i];
        if (lane->id > above && (found == NULL || lane->id < found->id)) {
            found = lane;
        }
    }
    return found;
}

uint32_t wire_map_crc32(const verge_road_def* road)
{
    uint32_t crc = crc32_begin;
    const verge_lane_def* lane = next_lane(road, -1);
    for (; lane != NULL; lane = next_lane(road, lane->id)) {
        crc = add_lane(crc, lane);
    }
    crc = crc32_end(crc);
    return crc != 0 ? crc : 1; // 0 in a message: no road is stated
}

static uint32_t add_lane(uint32_t crc, const verge_lane_def* lane)
{
    crc = add_int(crc, lane->id);
    crc = add_double(crc, lane->width);
    crc = add_double(crc, lane->speed_limit);
    crc = add_int(crc, lane->left);
    crc = add_int(crc, lane->right);
    crc = add_int(crc, (int32_t)lane->successor_count);
    for (uint32_t i = 0; i < lane->successor_count; ++i) {
        crc = add_int(crc, lane->successors[i]);
    }
    crc = add_stretches(crc, lane->change_left_given, lane->change_left, lane->change_left_count);
    crc = add_stretches(crc, lane->change_right_given, lane->change_right,
                        lane->change_right_count);
    crc = add_int(crc, (int32_t)lane->priority);
    crc = add_double(crc, lane->stop_line_given ? lane->stop_line : -1.0);
    crc = add_int(crc, (int32_t)lane->point_count);
    for (uint32_t i = 0; i < lane->point_count; ++i) {
        crc = add_double(crc, lane->points[i][0]);
        crc = add_double(crc, lane->points[i][1]);
    }
    return crc;
}

/// A list that is absent differs from an empty one.
static uint32_t add_stretches(uint32_t crc, bool given, const verge_stretch* of, uint32_t count)
{
    assert(count <= VERGE_STRETCHES_MAX);
    crc = add_int(crc, given ? (int32_t)count : -1);
    for (uint32_t i = 0; given && i < count; ++i) {
        crc = add_double(crc, of[i].s0);
        crc = add_double(crc, of[i].s1);
    }
    return crc;
}

static uint32_t add_int(uint32_t crc, int32_t value)
{
    uint8_t bytes[4];
    codec_put_u32(bytes, (uint32_t)value);
    return crc32_add(crc, bytes, sizeof bytes);
}

/// Big-endian; minus zero is zero.
static uint32_t add_double(uint32_t crc, double value)
{
    uint64_t bits;
    uint8_t  bytes[8];
    value += 0.0;
    memcpy(&bits, &value, sizeof bits);
    codec_put_u64(bytes, bits);
    return crc32_add(crc, bytes, sizeof bytes);
}
