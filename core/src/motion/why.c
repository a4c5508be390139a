/// See why.h.
#include "motion/why.h"

#include "base/contract.h"
#include "base/scalar.h"
#include "road/road.h"
#include "traffic/actions.h"

// A slower vehicle stands. [m/s]
static const double standing_speed = 0.3;
// Plans are renewed within this time: a vehicle that stands later says so in a later plan. [s]
static const double plan_lasts_s = 1.0;
// What is further ahead is no reason to stand. [m]
static const double reach = 40.0;
// Vehicles this far before an area are about to enter it. [m]
static const double area_reach = 40.0;
// A body that leaves less room than this beside the own one is in its path. [m]
static const double side_room = 0.5;
// Gap in the other lane that a change needs: at rest, and for each m/s. [m], [s]
static const double room_at_rest = 3.0;
static const double room_time = 0.5;

/// A reason to stand, and how far ahead it is.
typedef struct candidate {
    verge_cause cause;
    double      distance; // [m] from the front of the body
} candidate;

static void take(candidate* best, verge_why code, int32_t vehicle_id, int32_t lane_id,
                 double distance)
{
    if (distance < best->distance) {
        *best = (candidate){ { code, vehicle_id, lane_id, 0 }, distance };
    }
}

// ---------------------------------------------------------------------------- what is ahead

typedef struct extent {
    double along, across; // [m] half of the body, along its lane and across it
} extent;

static extent extent_of(const verge_scene* scene, uint32_t k)
{
    const verge_vehicle* v = &scene->vehicles[k];
    double sine, cosine;
    vg_sincos(vg_wrap_angle(v->heading - scene->positions[k].heading), &sine, &cosine);
    sine = vg_abs(sine);
    cosine = vg_abs(cosine);
    return (extent){ 0.5 * (v->length * cosine + v->width * sine),
                     0.5 * (v->length * sine + v->width * cosine) };
}

static int32_t target_of(const verge_scene* scene, uint32_t k)
{
    return scene->vehicles[k].controlled
               ? vg_road_lane_index(scene->road, scene->vehicles[k].target_lane) : -1;
}

// The nearest vehicle ahead in the path of vehicles[own] within `reach`, -1 none; *gap [m] between
// the bodies.
static int32_t find_ahead(const verge_scene* scene, uint32_t own, double* gap)
{
    const verge_road* road = scene->road;
    const verge_lane_position* at = &scene->positions[own];
    const extent body = extent_of(scene, own);
    vg_walk walk = vg_walk_from(road, (uint32_t)vg_road_lane_index(road, at->lane_id),
                                target_of(scene, own));
    double start = -at->s; // of the lane, from the own centre
    int32_t found = -1;
    *gap = reach;
    do {
        const vg_lane* lane = &road->lanes[walk.lane];
        for (uint32_t k = 0; k < scene->vehicle_count; ++k) {
            const verge_lane_position* other = &scene->positions[k];
            if (k == own || other->lane_id != lane->id || start + other->s <= 0.0) {
                continue;
            }
            const extent of = extent_of(scene, k);
            const double between = start + other->s - body.along - of.along;
            if (vg_abs(other->d - at->d) - body.across - of.across < side_room && between < *gap) {
                found = (int32_t)k;
                *gap = between;
            }
        }
        start += lane->length;
    } while (start < reach && vg_walk_on(&walk));
    return found;
}

static verge_why kind_of(const verge_scene* scene, uint32_t own, uint32_t other)
{
    const verge_vehicle* v = &scene->vehicles[other];
    const bool stands = vg_abs(v->speed) < standing_speed;
    double sine, cosine, gap;
    vg_sincos(vg_wrap_angle(v->heading - scene->vehicles[own].heading), &sine, &cosine);
    if (!stands && (cosine < 0.0) != (v->speed < 0.0)) {
        return VERGE_WHY_ONCOMING;
    }
    const bool waits = v->controlled || find_ahead(scene, other, &gap) >= 0
                       || verge_scene_signal(scene, scene->positions[other].lane_id) != NULL;
    return stands && !waits ? VERGE_WHY_OBSTACLE : VERGE_WHY_LEADER;
}

// Who is in an area on `lane`, or about to enter it: the nearest to its end, -1 none.
static int32_t find_at_area(const verge_scene* scene, uint32_t own, uint32_t lane, double from,
                            double to)
{
    int32_t found = -1;
    double nearest = area_reach + vg_max(to - from, 0.0);
    for (uint32_t k = 0; k < scene->vehicle_count; ++k) {
        const verge_lane_position* other = &scene->positions[k];
        if (k == own || other->lane_id != scene->road->lanes[lane].id) {
            continue;
        }
        const double left = to - other->s, body = 0.5 * scene->vehicles[k].length;
        if (left > -body && left < nearest) {
            found = (int32_t)k;
            nearest = left;
        }
    }
    return found;
}

// The areas of one lane, whose start lies `start` ahead of the front.
static void take_areas(const verge_scene* scene, uint32_t own, uint32_t lane, double start,
                       candidate* best)
{
    const verge_road* road = scene->road;
    for (uint32_t i = road->conflicts_from[lane]; i < road->conflicts_from[lane + 1u]; ++i) {
        const vg_conflict* area = &road->conflicts[i];
        const vg_lane* other = &road->lanes[area->other];
        const double distance = start + vg_lane_s(&road->lanes[lane], (double)area->from);
        if (start + vg_lane_s(&road->lanes[lane], (double)area->to) < 0.0 || distance > reach) {
            continue;
        }
        const double from = vg_lane_s(other, (double)area->other_from);
        const double to = vg_lane_s(other, (double)area->other_to);
        const int32_t k = find_at_area(scene, own, area->other, from, to);
        if (k >= 0) {
            take(best, VERGE_WHY_AREA, scene->vehicles[k].id, other->id, vg_max(distance, 0.0));
        }
    }
    for (uint32_t i = road->merges_from[lane]; i < road->merges_from[lane + 1u]; ++i) {
        const vg_lane* other = &road->lanes[road->merges[i].other];
        const double distance = start + road->lanes[lane].length;
        const int32_t k = distance > reach ? -1 : find_at_area(scene, own, road->merges[i].other,
                                                               other->length, other->length);
        if (k >= 0) {
            take(best, VERGE_WHY_MERGE, scene->vehicles[k].id, other->id, vg_max(distance, 0.0));
        }
    }
}

// What the road itself says: signals, stop lines, ends.
static void take_lines(const verge_scene* scene, const vg_lane* lane, bool ends, double start,
                       candidate* best)
{
    const verge_signal* signal = verge_scene_signal(scene, lane->id);
    const double line = start + lane->stop_line, end = start + lane->length;
    const bool near = line > -2.0 && line < reach;
    if (near && signal != NULL
        && (signal->state == VERGE_SIGNAL_RED || signal->state == VERGE_SIGNAL_YELLOW)) {
        take(best, VERGE_WHY_SIGNAL, -1, lane->id, vg_max(line, 0.0));
    } else if (near && lane->priority == VERGE_PRIORITY_STOP) {
        take(best, VERGE_WHY_STOP_LINE, -1, lane->id, vg_max(line, 0.0));
    }
    if (ends && end < reach) {
        take(best, VERGE_WHY_LANE_END, -1, lane->id, vg_max(end, 0.0));
    }
}

static verge_cause standing_cause(const verge_scene* scene, uint32_t own)
{
    const verge_road* road = scene->road;
    const verge_lane_position* at = &scene->positions[own];
    candidate best = { { VERGE_WHY_BLOCKED, -1, at->lane_id, 0 }, reach };
    double gap;
    const int32_t ahead = find_ahead(scene, own, &gap);
    if (ahead >= 0) {
        take(&best, kind_of(scene, own, (uint32_t)ahead), scene->vehicles[ahead].id,
             scene->positions[ahead].lane_id, gap);
    }
    vg_walk walk = vg_walk_from(road, (uint32_t)vg_road_lane_index(road, at->lane_id),
                                target_of(scene, own));
    double start = -at->s - extent_of(scene, own).along;
    for (bool more = true; more && start < reach;) {
        const uint32_t lane = walk.lane;
        more = vg_walk_on(&walk);
        take_areas(scene, own, lane, start, &best);
        take_lines(scene, &road->lanes[lane], !more && walk.passed < VG_WALK_LANES, start, &best);
        start += road->lanes[lane].length;
    }
    return best.cause;
}

// ---------------------------------------------------------------------------- lane changes

// Who leaves no room in `lane`, which runs beside the own one.
static verge_cause room_cause(const verge_scene* scene, uint32_t own, uint32_t lane)
{
    const verge_road* road = scene->road;
    const verge_lane_position* at = &scene->positions[own];
    const vg_lane* here = &road->lanes[vg_road_lane_index(road, at->lane_id)];
    const double station = vg_lane_station(here, at->s), speed = scene->vehicles[own].speed;
    // Here the distance is the share that is there of the room that a change needs.
    candidate best = { { VERGE_WHY_NONE, -1, VERGE_NO_LANE, 0 }, 1.0 };
    for (uint32_t k = 0; k < scene->vehicle_count; ++k) {
        const verge_vehicle* v = &scene->vehicles[k];
        if (k == own || scene->positions[k].lane_id != road->lanes[lane].id) {
            continue;
        }
        const double along = vg_lane_station(&road->lanes[lane], scene->positions[k].s) - station;
        const double gap = vg_abs(along) - 0.5 * (v->length + scene->vehicles[own].length);
        const double closing = along > 0.0 ? speed - v->speed : v->speed - speed;
        const double room = room_at_rest + room_time * (along > 0.0 ? speed : v->speed)
                            + 2.0 * vg_max(closing, 0.0);
        take(&best, along > 0.0 ? VERGE_WHY_ROOM_AHEAD : VERGE_WHY_ROOM_BEHIND, v->id,
             road->lanes[lane].id, gap / room);
    }
    return best.cause;
}

// Why the vehicle is not on its way to its target lane.
static verge_cause change_cause(const verge_scene* scene, uint32_t own,
                                const verge_vehicle_plan* plan)
{
    const verge_cause none = { VERGE_WHY_NONE, -1, VERGE_NO_LANE, 0 };
    const verge_road* road = scene->road;
    const verge_lane_position* at = &scene->positions[own];
    const int32_t target = target_of(scene, own);
    if (target < 0 || verge_road_continues(road, road->lanes[target].id, at->lane_id)) {
        return none;
    }
    const uint32_t lane = (uint32_t)vg_road_lane_index(road, at->lane_id);
    if (vg_road_changes(road, lane, (uint32_t)target) == VG_NEVER) {
        return (verge_cause){ VERGE_WHY_UNREACHABLE, -1, road->lanes[target].id, 0 };
    }
    const int32_t turn = vg_road_turn(road, lane, (uint32_t)target);
    const int32_t beside = turn > 0   ? road->lanes[lane].left
                           : turn < 0 ? road->lanes[lane].right : -1;
    const bool changes = plan->change_lane_id != VERGE_NO_LANE
                         || vg_action_changes_lane(plan->actions[0].action);
    if (beside < 0 || changes) {
        return none;
    }
    VERGE_ASSERT(turn != 0);
    const float station = (float)vg_lane_station(&road->lanes[lane], at->s);
    const vg_bin* bins = road->lanes[lane].bins;
    const double place = ((double)station - road->lanes[lane].station_start) / VG_BIN;
    const uint32_t last = road->lanes[lane].bin_count - 1u;
    const uint32_t bin = place <= 0.0 ? 0u : place >= (double)last ? last : (uint32_t)place;
    const float gap = turn > 0 ? bins[bin].left_gap : bins[bin].right_gap;
    verge_cause cause = { VERGE_WHY_BORDER, -1, road->lanes[beside].id, 0 };
    if (gap > 0.0f) {
        cause = room_cause(scene, own, (uint32_t)beside);
    }
    cause.side = turn;
    return cause;
}

// ---------------------------------------------------------------------------- the plan

static bool stands_soon(const verge_vehicle_plan* plan)
{
    bool stands = false;
    for (uint32_t i = 0; i < plan->point_count && plan->points[i].t <= plan_lasts_s; ++i) {
        stands = stands || vg_abs(plan->points[i].speed) < standing_speed;
    }
    return stands;
}

void vg_why_fill(const verge_scene* scene, uint32_t own, verge_vehicle_plan* plan)
{
    VERGE_ASSERT(own < scene->vehicle_count && plan->vehicle_id == scene->vehicles[own].id);
    if (scene->positions[own].lane_id == VERGE_NO_LANE) {
        plan->why = (verge_cause){ VERGE_WHY_OFF_ROAD, -1, VERGE_NO_LANE, 0 };
    } else if (plan->status != VERGE_PLANNED) {
        plan->why = (verge_cause){ VERGE_WHY_FALLBACK, -1, scene->positions[own].lane_id, 0 };
    } else if (plan->why.code == VERGE_WHY_NONE) {
        plan->why = stands_soon(plan) ? standing_cause(scene, own) : change_cause(scene, own, plan);
    }
    VERGE_ASSERT(plan->why.code != VERGE_WHY_NONE || !stands_soon(plan));
}

void vg_why_compare(verge_vehicle_plan* plan, const verge_vehicle_plan* before)
{
    plan->changed = 0;
    if (before == NULL || before->vehicle_id != plan->vehicle_id) {
        plan->changed = VERGE_CHANGED_FIRST;
        return;
    }
    const bool same_why = plan->why.code == before->why.code
                          && (plan->why.code == VERGE_WHY_NONE
                              || (plan->why.vehicle_id == before->why.vehicle_id
                                  && plan->why.lane_id == before->why.lane_id));
    plan->changed |= plan->status != before->status ? (uint32_t)VERGE_CHANGED_STATUS : 0u;
    plan->changed |= plan->action_count > 0 && before->action_count > 0
                             && plan->actions[0].action != before->actions[0].action
                         ? (uint32_t)VERGE_CHANGED_ACTION : 0u;
    plan->changed |= same_why ? 0u : (uint32_t)VERGE_CHANGED_WHY;
    bool same_order = plan->pass_count == before->pass_count;
    for (uint32_t i = 0; same_order && i < plan->pass_count; ++i) {
        same_order = plan->passes[i].after_id == before->passes[i].after_id;
    }
    plan->changed |= same_order ? 0u : (uint32_t)VERGE_CHANGED_ORDER;
}
