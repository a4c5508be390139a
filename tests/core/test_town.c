/// Goal: roads of real size are built, and what a planner knows of the lanes near its vehicles is
/// what a table over all lanes would say.
/// Method: a generated town of 1,024 lanes and a junction of 68; a dense table of all relations and
/// routes, computed here, as oracle for small towns and junctions with random changes.
#include "check.h"
#include "rng.h"
#include "road/build.h"
#include "road/local.h"
#include "base/scalar.h"
#include "town.h"
#include "verge/planner.h"
#include "verge/simulate.h"

#include <stdlib.h>

static town t;

typedef struct built {
    verge_road_def def;
    void *memory, *scratch_memory, *local_memory;
    size_t size;
    struct verge_road* road;
    vg_local* local;
} built;

static built* build(void)
{
    built* b = calloc(1, sizeof *b);
    b->def = (verge_road_def){ t.lanes, t.count };
    verge_road_fault fault;
    if (verge_road_check(&b->def, &fault) != VERGE_OK) {
        fail_msg("lane %u, %s: %s", fault.lane_index, fault.field, fault.text);
    }
    vg_arena measure, arena, scratch;
    vg_arena_init(&measure, NULL, 0);
    (void)vg_road_build(&measure, NULL, &b->def);
    const size_t scratch_size = vg_road_scratch_size(&b->def);
    b->size = measure.used;
    b->memory = aligned_alloc(64, measure.used);
    b->scratch_memory = aligned_alloc(64, (scratch_size + 63) / 64 * 64);
    vg_arena_init(&arena, b->memory, measure.used);
    vg_arena_init(&scratch, b->scratch_memory, scratch_size);
    b->road = vg_road_build(&arena, &scratch, &b->def);
    assert_non_null(b->road);
    vg_arena_init(&measure, NULL, 0);
    (void)vg_local_take(&measure, t.count, 64, 16);
    vg_local_take_scratch(NULL, &measure, t.count, 64);
    b->local_memory = aligned_alloc(64, measure.used);
    vg_arena_init(&arena, b->local_memory, measure.used);
    b->local = vg_local_take(&arena, t.count, 64, 16);
    vg_local_take_scratch(b->local, &arena, t.count, 64);
    return b;
}

static void built_free(built* b)
{
    free(b->memory);
    free(b->scratch_memory);
    free(b->local_memory);
    free(b);
}

// ------------------------------------------------------------------------------ the oracle

enum { DENSE_MAX = 200 };

typedef struct dense {
    const struct verge_road* road;
    vg_reach reach[DENSE_MAX][DENSE_MAX]; ///< [from][to]
    double   ring[DENSE_MAX];
} dense;

static dense d;

static double lateral_at(const vg_lane* lane, double s)
{
    const double bins = (vg_lane_station(lane, s) - lane->station_start) / VG_BIN;
    const uint32_t bin = (uint32_t)vg_clamp(bins, 0.0, lane->bin_count - 2.0);
    const double part = bins - bin;
    return (1.0 - part) * (double)lane->bins[bin].lateral
           + part * (double)lane->bins[bin + 1].lateral;
}

/// Relaxes until nothing improves: no queue, no bound on what is looked at.
static void dense_walk(uint32_t from)
{
    const struct verge_road* road = d.road;
    static vg_reach entry[DENSE_MAX];
    const uint32_t home = road->lanes[from].bundle;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        d.reach[from][i].cost = entry[i].cost = VG_HUGE;
        if (road->lanes[i].bundle == home) {
            entry[i] = (vg_reach){ .cost = i == from ? 0.0 : 5.0 };
        }
    }
    for (bool more = true; more;) {
        more = false;
        for (uint32_t at = 0; at < road->lane_count; ++at) {
            const vg_lane* lane = &road->lanes[at];
            for (uint32_t k = 0; entry[at].cost < VG_RELATION_REACH && k < lane->successor_count; ++k) {
                const vg_lane* next = &road->lanes[lane->successors[k]];
                const double offset = entry[at].offset + lane->station_end - next->station_start;
                const double lateral = entry[at].lateral + lateral_at(lane, lane->length)
                                       - lateral_at(next, 0.0);
                if (next->bundle == home) {
                    continue;
                }
                for (uint32_t i = 0; i < road->lane_count; ++i) {
                    const double cost = entry[at].cost + (lane->bundle == home ? 0.0 : lane->length)
                                        + ((int32_t)i == lane->successors[k] ? 0.0 : 5.0);
                    if (road->lanes[i].bundle == next->bundle && cost < entry[i].cost) {
                        d.reach[from][i] = entry[i] = (vg_reach){ cost, offset, lateral };
                        more = true;
                    }
                }
            }
        }
    }
}

static void dense_from(const struct verge_road* road)
{
    assert_true(road->lane_count <= DENSE_MAX);
    d.road = road;
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        dense_walk(i);
    }
}

/// The kind of relation, and how clearly it wins: by how many metres.
static uint8_t dense_kind(uint32_t a, uint32_t b, double* offset, double* clearly)
{
    const uint32_t n = d.road->lane_count;
    double cost[4] = { d.reach[a][b].cost, d.reach[b][a].cost, VG_HUGE, VG_HUGE };
    static const uint8_t kinds[4] = { VG_DOWNSTREAM, VG_UPSTREAM, VG_MERGING, VG_UNRELATED };
    double offsets[4] = { d.reach[a][b].offset, -d.reach[b][a].offset, 0.0, 0.0 };
    double unsure = VG_HUGE;
    *clearly = VG_HUGE;
    if (d.road->lanes[a].bundle == d.road->lanes[b].bundle) {
        return VG_SAME_BUNDLE;
    }
    for (uint32_t c = 0; c < n; ++c) {
        const double merge = vg_max(d.reach[a][c].cost, d.reach[b][c].cost);
        const double by = d.reach[a][c].offset - d.reach[b][c].offset;
        if (fabs(by - offsets[2]) > 1e-3) { // two common lanes, as near, that say different things
            unsure = vg_min(unsure, fabs(merge - cost[2]));
        }
        if (merge < cost[2]) {
            cost[2] = merge;
            offsets[2] = d.reach[a][c].offset - d.reach[b][c].offset;
        }
        cost[3] = vg_min(cost[3], vg_max(d.reach[c][a].cost, d.reach[c][b].cost));
    }
    uint32_t best = 0;
    for (uint32_t k = 1; k < 4; ++k) {
        best = cost[k] < cost[best] ? k : best;
    }
    for (uint32_t k = 0; k < 4; ++k) {
        *clearly = k == best ? *clearly : vg_min(*clearly, cost[k] - cost[best]);
    }
    *offset = offsets[best];
    *clearly = best == 2 ? vg_min(*clearly, unsure) : *clearly;
    if (best == 3 && cost[0] >= VG_HUGE && cost[1] >= VG_HUGE && cost[2] >= VG_HUGE) {
        *clearly = VG_HUGE;
    }
    return cost[best] >= VG_HUGE ? VG_UNRELATED : kinds[best];
}

/// Lanes a little longer or shorter, some turns closed.
static void disturb(test_rng* rng)
{
    for (uint32_t i = 0; i < t.count; ++i) {
        verge_lane_def* lane = &t.lanes[i];
        if (lane->point_count == 2 && test_rng_below(rng, 4) == 0 && lane->successor_count > 1) {
            --lane->successor_count;
        }
    }
}

static void test_relations_of_near_lanes_are_those_of_a_table_of_all(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("relations");
    for (uint32_t round = 0; round < test_rounds(6); ++round) {
        if (round % 2 == 0) { // 64 lanes and fewer: all are near
            town_grid(&t, 1 + (int)test_rng_below(&rng, 2), test_rng_between(&rng, 60.0, 120.0));
        } else {
            town_junction(&t, 1 + (int)test_rng_below(&rng, 2));
        }
        disturb(&rng);
        built* b = build();
        if (t.count <= VERGE_LANES_NEAR_MAX) {
            dense_from(b->road);
            vg_local_cover(b->local, b->road, NULL, 0);
            for (uint32_t i = 0; i < t.count * t.count; ++i) {
                double offset = 0.0, clearly;
                const uint8_t kind = dense_kind(i / t.count, i % t.count, &offset, &clearly);
                const vg_relation near = vg_local_relation(b->local, i / t.count, i % t.count);
                if (clearly > 1e-3 && near.kind != kind) {
                    fail_msg("lanes %u, %u: %u, expected %u", i / t.count, i % t.count, near.kind,
                             kind);
                }
                if (clearly > 1e-3 && kind != VG_UNRELATED && kind != VG_SAME_BUNDLE) {
                    CHECK_NEAR(near.offset, offset, 1e-3);
                }
            }
        }
        built_free(b);
    }
}

static void test_on_a_large_road_what_is_near_a_vehicle_is_related_as_ever(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("near a vehicle");
    town_grid(&t, 3, 70.0); // 156 lanes
    built* b = build();
    dense_from(b->road);
    for (uint32_t round = 0; round < test_rounds(20); ++round) {
        const uint32_t lane = test_rng_below(&rng, t.count);
        const vg_source source = { .lane = lane, .s = 1.0, .controlled = true };
        vg_local_cover(b->local, b->road, &source, 1);
        assert_int_equal(b->local->count, VERGE_LANES_NEAR_MAX);
        assert_true(b->local->place[lane] != VG_NOT_LOCAL);
        for (uint32_t other = 0; other < t.count; ++other) {
            const double down = d.reach[lane][other].cost, up = d.reach[other][lane].cost;
            double offset = 0.0, clearly;
            const uint8_t kind = dense_kind(lane, other, &offset, &clearly);
            if (vg_min(down, up) < 60.0 && clearly > 1e-3) {
                assert_int_equal(vg_local_relation(b->local, lane, other).kind, kind);
            }
        }
        for (uint32_t k = b->road->conflicts_from[lane]; k < b->road->conflicts_from[lane + 1]; ++k) {
            assert_true(b->local->place[b->road->conflicts[k].other] != VG_NOT_LOCAL);
        }
    }
    built_free(b);
}

static void check_same_relation(vg_relation a, vg_relation b)
{
    assert_int_equal(a.kind, b.kind);
    assert_true(a.offset == b.offset && a.lateral == b.lateral);
    assert_true(a.period == b.period && a.touch == b.touch);
}

static void test_near_lanes_depend_on_the_scene_alone(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("same scene");
    town_grid(&t, 3, 70.0);
    built *b = build(), *fresh = build();
    for (uint32_t round = 0; round < test_rounds(10); ++round) {
        vg_source sources[4];
        for (uint32_t i = 0; i < 4; ++i) {
            sources[i] = (vg_source){ .lane = test_rng_below(&rng, t.count), .controlled = i < 2 };
        }
        vg_local_cover(b->local, b->road, sources, 4); // after others
        if (round % 3 == 0) {
            vg_local_cover(fresh->local, b->road, sources, 1);
        }
        vg_local_cover(fresh->local, b->road, sources, 4);
        assert_int_equal(b->local->count, fresh->local->count);
        assert_memory_equal(b->local->lanes, fresh->local->lanes,
                            b->local->count * sizeof b->local->lanes[0]);
        const int32_t target = (int32_t)test_rng_below(&rng, t.count);
        const uint32_t column = vg_local_column(b->local, target);
        const uint32_t other_column = vg_local_column(fresh->local, target);
        for (uint32_t i = 0; i < b->local->count; ++i) {
            for (uint32_t k = 0; k < b->local->count; ++k) {
                const uint32_t from = b->local->lanes[i], to = b->local->lanes[k];
                check_same_relation(vg_local_relation(b->local, from, to),
                                    vg_local_relation(fresh->local, from, to));
                assert_int_equal(vg_local_matters(b->local, column, from, to),
                                 vg_local_matters(fresh->local, other_column, from, to));
            }
        }
    }
    built_free(b);
    built_free(fresh);
}

/// Shortest way from every lane to one by brute force, counting no lane's own length at the target.
static void test_routes_are_shortest_ways(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("routes");
    town_grid(&t, 3, 70.0);
    disturb(&rng);
    built* b = build();
    static double way[TOWN_LANES_MAX];
    for (uint32_t round = 0; round < test_rounds(10); ++round) {
        const uint32_t target = test_rng_below(&rng, t.count);
        for (uint32_t i = 0; i < t.count; ++i) {
            way[i] = vg_road_continues(b->road, target, i) ? 0.0 : VG_HUGE;
        }
        for (bool more = true; more;) {
            more = false;
            for (uint32_t i = 0; i < t.count; ++i) {
                const vg_lane* lane = &b->road->lanes[i];
                for (uint32_t k = 0; k < lane->successor_count; ++k) {
                    if (way[lane->successors[k]] + lane->length < way[i]) {
                        way[i] = way[lane->successors[k]] + lane->length;
                        more = true;
                    }
                }
            }
        }
        for (uint32_t i = 0; i < t.count; ++i) {
            const vg_lane* lane = &b->road->lanes[i];
            const int32_t next = vg_road_next(b->road, i, (int32_t)target);
            assert_int_equal(vg_road_changes(b->road, i, target), way[i] < VG_HUGE ? 0 : VG_NEVER);
            for (uint32_t k = 0; way[i] < VG_HUGE && k < lane->successor_count; ++k) {
                CHECK_AT_MOST(way[next], way[lane->successors[k]]);
            }
            assert_int_equal(verge_road_next(b->road, (int32_t)i, (int32_t)target), next);
        }
    }
    built_free(b);
}

/// Each projection of a point is that of all lanes one by one.
static void test_a_point_is_found_among_1024_lanes(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("points");
    town_grid(&t, 8, 80.0);
    assert_int_equal(t.count, 1024);
    built* b = build();
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        const double heading = test_rng_between(&rng, -3.1, 3.1);
        double x = test_rng_between(&rng, -100.0, 660.0), y = test_rng_between(&rng, -100.0, 660.0);
        if (round % 2 == 0) { // on a lane, or beside it
            const vg_lane* lane = &b->road->lanes[test_rng_below(&rng, t.count)];
            const vg_reference at = vg_lane_at(lane, test_rng_between(&rng, -3.0, lane->length + 3.0));
            const double aside = test_rng_between(&rng, -4.0, 4.0);
            x = at.x - aside * at.sin_heading;
            y = at.y + aside * at.cos_heading;
        }
        const verge_lane_position found = verge_road_project(b->road, x, y, heading, VERGE_NO_LANE);
        int32_t best = VERGE_NO_LANE;
        double least = 1e30;
        for (uint32_t i = 0; i < t.count; ++i) {
            const verge_lane_position at = verge_road_project_on(b->road, (int32_t)i, x, y);
            const double turn = fabs(vg_wrap_angle(heading - at.heading));
            const double aside = fmax(fabs(at.d) - 1.75, 0.0);
            const double beyond = fmax(fmax(-at.s, at.s - b->road->lanes[i].length), 0.0);
            const double away = hypot(aside, beyond);
            const double misfit = at.contained ? turn + 0.1 * fabs(at.d) / 1.75
                                  : away <= 2.0 ? 1e3 + away : 1e30;
            if (misfit < least - 1e-12) {
                least = misfit;
                best = (int32_t)i;
            }
        }
        assert_int_equal(found.lane_id, best);
    }
    built_free(b);
}

static void test_conflicts_are_known_to_both_lanes(void** state)
{
    (void)state;
    for (int lanes = 1; lanes <= 3; ++lanes) {
        town_junction(&t, lanes);
        built* b = build();
        const struct verge_road* road = b->road;
        assert_true(road->conflicts_from[t.count] > 0);
        for (uint32_t a = 0; a < t.count; ++a) {
            for (uint32_t k = road->conflicts_from[a]; k < road->conflicts_from[a + 1]; ++k) {
                const vg_conflict* c = &road->conflicts[k];
                bool known = false;
                for (uint32_t m = road->conflicts_from[c->other];
                     m < road->conflicts_from[c->other + 1]; ++m) {
                    const vg_conflict* back = &road->conflicts[m];
                    known = known || (back->other == a && back->from == c->other_from
                                      && back->other_to == c->to);
                }
                assert_true(known);
            }
        }
        built_free(b);
    }
}

static void test_a_lane_that_meets_too_many_others_is_named(void** state)
{
    (void)state;
    memset(&t, 0, sizeof t);
    for (int i = 0; i < VERGE_CONFLICTS_MAX + 10; ++i) { // one lane across all others
        verge_lane_def* lane = town_lane(&t);
        const double x = i == 7 ? -20.0 : 30.0 * i;
        town_point(&t, lane, x, i == 7 ? 0.0 : -20.0);
        town_point(&t, lane, i == 7 ? 30.0 * VERGE_CONFLICTS_MAX + 400.0 : x, i == 7 ? 0.0 : 20.0);
    }
    const verge_road_def def = { t.lanes, t.count };
    verge_road_fault fault;
    assert_int_equal(verge_road_check(&def, &fault), VERGE_ERR_ROAD);
    assert_int_equal(fault.lane_index, 7);
    assert_string_equal(fault.field, "centerline");
    assert_non_null(strstr(fault.text, "VERGE_CONFLICTS_MAX"));
    assert_non_null(strstr(fault.text, "256"));
}

/// What a road keeps grows with its metres and with what lanes meet; a byte a pair of lanes is all
/// that grows faster.
static void test_the_memory_of_a_road_grows_with_what_it_has(void** state)
{
    (void)state;
    for (int road = 0; road < 4; ++road) {
        road == 0 ? town_junction(&t, 1) : road == 1 ? town_junction(&t, 3)
                                                      : town_grid(&t, road == 2 ? 6 : 8, 80.0);
        for (uint32_t i = 0; road == 0 && i < 8; ++i) {
            t.lanes[i].successor_count = 0; // the arms alone
        }
        t.count = road == 0 ? 8 : t.count;
        built* b = build();
        double length = 0.0;
        for (uint32_t i = 0; i < t.count; ++i) {
            length += b->road->lanes[i].length;
        }
        const double pairs = (double)t.count * t.count;
        print_message("memory: %u lanes of %.0f m: %zu B\n", t.count, length, b->size);
        CHECK_AT_MOST((double)b->size, 8e3 + 60.0 * length + 2.5e3 * t.count + pairs);
        built_free(b);
    }
}

// ------------------------------------------------------------------------------ plans

static verge_plan plan;

static verge_planner* planner_on(const verge_planner_def* def, void** memory)
{
    const size_t size = verge_planner_memory_size(def);
    assert_true(size > 0);
    verge_planner* planner = NULL;
    *memory = aligned_alloc(64, (size + 63) / 64 * 64);
    assert_int_equal(verge_planner_init(&planner, def, *memory, size), VERGE_OK);
    return planner;
}

/// Vehicles spread over a road, each wanting to go where its lane leads some lanes on.
static uint32_t traffic(const verge_road* road, test_rng* rng, uint32_t lanes, verge_vehicle* vehicles,
                        uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        verge_vehicle* v = &vehicles[i];
        *v = verge_vehicle_default();
        v->id = (int32_t)i;
        v->controlled = i % 4 == 0;
        int32_t lane;
        do {
            lane = (int32_t)test_rng_below(rng, lanes);
        } while (verge_road_length(road, lane) < 30.0);
        const double s = test_rng_between(rng, 5.0, verge_road_length(road, lane) - 5.0);
        verge_road_at(road, lane, s, 0.0, &v->x, &v->y, &v->heading);
        v->speed = test_rng_between(rng, 2.0, 10.0);
        for (int k = 0; k < 6 && v->controlled; ++k) {
            const int32_t next = verge_road_next(road, lane, VERGE_NO_LANE);
            lane = next == VERGE_NO_LANE ? lane : next;
        }
        v->target_lane = v->controlled ? lane : VERGE_NO_LANE;
    }
    return count;
}

static void test_vehicles_are_planned_for_in_a_town_and_on_a_large_junction(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("traffic");
    for (int large = 0; large < 2; ++large) {
        large ? town_grid(&t, 8, 80.0) : town_junction(&t, 3);
        assert_int_equal(t.count, large ? 1024 : 68);
        verge_planner_def def = verge_planner_default_def();
        def.road = (verge_road_def){ t.lanes, t.count };
        def.iterations = 300;
        void* memory;
        verge_planner* planner = planner_on(&def, &memory);
        verge_humans* humans = NULL;
        const size_t size = verge_humans_memory_size(&def);
        void* humans_memory = aligned_alloc(64, (size + 63) / 64 * 64);
        assert_int_equal(verge_humans_init(&humans, &def, humans_memory, size), VERGE_OK);
        for (uint32_t round = 0; round < test_rounds(5); ++round) {
            verge_vehicle vehicles[40];
            traffic(verge_planner_road(planner), &rng, t.count, vehicles, 40);
            assert_int_equal(verge_planner_step(planner, round, vehicles, 40, &plan), VERGE_OK);
            assert_int_equal(plan.vehicle_count, 10);
            assert_int_equal(plan.prediction_count, 30);
            for (uint32_t i = 0; i < plan.vehicle_count; ++i) {
                assert_true(plan.vehicles[i].reason != VERGE_REASON_OFF_ROAD);
            }
            const verge_road* road = verge_planner_road(planner);
            assert_int_equal(verge_humans_advance(humans, road, NULL, vehicles, 40, 0.1), VERGE_OK);
            for (uint32_t i = 0; i < 40; ++i) {
                assert_int_equal(verge_road_check_vehicle(road, &vehicles[i], NULL), VERGE_OK);
            }
        }
        free(memory);
        free(humans_memory);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_relations_of_near_lanes_are_those_of_a_table_of_all),
        cmocka_unit_test(test_on_a_large_road_what_is_near_a_vehicle_is_related_as_ever),
        cmocka_unit_test(test_near_lanes_depend_on_the_scene_alone),
        cmocka_unit_test(test_routes_are_shortest_ways),
        cmocka_unit_test(test_a_point_is_found_among_1024_lanes),
        cmocka_unit_test(test_conflicts_are_known_to_both_lanes),
        cmocka_unit_test(test_a_lane_that_meets_too_many_others_is_named),
        cmocka_unit_test(test_the_memory_of_a_road_grows_with_what_it_has),
        cmocka_unit_test(test_vehicles_are_planned_for_in_a_town_and_on_a_large_junction),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
