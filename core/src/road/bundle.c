/// Lanes that run side by side share one axis of stations and one lateral axis.
///
/// The station of the longest lane of a bundle is its arc length. Every other lane takes its
/// stations from a neighbour that already has stations: a point has the station of the neighbour's
/// point next to it. Where the two do not run side by side, station and arc length advance equally.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A lane's points this far from the neighbour, or turned this much, are not beside it.
static const double beside_distance = 15.0; // [m]
static const double beside_cosine = 0.7;    // [1]
/// Smallest and largest station per metre of lane. Two lanes of a roundabout may be 8 m and 12 m
/// from its centre; larger ratios are errors of the survey.
static const double rate_min = 0.5;
static const double rate_max = 2.0;
/// A lane change is possible where the centres are between this many and VG_BESIDE_WIDTHS_MAX mean
/// widths apart [1] and the directions differ by at most 0.5 rad (cosine).
static const double gap_min = 0.4;
static const double change_cosine = 0.87758256189037271;

/// Lanes that start or end together do so within this. [m]
static const double end_slack = 0.05;

/// Lateral acceleration in bends, and deceleration before bends and lower limits. Both are well
/// below the comfort limits, so that trajectories can deviate. [m/s^2]
static const double bend_lateral = 2.5;
static const double approach = 0.5;
/// A bin includes the bends from this distance before it to this distance behind the next one. [m]
static const double bend_reach = 2.0;
// Rate of curvature in time that a car's steering follows, 0.4 rad/s over 2.7 m and a margin, and
// half the length over which paths begin a bend (path.c). [1/(m s)], [m]
static const double bend_rate = 0.145, bend_begins = 2.0;
/// Number of lanes over which a lower speed is propagated against the direction of travel.
enum { joint_rounds = 4 };

/// Which lanes are neighbours, in scratch.
typedef struct links {
    uint32_t* from;    ///< [lane_count + 1] a lane's part of `of` begins here
    uint16_t* of;
    uint16_t* members; ///< of the present bundle
    bool*     placed;  ///< [lane_count]
} links;

static bool links_from(links* all, const vg_road_draft* draft);
static void lay_bundle(vg_road_draft* draft, links* all, uint32_t lane, uint32_t bundle);
static void list_bundles(struct verge_road* road, uint32_t bundle_count);
static void lay_first(vg_road_draft* draft, uint32_t lane);
static void lay_beside(vg_road_draft* draft, uint32_t lane, uint32_t neighbour);
/// Where the last point was on the neighbour. Beside it the next point is looked for near there;
/// elsewhere on all of the neighbour, from there on.
typedef struct trace {
    double s;
    bool   beside;
} trace;

static double trace_project(const trace* at, const vg_lane* neighbour, double x, double y);
static bool find_beside(const vg_lane* lane, const vg_lane* neighbour, double s, double* station,
                        double* lateral, trace* last);
static void fill_gaps(vg_road_draft* draft, uint32_t lane);
static void fill_speeds(vg_road_draft* draft, uint32_t lane);
static void look_ahead(vg_road_draft* draft, uint32_t lane);
static float gap_at(const vg_road_draft* draft, uint32_t lane, bool left, double s, trace* last);

void vg_road_bundle(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    draft->scratch->used = draft->scratch_start;
    links all;
    if (!links_from(&all, draft)) {
        return;
    }
    uint32_t bundle = 0;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        if (!all.placed[i]) {
            lay_bundle(draft, &all, i, bundle++);
        }
    }
    list_bundles(road, bundle);
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        fill_gaps(draft, i);
        fill_speeds(draft, i);
    }
    for (uint32_t round = 0; round < joint_rounds; ++round) { // one lane further in each round
        for (uint32_t i = 0; i < road->lane_count; ++i) {
            look_ahead(draft, i);
        }
    }
}

size_t vg_road_bundle_scratch_size(const verge_road_def* def)
{
    const size_t n = def->lane_count;
    return (n + 1) * sizeof(uint32_t) + 5 * n * sizeof(uint16_t) + n * sizeof(bool)
           + 4 * VG_ARENA_ALIGN;
}

uint32_t vg_lane_bin_capacity(const verge_lane_def* lane)
{
    // A line is at most a third longer than its survey (a circle by its inscribed polygon).
    const double bins = rate_max * 1.34 * vg_survey_length(lane) / VG_BIN;
    return (uint32_t)vg_clamp(bins, 0.0, 1e6) + 4;
}

/// Lists the neighbours that a lane names or that name the lane: its part of all->of, with
/// repetitions.
static bool links_from(links* all, const vg_road_draft* draft)
{
    const struct verge_road* road = draft->road;
    const uint32_t n = road->lane_count;
    all->from = vg_arena_take(draft->scratch, (n + 1) * sizeof *all->from);
    all->of = vg_arena_take(draft->scratch, 4 * n * sizeof *all->of);
    all->members = vg_arena_take(draft->scratch, n * sizeof *all->members);
    all->placed = vg_arena_take(draft->scratch, n * sizeof *all->placed);
    if (draft->scratch->failed) {
        return false;
    }
    for (uint32_t pass = 0; pass < 2; ++pass) { // count, then write each part from its end
        for (uint32_t i = 0; i < n; ++i) {
            const int32_t beside[2] = { road->lanes[i].left, road->lanes[i].right };
            for (uint32_t side = 0; side < 2; ++side) {
                if (beside[side] < 0 || beside[side] == (int32_t)i) {
                    continue;
                }
                const uint32_t other = (uint32_t)beside[side];
                if (pass == 0) {
                    ++all->from[i];
                    ++all->from[other];
                } else {
                    all->of[--all->from[i]] = (uint16_t)other;
                    all->of[--all->from[other]] = (uint16_t)i;
                }
            }
        }
        for (uint32_t i = 0; pass == 0 && i < n; ++i) {
            all->from[i + 1] += all->from[i];
        }
    }
    return true;
}

/// The lowest lane that is placed and a neighbour of this one, -1 none.
static int32_t placed_beside(const links* all, uint32_t lane)
{
    int32_t lowest = -1;
    for (uint32_t k = all->from[lane]; k < all->from[lane + 1]; ++k) {
        const int32_t other = all->of[k];
        if (all->placed[other] && (lowest < 0 || other < lowest)) {
            lowest = other;
        }
    }
    return lowest;
}

/// The lanes connected with `lane` as neighbours, in the order of the lanes; returns their number.
static uint32_t members_of(links* all, uint32_t lane)
{
    uint32_t count = 1;
    all->members[0] = (uint16_t)lane;
    for (uint32_t at = 0; at < count; ++at) {
        const uint32_t here = all->members[at];
        for (uint32_t k = all->from[here]; k < all->from[here + 1]; ++k) {
            bool known = false;
            for (uint32_t m = 0; m < count; ++m) {
                known = known || all->members[m] == all->of[k];
            }
            if (!known) {
                all->members[count++] = all->of[k];
            }
        }
    }
    for (uint32_t i = 1; i < count; ++i) { // few: by insertion
        const uint16_t member = all->members[i];
        uint32_t at = i;
        for (; at > 0 && all->members[at - 1] > member; --at) {
            all->members[at] = all->members[at - 1];
        }
        all->members[at] = member;
    }
    return count;
}

/// The longest lane first, then neighbour by neighbour: always the lowest lane that touches one
/// already placed.
static void lay_bundle(vg_road_draft* draft, links* all, uint32_t lane, uint32_t bundle)
{
    struct verge_road* road = draft->road;
    const uint32_t count = members_of(all, lane);
    uint32_t longest = lane;
    for (uint32_t m = 0; m < count; ++m) {
        if (road->lanes[all->members[m]].length > road->lanes[longest].length) {
            longest = all->members[m];
        }
    }
    road->lanes[longest].bundle = bundle;
    lay_first(draft, longest);
    all->placed[longest] = true;
    for (uint32_t placed = 1; placed < count; ++placed) {
        int32_t beside = -1;
        uint32_t m = 0;
        for (; m < count && beside < 0; ++m) {
            beside = all->placed[all->members[m]] ? -1 : placed_beside(all, all->members[m]);
        }
        VERGE_ASSERT(beside >= 0);
        const uint32_t next = all->members[m - 1];
        road->lanes[next].bundle = bundle;
        lay_beside(draft, next, (uint32_t)beside);
        all->placed[next] = true;
    }
}

static void list_bundles(struct verge_road* road, uint32_t bundle_count)
{
    uint32_t* from = road->bundles_from; // [bundle + 1]: count, then end, then begin of its part
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        ++from[road->lanes[i].bundle + 1];
    }
    for (uint32_t k = 0; k < bundle_count; ++k) {
        from[k + 1] += from[k];
    }
    for (uint32_t i = road->lane_count; i-- > 0;) {
        road->bundle_lanes[--from[road->lanes[i].bundle + 1]] = (uint16_t)i;
    }
    for (uint32_t k = 0; k < bundle_count; ++k) {
        from[k] = from[k + 1];
    }
    from[bundle_count] = road->lane_count;
}

static void lay_first(vg_road_draft* draft, uint32_t index)
{
    vg_lane* lane = &draft->road->lanes[index];
    const vg_lane_storage* storage = &draft->storage[index];
    lane->station_start = 0.0;
    const uint32_t bins = (uint32_t)(vg_clamp(lane->length / VG_BIN, 0.0, 1e6)) + 2;
    lane->bin_count = bins < storage->bin_capacity ? bins : storage->bin_capacity;
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        storage->bins[i].s = (float)(VG_BIN * (double)i);
    }
    lane->station_end = lane->length;
}

/// Steps along the lane metre by metre, computes the station of each point, and stores a bin
/// whenever the station has reached the next one.
static void lay_beside(vg_road_draft* draft, uint32_t index, uint32_t neighbour)
{
    vg_lane* lane = &draft->road->lanes[index];
    const vg_lane* beside = &draft->road->lanes[neighbour];
    const vg_lane_storage* storage = &draft->storage[index];
    const double h = lane->line.knot_spacing;

    // The first point beside the neighbour determines the station at which the lane starts.
    double station = 0.0, lateral = 0.0;
    trace last = { .s = 0.0 };
    uint32_t first = 0;
    while (first < lane->line.knot_count
           && !find_beside(lane, beside, h * (double)first, &station, &lateral, &last)) {
        ++first;
    }
    if (first == lane->line.knot_count) { // never beside: as if both started together, far apart
        station = beside->station_start;
        lateral = beside_distance;
        first = 0;
    }
    lane->station_start = station - h * (double)first;

    double s = 0.0, at = lane->station_start;
    uint32_t count = 0;
    storage->bins[count++] = (vg_bin){ .s = 0.0f, .lateral = (float)lateral };
    double rate = 1.0;
    for (uint32_t knot = 1; knot < lane->line.knot_count; ++knot) {
        double target = at + h, aside = lateral;
        if (knot > first && find_beside(lane, beside, h * (double)knot, &target, &aside, &last)) {
            lateral = aside;
        }
        const double step = vg_clamp(target - at, rate_min * h, rate_max * h);
        rate = step / h;
        double next_bin = lane->station_start + VG_BIN * (double)count;
        while (next_bin <= at + step && count + 1u < storage->bin_capacity) { // one is for the end
            storage->bins[count++] = (vg_bin){ .s = (float)(s + (next_bin - at) / rate),
                                               .lateral = (float)lateral };
            next_bin = lane->station_start + VG_BIN * (double)count;
        }
        at += step;
        s = h * (double)knot;
    }
    do { // on beyond the end, so that the bins cover it
        const double next_bin = lane->station_start + VG_BIN * (double)count;
        VERGE_ASSERT(count < storage->bin_capacity);
        storage->bins[count++] = (vg_bin){ .s = (float)(s + (next_bin - at) / rate),
                                           .lateral = (float)lateral };
    } while (count < 2);
    lane->bin_count = count;
    lane->station_end = vg_lane_station(lane, lane->length);
}

static double trace_project(const trace* at, const vg_lane* neighbour, double x, double y)
{
    return at->beside ? vg_lane_project(neighbour, x, y, at->s)
                      : vg_lane_project_whole(neighbour, x, y, at->s);
}

/// Station and lateral position of the lane's point at s, by the neighbour that has its place.
static bool find_beside(const vg_lane* lane, const vg_lane* neighbour, double s, double* station,
                        double* lateral, trace* last)
{
    const vg_reference at = vg_lane_at(lane, s);
    const double other = trace_project(last, neighbour, at.x, at.y);
    *last = (trace){ .s = other };
    if (!(other >= -end_slack && other <= neighbour->length + end_slack)) {
        return false;
    }
    const vg_reference there = vg_lane_at(neighbour, other);
    const double d = (at.y - there.y) * there.cos_heading - (at.x - there.x) * there.sin_heading;
    const double cosine = at.cos_heading * there.cos_heading + at.sin_heading * there.sin_heading;
    if (vg_abs(d) > beside_distance || cosine < beside_cosine) {
        return false;
    }
    last->beside = true;
    *station = vg_lane_station(neighbour, other);

    const double bins = (*station - neighbour->station_start) / VG_BIN;
    const uint32_t bin = (uint32_t)vg_clamp(bins, 0.0, (double)(neighbour->bin_count - 2));
    const double t = bins - (double)bin;
    const vg_bin* here = &neighbour->bins[bin];
    *lateral = d + (1.0 - t) * (double)here[0].lateral + t * (double)here[1].lateral;
    return true;
}

static void fill_gaps(vg_road_draft* draft, uint32_t index)
{
    vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    trace on_left = { .s = 0.0 }, on_right = { .s = 0.0 };
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        const double s = (double)bins[i].s;
        bins[i].left_gap = gap_at(draft, index, true, s, &on_left);
        bins[i].right_gap = gap_at(draft, index, false, s, &on_right);
        lane->change_left = lane->change_left || bins[i].left_gap > 0.0f;
        lane->change_right = lane->change_right || bins[i].right_gap > 0.0f;
    }
}

/// Curvature at s, also of the lane before or behind it.
static double curvature_at(const verge_road* road, uint32_t index, double s)
{
    const vg_lane* lane = &road->lanes[index];
    if (s < 0.0 && vg_lane_predecessor_count(road, index) > 0) {
        lane = &road->lanes[road->predecessors[road->predecessors_from[index]]];
        return vg_lane_at(lane, lane->length).curvature;
    }
    if (s > lane->length && lane->successor_count > 0) {
        lane = &road->lanes[lane->successors[0]];
        return vg_lane_at(lane, 0.0).curvature;
    }
    return vg_lane_at(lane, vg_clamp(s, 0.0, lane->length)).curvature;
}

/// The limit, and what the sharpest bend near each bin allows, and how fast it begins and ends.
static void fill_speeds(vg_road_draft* draft, uint32_t index)
{
    const vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        const double from = (double)bins[i].s - bend_reach;
        const uint32_t samples = (uint32_t)(2.0 * bend_reach + rate_max * VG_BIN);
        double sharpest = 0.0, fastest = 0.0;
        for (uint32_t k = 0; k <= samples; ++k) {
            const double s = vg_clamp(from + (double)k, 0.0, lane->length);
            const double change = curvature_at(draft->road, index, s + bend_begins)
                                  - curvature_at(draft->road, index, s - bend_begins);
            sharpest = vg_max(sharpest, vg_abs(vg_lane_at(lane, s).curvature));
            fastest = vg_max(fastest, vg_abs(change) / (2.0 * bend_begins));
        }
        const double bend = vg_sqrt(bend_lateral / vg_max(sharpest, 1e-6));
        const double steering = bend_rate / vg_max(fastest, 1e-6);
        bins[i].speed = (float)vg_min(lane->speed_limit, vg_min(bend, steering));
    }
}

/// Limits the speeds so that a gentle deceleration reaches every lower speed ahead. At the end of a
/// lane the fastest successor counts, because the route is not known.
static void look_ahead(vg_road_draft* draft, uint32_t index)
{
    vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    double after = lane->successor_count > 0 ? 0.0 : VG_HUGE;
    for (uint32_t k = 0; k < lane->successor_count; ++k) {
        after = vg_max(after, (double)draft->storage[lane->successors[k]].bins[0].speed);
    }
    double distance = 0.0;
    lane->speed_min = VG_HUGE;
    for (uint32_t i = lane->bin_count; i > 0; --i) {
        vg_bin* bin = &bins[i - 1u];
        const double most = vg_sqrt(after * after + 2.0 * approach * distance);
        bin->speed = (float)vg_min((double)bin->speed, most);
        after = (double)bin->speed;
        distance = i > 1u ? (double)(bin->s - bins[i - 2u].s) : 0.0;
        lane->speed_min = vg_min(lane->speed_min, (double)bin->speed);
    }
}

/// [m] to the neighbour's centre where a change to it is possible and allowed, else 0.
static float gap_at(const vg_road_draft* draft, uint32_t index, bool left, double s, trace* last)
{
    const vg_lane* lane = &draft->road->lanes[index];
    const verge_lane_def* def = &draft->def->lanes[index];
    const int32_t other = left ? lane->left : lane->right;
    if (other < 0 || s > lane->length + end_slack) {
        return 0.0f;
    }
    const bool given = left ? def->change_left_given : def->change_right_given;
    const uint32_t count = left ? def->change_left_count : def->change_right_count;
    const verge_stretch* stretches = left ? def->change_left : def->change_right;
    bool allowed = !given;
    for (uint32_t i = 0; given && i < count; ++i) {
        allowed = allowed || (s >= stretches[i].s0 && s <= stretches[i].s1);
    }
    if (!allowed) {
        return 0.0f;
    }
    const vg_lane* neighbour = &draft->road->lanes[other];
    const vg_reference at = vg_lane_at(lane, s);
    const double there_s = trace_project(last, neighbour, at.x, at.y);
    *last = (trace){ .s = there_s };
    if (!(there_s >= -end_slack && there_s <= neighbour->length + end_slack)) {
        return 0.0f;
    }
    const vg_reference there = vg_lane_at(neighbour, there_s);
    const double d = (at.y - there.y) * there.cos_heading - (at.x - there.x) * there.sin_heading;
    const double cosine = at.cos_heading * there.cos_heading + at.sin_heading * there.sin_heading;
    const double gap = left ? -d : d;
    const double width = 0.5 * (lane->width + neighbour->width);
    if (!(gap >= gap_min * width && gap <= VG_BESIDE_WIDTHS_MAX * width
          && cosine >= change_cosine)) {
        return 0.0f;
    }
    last->beside = true;
    return (float)gap;
}
