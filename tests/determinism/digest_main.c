/// Plans every scenario for a few cycles and prints the digest of each plan:
///
///     ramp-3av 0 6c1f0a3b5d7e9f10
///
/// Needs the core and nothing else, so it runs wherever the core compiles: this is the program the
/// determinism tests build with every compiler and for every machine, and whose output they
/// compare with tests/golden.txt. Cycle 0 is what verge-plan prints for the scenario.
///
///     verge_digest [--flush-subnormals] [SCENARIO]
///
/// --flush-subnormals plans in the mode that flushes subnormal numbers to zero (FTZ, DAZ): the
/// digests are promised to be the same.
///
/// Between two cycles controlled vehicles are moved to where their plan puts them, and the others
/// as the planner predicts them; so a difference of one bit anywhere grows.
#include "shipped.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    CYCLES = VERGE_DIGEST_CYCLES, // the first without, the others with a plan to keep to
    CYCLE_POINTS = 5,             // points of the trajectory driven between two cycles
    MEMORY_SIZE = 12 << 20,       // [B] for planner and humans of any scenario
};

// Static, so that the program needs no heap.
static verge_plan plan;
static unsigned char memory[MEMORY_SIZE] __attribute__((aligned(64)));

static void follow_plans(verge_vehicle* vehicles, uint32_t vehicle_count)
{
    for (uint32_t v = 0; v < vehicle_count; ++v) {
        for (uint32_t p = 0; p < plan.vehicle_count; ++p) {
            const verge_vehicle_plan* own = &plan.vehicles[p];
            if (own->vehicle_id == vehicles[v].id && own->point_count > CYCLE_POINTS) {
                const verge_point* at = &own->points[CYCLE_POINTS];
                vehicles[v].x = at->x;
                vehicles[v].y = at->y;
                vehicles[v].heading = at->heading;
                vehicles[v].speed = at->speed;
                vehicles[v].acceleration = at->acceleration;
                vehicles[v].yaw_rate = at->speed * at->curvature;
            }
        }
    }
}

/// Returns 0, or 1 with a line on standard error where the planner refuses the scenario.
static int plan_scenario(const scenario* scene)
{
    verge_planner_def def = verge_planner_default_def();
    def.road.lanes = scene->lanes;
    def.road.lane_count = scene->lane_count;
    scene->set(&def);

    const size_t size = (verge_planner_memory_size(&def) + 63) / 64 * 64;
    const bool fits = size > 0 && size < sizeof memory;
    verge_planner* planner = NULL;
    verge_humans* humans = NULL;
    verge_status status = VERGE_ERR_MEMORY;
    if (fits) {
        status = verge_planner_init(&planner, &def, memory, size);
    }
    if (status == VERGE_OK) {
        status = verge_humans_init(&humans, &def, memory + size, sizeof memory - size);
    }

    static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
    const uint32_t count = scene->vehicle_count;
    for (uint32_t v = 0; v < count && v < VERGE_VEHICLES_MAX; ++v) {
        vehicles[v] = vehicle_from(&scene->vehicles[v]);
    }
    for (uint32_t cycle = 0; cycle < CYCLES && status == VERGE_OK; ++cycle) {
        const int64_t cycle_us = (int64_t)(def.point_s * CYCLE_POINTS * 1e6 + 0.5);
        status = verge_planner_step(planner, cycle * cycle_us, vehicles, count, &plan);
        if (status == VERGE_OK) {
            printf("%s %u %016llx\n", scene->name, (unsigned)cycle,
                   (unsigned long long)plan.digest);
            status = verge_humans_advance(humans, verge_planner_road(planner), NULL, vehicles,
                                          count, def.point_s * CYCLE_POINTS);
            follow_plans(vehicles, count);
        }
    }
    if (status != VERGE_OK) {
        fprintf(stderr, "%s: %s\n", scene->name, verge_status_text(status));
    }
    return status == VERGE_OK ? 0 : 1;
}

static void flush_subnormals(void)
{
#if defined(__x86_64__)
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040u);
#elif defined(__aarch64__)
    uint64_t mode;
    __asm__ volatile("mrs %0, fpcr" : "=r"(mode));
    __asm__ volatile("msr fpcr, %0" : : "r"(mode | (UINT64_C(1) << 24)));
#endif
    const volatile double smallest_normal = 2.2250738585072014e-308;
    if (smallest_normal / 2.0 != 0.0) {
        fputs("this machine keeps subnormal numbers\n", stderr);
        exit(2);
    }
}

int main(int argc, char** argv)
{
    int failed = 0;
    if (argc > 1 && strcmp(argv[1], "--flush-subnormals") == 0) {
        flush_subnormals();
        --argc;
        ++argv;
    }
    for (size_t i = 0; i < sizeof scenarios / sizeof scenarios[0]; ++i) {
        if (argc < 2 || strcmp(argv[1], scenarios[i].name) == 0) {
            failed |= plan_scenario(&scenarios[i]);
            fflush(stdout);
        }
    }
    return failed;
}
