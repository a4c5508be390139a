/// See value.h.
#include "traffic/value.h"

#include "base/scalar.h"

#include <string.h>

static const float spacing_min = 8.0f;        // [m] of nodes, where they suffice for the reach
// A lane change at speed takes this long, and no less than this distance. [s], [m]
static const float change_s = 3.0f, change_length = 12.0f;
// A change at walking speed, at the end of a lane: its length, of which a part may lie beyond the
// end, and its cost. [m], [m], [s]
static const float slow_length = 10.0f, slow_beyond = 6.0f, slow_cost = 6.0f;
// A change is urgent where less than this is left of the stretch in which it is allowed: a time at
// the present speed, and a distance. In flows of 500 vehicles an hour 95 of 100 changes find a gap
// within 10 s. [s], [m]
static const float urgent_s = 10.0f, urgent_length = 15.0f;
static const float urgent_cost = 15.0f;       // [s] of a change at the very end
static const float change_beyond_reach = 2.0f;// [s] for each change left beyond the reach
static const float speed_min = 1.0f;          // [m/s] divisor
static const float unknown = 1e6f;            // [s] before the first sweep

// One table while it is filled.
typedef struct builder {
    const verge_road* road;
    vg_value_table*   table;
    uint8_t*          entry;  // [lane_count]
    int32_t           target; // lane index, -1 none
    float             speed_max;
} builder;

static void cover(builder* self, uint32_t lane, double s);
static void lay_nodes(builder* self);
static bool sweep(builder* self, uint32_t index);

vg_value* vg_value_take(vg_arena* arena, uint32_t controlled_max, uint32_t lane_count)
{
    const uint32_t lanes = lane_count == 0 ? VERGE_LANES_MAX : lane_count;
    vg_value* value = vg_arena_take(arena, sizeof *value);
    uint8_t* entry = vg_arena_take(arena, (size_t)controlled_max * lanes);
    vg_value_table* tables = vg_arena_take(arena, controlled_max * sizeof *tables);
    if (value == NULL || entry == NULL || tables == NULL) {
        return NULL;
    }
    memset(entry, VG_VALUE_NONE, (size_t)controlled_max * lanes);
    for (uint32_t i = 0; i < controlled_max; ++i) {
        tables[i].lane_count = 0;
    }
    *value = (vg_value){ lanes, controlled_max, entry, tables };
    return value;
}

void vg_value_fill(vg_value* value, vg_model* model, const vg_flow* flow)
{
    VERGE_ASSERT(model->controlled_count <= value->tables_max);
    VERGE_ASSERT(model->road->lane_count <= value->lane_count);
    for (uint32_t slot = 0; slot < model->controlled_count; ++slot) {
        builder self = { .road = model->road, .table = &value->tables[slot],
                         .entry = &value->entry[slot * value->lane_count],
                         .target = model->target[slot], .speed_max = model->speed_max[slot] };
        for (uint32_t i = 0; i < self.table->lane_count; ++i) { // of the last scene
            self.entry[self.table->lanes[i].lane] = VG_VALUE_NONE;
        }
        const uint32_t lane = (uint32_t)flow->lane[slot];
        cover(&self, lane, vg_lane_s(&model->road->lanes[lane], (double)flow->station[slot]));
        lay_nodes(&self);
        // Each sweep can only lower times. Where lanes are ordered along the road one is enough;
        // more are needed for several changes in a row, and on rings.
        bool changed = true;
        for (uint32_t pass = 0; changed && pass <= self.table->lane_count; ++pass) {
            changed = false;
            for (uint32_t i = self.table->lane_count; i > 0; --i) {
                changed = sweep(&self, i - 1u) || changed;
            }
        }
    }
    model->value = value;
}

// ---------------------------------------------------------------------------- the lanes covered

// Does this lane lie on the target lane, before it on a route, or behind it?
static bool leads_to_target(const builder* self, uint32_t lane)
{
    return self->target < 0 || self->table->unreachable
           || vg_road_changes(self->road, lane, (uint32_t)self->target) == 0
           || vg_road_changes(self->road, (uint32_t)self->target, lane) == 0;
}

static bool reaches_target(const builder* self, uint32_t lane)
{
    return leads_to_target(self, lane)
           || vg_road_changes(self->road, lane, (uint32_t)self->target) != VG_NEVER;
}

static void add(builder* self, int32_t lane, float begins_at)
{
    vg_value_table* table = self->table;
    if (lane < 0 || self->entry[lane] != VG_VALUE_NONE || table->lane_count == VG_VALUE_LANES
        || begins_at >= (float)VG_VALUE_REACH
        || begins_at + (float)self->road->lanes[lane].length <= 0.0f) {
        return;
    }
    self->entry[lane] = (uint8_t)table->lane_count;
    table->lanes[table->lane_count++] =
        (vg_value_lane){ .lane = (uint32_t)lane, .begins_at = begins_at, .continued = -1 };
}

// Of two lanes side by side, where the other one begins.
static float beside_begins(const builder* self, const vg_value_lane* from, int32_t beside)
{
    const vg_lane* lane = &self->road->lanes[from->lane];
    return beside < 0 ? 0.0f
                      : from->begins_at + (float)(self->road->lanes[beside].station_start
                                                  - lane->station_start);
}

// The lanes ahead, in the order in which they are found.
static void cover(builder* self, uint32_t lane, double s)
{
    vg_value_table* table = self->table;
    table->lane_count = 0;
    table->unreachable = false;
    table->unreachable = !reaches_target(self, lane);
    add(self, (int32_t)lane, -(float)vg_min(s, self->road->lanes[lane].length - 1.0));
    for (uint32_t i = 0; i < table->lane_count; ++i) {
        const vg_value_lane from = table->lanes[i];
        const vg_lane* here = &self->road->lanes[from.lane];
        if (here->change_left) {
            add(self, here->left, beside_begins(self, &from, here->left));
        }
        if (here->change_right) {
            add(self, here->right, beside_begins(self, &from, here->right));
        }
        add(self, vg_road_next(self->road, from.lane, table->unreachable ? -1 : self->target),
            from.begins_at + (float)here->length);
    }
}

// The first and the last station of a lane that count.
static void stretch_of(const builder* self, const vg_value_lane* of, float* from, float* to)
{
    static const double behind = 50.0; // [m] that vehicles and bins may lie behind
    const vg_lane* lane = &self->road->lanes[of->lane];
    const double start = vg_max(0.0, -(double)of->begins_at - behind);
    const double end = vg_min(lane->length, VG_VALUE_REACH - (double)of->begins_at);
    *from = (float)vg_lane_station(lane, vg_min(start, lane->length));
    *to = (float)vg_lane_station(lane, end);
}

static uint32_t nodes_of(const builder* self, uint32_t index, float spacing)
{
    float from, to;
    stretch_of(self, &self->table->lanes[index], &from, &to);
    return 2u + (uint32_t)(vg_maxf(to - from, 0.0f) / spacing);
}

// The time at the end of a lane that does not go on in the table.
static float end_time(const builder* self, const vg_value_lane* of)
{
    const vg_lane* lane = &self->road->lanes[of->lane];
    const float ends_at = of->begins_at + (float)lane->length;
    const float left = vg_maxf((float)VG_VALUE_REACH - ends_at, 0.0f);
    const float speed = vg_minf((float)lane->speed_limit, self->speed_max);
    const float beyond = left / vg_maxf(speed, speed_min);
    if (leads_to_target(self, of->lane)) {
        const bool dead_end = ends_at < (float)VG_VALUE_REACH && lane->dead_end;
        return beyond + (dead_end ? VG_VALUE_DEAD_END : 0.0f);
    }
    const uint32_t changes = vg_road_changes(self->road, of->lane, (uint32_t)self->target);
    const bool lost = changes == VG_NEVER || ends_at < (float)VG_VALUE_REACH;
    return beyond + (lost ? VG_VALUE_DEAD_END : change_beyond_reach * (float)changes);
}

static void lay_nodes(builder* self)
{
    vg_value_table* table = self->table;
    uint32_t nodes = VG_VALUE_NODES + 1;
    table->spacing = 0.5f * spacing_min;
    while (nodes > VG_VALUE_NODES) {
        table->spacing *= 2.0f;
        nodes = 0;
        for (uint32_t i = 0; i < table->lane_count; ++i) {
            nodes += nodes_of(self, i, table->spacing);
        }
    }
    uint32_t first = 0;
    for (uint32_t i = 0; i < table->lane_count; ++i) {
        vg_value_lane* of = &table->lanes[i];
        const vg_lane* lane = &self->road->lanes[of->lane];
        float from;
        stretch_of(self, of, &from, &of->station_end);
        of->first = first;
        of->node_count = nodes_of(self, i, table->spacing);
        first += of->node_count;
        const int32_t next =
            vg_road_next(self->road, of->lane, table->unreachable ? -1 : self->target);
        const bool whole = of->begins_at + (float)lane->length <= (float)VG_VALUE_REACH;
        of->continued = whole && next >= 0 && self->entry[next] != VG_VALUE_NONE
                            ? (int32_t)self->entry[next] : -1;
        of->end_time = end_time(self, of);
        for (uint32_t k = 0; k < of->node_count; ++k) {
            table->time[of->first + k] = unknown;
        }
    }
    VERGE_ASSERT(first <= VG_VALUE_NODES);
}

// ---------------------------------------------------------------------------- the times

static float time_in(const vg_value_table* table, const vg_value_lane* of, float station)
{
    const float last = (float)(of->node_count - 1u);
    const float at = last - (of->station_end - station) / table->spacing;
    const float clamped = vg_minf(vg_maxf(at, 0.0f), last);
    uint32_t node = (uint32_t)clamped;
    node = node > of->node_count - 2u ? of->node_count - 2u : node;
    const float* time = &table->time[of->first + node];
    return time[0] + (clamped - (float)node) * (time[1] - time[0]);
}

// The stretch ahead of the nodes of one lane in which a change to one side is allowed.
typedef struct side {
    const vg_value_lane* beside; // null: no lane there
    bool  left;
    float allowed;               // [m] from the present node on
} side;

static side side_of(const builder* self, uint32_t lane, bool left)
{
    const vg_lane* here = &self->road->lanes[lane];
    const int32_t beside = left ? here->left : here->right;
    const bool known = (left ? here->change_left : here->change_right) && beside >= 0
                       && self->entry[beside] != VG_VALUE_NONE;
    return (side){ known ? &self->table->lanes[self->entry[beside]] : NULL, left, 0.0f };
}

// The shortest time by a change to one side from a node.
static float by_change(const builder* self, const vg_bin* nearest, side* to, float station,
                       float speed)
{
    if (to->beside == NULL) {
        return unknown;
    }
    const vg_value_table* table = self->table;
    const float gap = to->left ? nearest->left_gap : nearest->right_gap;
    if (!(gap > 0.0f)) {
        to->allowed = 0.0f;
        return unknown;
    }
    const float length = vg_maxf(change_s * speed, change_length);
    const float left = to->allowed - length;
    float time = unknown;
    if (left >= 0.0f) {
        const float short_of = 1.0f - left / (urgent_s * speed + urgent_length);
        const float urgency = short_of > 0.0f ? urgent_cost * short_of * short_of : 0.0f;
        time = length / speed + VG_VALUE_CHANGE + urgency
               + time_in(table, to->beside, station + length);
    }
    if (to->allowed >= slow_length - slow_beyond) {
        const float slow = urgent_cost + slow_cost
                           + time_in(table, to->beside, station + slow_length);
        time = vg_minf(time, slow);
    }
    to->allowed += table->spacing;
    return time;
}

// All nodes of one lane, from its end. False: nothing changed.
static bool sweep(builder* self, uint32_t index)
{
    vg_value_table* table = self->table;
    const vg_value_lane* of = &table->lanes[index];
    const vg_lane* lane = &self->road->lanes[of->lane];
    side left = side_of(self, of->lane, true), right = side_of(self, of->lane, false);
    float after = of->end_time;
    if (of->continued >= 0) {
        const vg_value_lane* next = &table->lanes[of->continued];
        after = time_in(table, next, (float)self->road->lanes[next->lane].station_start);
    }
    bool changed = false;
    for (uint32_t k = of->node_count; k > 0; --k) {
        const float station = of->station_end - (float)(of->node_count - k) * table->spacing;
        const vg_bin_place place = vg_bin_at(lane, station);
        const vg_bin* nearest = place.t < 0.5f ? place.here : place.here + 1;
        const float speed = vg_maxf(vg_minf(place.here[0].speed, self->speed_max), speed_min);
        if (k < of->node_count) {
            after += table->spacing * vg_bin_rate(place) / speed;
        }
        after = vg_minf(after, by_change(self, nearest, &left, station, speed));
        after = vg_minf(after, by_change(self, nearest, &right, station, speed));
        float* time = &table->time[of->first + k - 1u];
        changed = changed || after < *time;
        *time = vg_minf(after, *time);
        after = *time;
    }
    return changed;
}

float vg_value_at(const vg_value* value, uint32_t slot, uint32_t lane, float station)
{
    VERGE_ASSERT(slot < value->tables_max && lane < value->lane_count);
    const uint8_t entry = value->entry[slot * value->lane_count + lane];
    const vg_value_table* table = &value->tables[slot];
    if (entry == VG_VALUE_NONE) {
        return VG_VALUE_DEAD_END + (float)VG_VALUE_REACH / 10.0f;
    }
    const vg_value_lane* of = &table->lanes[entry];
    // Beyond the end of a lane, and of the table, the time goes on as at its end.
    return time_in(table, of, station);
}
