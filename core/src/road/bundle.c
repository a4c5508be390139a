/// Lanes that run side by side share one axis of stations and one lateral axis.
///
/// The longest lane of a bundle lends its arc length as station. Every other lane is laid along a
/// neighbour that has its place already: a point's station is that of the neighbour's point next
/// to it. Where the two do not run together (yet, or any more) stations go on metre by metre.
#include "road/build.h"

#include "base/contract.h"
#include "base/scalar.h"

#include <stddef.h>

/// A lane's points this far from the neighbour, or turned this much, are not beside it.
static const double beside_distance = 15.0; // [m]
static const double beside_cosine = 0.7;    // [1]
/// Metres of station a metre of lane, at least and at most. Two lanes of a roundabout are 8 m and
/// 12 m from its centre; more than that is bad survey.
static const double rate_min = 0.5;
static const double rate_max = 2.0;
/// Where a change of lanes is possible: centres between 0.4 and 1.6 mean widths apart, directions
/// within 0.5 rad (cosine).
static const double gap_min = 0.4, gap_max = 1.6;
static const double change_cosine = 0.87758256189037271;

/// Lanes that start or end together do so within this. [m]
static const double end_slack = 0.05;

/// Bends are driven at this lateral acceleration; what lies ahead is slowed down for at this
/// deceleration. [m/s^2] Well inside the comfort limits, so that trajectories have room.
static const double bend_lateral = 2.5;
static const double approach = 0.5;
/// A bin answers for the bends from this before it to this behind the next one. [m]
static const double bend_reach = 2.0;
/// How many short lanes ahead of a slow one know of it.
enum { seam_rounds = 4 };

static uint64_t links_of(const struct verge_road* road, uint32_t lane);
static void lay_first(vg_road_draft* draft, uint32_t lane);
static void lay_beside(vg_road_draft* draft, uint32_t lane, uint32_t neighbour);
static bool find_beside(const vg_lane* lane, const vg_lane* neighbour, double s, double* station,
                        double* lateral, double* guess);
static void fill_gaps(vg_road_draft* draft, uint32_t lane);
static void fill_speeds(vg_road_draft* draft, uint32_t lane);
static void look_ahead(vg_road_draft* draft, uint32_t lane);
static float gap_at(const vg_road_draft* draft, uint32_t lane, bool left, double s, double* guess);

void vg_road_bundle(vg_road_draft* draft)
{
    struct verge_road* road = draft->road;
    uint64_t placed = 0;
    uint32_t bundle = 0;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        if ((placed >> i & 1u) != 0) {
            continue;
        }
        // Everyone connected with i, and the longest of them.
        uint64_t members = (uint64_t)1 << i;
        for (uint64_t before = 0; before != members;) {
            before = members;
            for (uint32_t k = 0; k < road->lane_count; ++k) {
                members |= (before >> k & 1u) != 0 ? links_of(road, k) : 0;
            }
        }
        uint32_t longest = i;
        for (uint32_t k = i; k < road->lane_count; ++k) {
            if ((members >> k & 1u) != 0 && road->lanes[k].length > road->lanes[longest].length) {
                longest = k;
            }
        }
        road->lanes[longest].bundle = bundle;
        lay_first(draft, longest);
        placed |= (uint64_t)1 << longest;

        // Then neighbour by neighbour: always the lowest lane that touches one already placed.
        while ((members & ~placed) != 0) {
            bool laid = false;
            for (uint32_t k = 0; k < road->lane_count && !laid; ++k) {
                const uint64_t beside = links_of(road, k) & placed;
                if (((members & ~placed) >> k & 1u) != 0 && beside != 0) {
                    road->lanes[k].bundle = bundle;
                    lay_beside(draft, k, (uint32_t)__builtin_ctzll(beside));
                    placed |= (uint64_t)1 << k;
                    laid = true;
                }
            }
            VERGE_ASSERT(laid);
        }
        ++bundle;
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        fill_gaps(draft, i);
        fill_speeds(draft, i);
    }
    for (uint32_t round = 0; round < seam_rounds; ++round) { // on over the seams, lane by lane
        for (uint32_t i = 0; i < road->lane_count; ++i) {
            look_ahead(draft, i);
        }
    }
}

uint32_t vg_lane_bin_capacity(const verge_lane_def* lane)
{
    // A line is at most a third longer than its survey (a circle by its inscribed polygon).
    const double bins = rate_max * 1.34 * vg_survey_length(lane) / VG_BIN;
    return (uint32_t)vg_clamp(bins, 0.0, 1e5) + 4;
}

/// Lanes that are neighbours of `lane`, by its own word or by theirs.
static uint64_t links_of(const struct verge_road* road, uint32_t lane)
{
    uint64_t links = 0;
    for (uint32_t k = 0; k < road->lane_count; ++k) {
        const bool mine = road->lanes[lane].left == (int32_t)k
                          || road->lanes[lane].right == (int32_t)k;
        const bool theirs = road->lanes[k].left == (int32_t)lane
                            || road->lanes[k].right == (int32_t)lane;
        links |= k != lane && (mine || theirs) ? (uint64_t)1 << k : 0;
    }
    return links;
}

static void lay_first(vg_road_draft* draft, uint32_t index)
{
    vg_lane* lane = &draft->road->lanes[index];
    const vg_lane_storage* storage = &draft->storage[index];
    lane->station_start = 0.0;
    lane->bin_count = (uint32_t)(vg_clamp(lane->length / VG_BIN, 0.0, 1e5)) + 2;
    VERGE_ASSERT(lane->bin_count <= storage->bin_capacity);
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        storage->bins[i].s = (float)(VG_BIN * (double)i);
    }
    lane->station_end = lane->length;
}

/// Walks the lane in steps of a metre, knows each point's station, and puts down a bin whenever
/// the station has come to the next one.
static void lay_beside(vg_road_draft* draft, uint32_t index, uint32_t neighbour)
{
    vg_lane* lane = &draft->road->lanes[index];
    const vg_lane* beside = &draft->road->lanes[neighbour];
    const vg_lane_storage* storage = &draft->storage[index];
    const double h = lane->line.knot_spacing;

    // The first point beside tells where the lane starts.
    double station = 0.0, lateral = 0.0;
    double guess = __builtin_nan("");
    uint32_t first = 0;
    while (first < lane->line.knot_count
           && !find_beside(lane, beside, h * (double)first, &station, &lateral, &guess)) {
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
        if (knot > first && find_beside(lane, beside, h * (double)knot, &target, &aside, &guess)) {
            lateral = aside;
        }
        const double step = vg_clamp(target - at, rate_min * h, rate_max * h);
        rate = step / h;
        double next_bin = lane->station_start + VG_BIN * (double)count;
        while (next_bin <= at + step && count < storage->bin_capacity) {
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

/// Station and lateral position of the lane's point at s, by the neighbour that has its place.
static bool find_beside(const vg_lane* lane, const vg_lane* neighbour, double s, double* station,
                        double* lateral, double* guess)
{
    const vg_reference at = vg_lane_at(lane, s);
    const double other = vg_lane_project(neighbour, at.x, at.y, *guess);
    if (!(other >= -end_slack && other <= neighbour->length + end_slack)) {
        *guess = __builtin_nan("");
        return false;
    }
    const vg_reference there = vg_lane_at(neighbour, other);
    const double d = (at.y - there.y) * there.cos_heading - (at.x - there.x) * there.sin_heading;
    const double cosine = at.cos_heading * there.cos_heading + at.sin_heading * there.sin_heading;
    if (vg_abs(d) > beside_distance || cosine < beside_cosine) {
        *guess = __builtin_nan("");
        return false;
    }
    *guess = other;
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
    const vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    double left_guess = __builtin_nan("");
    double right_guess = __builtin_nan("");
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        const double s = (double)bins[i].s;
        bins[i].left_gap = gap_at(draft, index, true, s, &left_guess);
        bins[i].right_gap = gap_at(draft, index, false, s, &right_guess);
    }
}

/// The limit, and what the sharpest bend near each bin allows.
static void fill_speeds(vg_road_draft* draft, uint32_t index)
{
    const vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    for (uint32_t i = 0; i < lane->bin_count; ++i) {
        const double from = (double)bins[i].s - bend_reach;
        const uint32_t samples = (uint32_t)(2.0 * bend_reach + rate_max * VG_BIN);
        double sharpest = 0.0;
        for (uint32_t k = 0; k <= samples; ++k) {
            const double s = vg_clamp(from + (double)k, 0.0, lane->length);
            sharpest = vg_max(sharpest, vg_abs(vg_lane_at(lane, s).curvature));
        }
        const double bend = vg_sqrt(bend_lateral / vg_max(sharpest, 1e-6));
        bins[i].speed = (float)vg_min(lane->speed_limit, bend);
    }
}

/// Nobody slows down at once: speeds rise no faster against the direction of travel than a gentle
/// deceleration allows. Over a seam the fastest continuation counts, for the way is not known.
static void look_ahead(vg_road_draft* draft, uint32_t index)
{
    vg_lane* lane = &draft->road->lanes[index];
    vg_bin* bins = draft->storage[index].bins;
    double after = lane->successor_count > 0 ? 0.0 : VG_HUGE;
    for (uint32_t k = 0; k < lane->successor_count; ++k) {
        after = vg_max(after, (double)draft->storage[lane->successors[k]].bins[0].speed);
    }
    double way = 0.0;
    lane->speed_min = VG_HUGE;
    for (uint32_t i = lane->bin_count; i > 0; --i) {
        vg_bin* bin = &bins[i - 1u];
        const double most = vg_sqrt(after * after + 2.0 * approach * way);
        bin->speed = (float)vg_min((double)bin->speed, most);
        after = (double)bin->speed;
        way = i > 1u ? (double)(bin->s - bins[i - 2u].s) : 0.0;
        lane->speed_min = vg_min(lane->speed_min, (double)bin->speed);
    }
}

/// [m] to the neighbour's centre where a change to it is possible and allowed, else 0.
static float gap_at(const vg_road_draft* draft, uint32_t index, bool left, double s, double* guess)
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
    const double there_s = vg_lane_project(neighbour, at.x, at.y, *guess);
    *guess = __builtin_nan("");
    if (!(there_s >= -end_slack && there_s <= neighbour->length + end_slack)) {
        return 0.0f;
    }
    const vg_reference there = vg_lane_at(neighbour, there_s);
    const double d = (at.y - there.y) * there.cos_heading - (at.x - there.x) * there.sin_heading;
    const double cosine = at.cos_heading * there.cos_heading + at.sin_heading * there.sin_heading;
    const double gap = left ? -d : d;
    const double width = 0.5 * (lane->width + neighbour->width);
    if (!(gap >= gap_min * width && gap <= gap_max * width && cosine >= change_cosine)) {
        return 0.0f;
    }
    *guess = there_s;
    return (float)gap;
}
