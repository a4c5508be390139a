// The joint planner of a roadside unit on a board: as many vehicles as the capacities allow, on
// four lanes. tools/machines measures a cycle with it.
#include "board.h"

#include <verge/verge.h>

enum { LANES = 4, CYCLES = 3, CYCLE_US = 500000 };
#define LENGTH 600.0 // [m] of the road
#define SPACING 25.0 // [m] from vehicle to vehicle in a lane

static unsigned char memory[7 << 20] __attribute__((aligned(64)));
static verge_vehicle vehicles[VERGE_VEHICLES_MAX];
static verge_plan    plan;

static verge_road_def road(void)
{
    static double         points[LANES][2][2];
    static verge_lane_def lanes[LANES];
    for (int i = 0; i < LANES; ++i) {
        points[i][0][1] = points[i][1][1] = 3.5 * i;
        points[i][1][0] = LENGTH;
        lanes[i] = verge_lane_def_default();
        lanes[i].id = i;
        lanes[i].points = points[i];
        lanes[i].point_count = 2;
        lanes[i].width = 3.5;
        lanes[i].speed_limit = 25.0;
        lanes[i].left = i + 1 < LANES ? i + 1 : VERGE_NO_LANE;
        lanes[i].right = i > 0 ? i - 1 : VERGE_NO_LANE;
    }
    const verge_road_def def = { lanes, LANES };
    return def;
}

/// The controlled vehicles are spread over the flow, and each wants to be in another lane.
static void set_vehicles(void)
{
    const int planned_each = VERGE_VEHICLES_MAX / VERGE_CONTROLLED_MAX;
    for (int i = 0; i < VERGE_VEHICLES_MAX; ++i) {
        const int lane = i % LANES;
        verge_vehicle* vehicle = &vehicles[i];
        *vehicle = verge_vehicle_default();
        vehicle->id = i;
        vehicle->x = 20.0 + SPACING * (i / LANES) + 5.0 * lane;
        vehicle->y = 3.5 * lane;
        vehicle->speed = 12.0 + 2.0 * lane - 0.1 * (i / LANES);
        vehicle->controlled = (i + i / LANES) % planned_each == 0;
        vehicle->target_lane = vehicle->controlled ? (lane + 1) % LANES : VERGE_NO_LANE;
    }
}

static void write_line(const char* name, uint64_t value)
{
    char text[17] = "0000000000000000";
    for (int i = 15; value != 0; --i, value /= 16) {
        text[i] = "0123456789abcdef"[value % 16];
    }
    board_write(name);
    board_write(text);
    board_write("\n");
}

int main(void)
{
    verge_planner_def def = verge_planner_default_def();
    verge_planner* planner = NULL;
    def.road = road();
    set_vehicles();
    size_t road_size = 0;
    (void)verge_road_memory_size(&def.road, &road_size);
    write_line("arena ", verge_planner_memory_size(&def) - road_size);
    verge_status status = verge_planner_init(&planner, &def, memory, sizeof memory);
    for (int i = 0; i < CYCLES && status == VERGE_OK && board_wait(); ++i) {
        const uint32_t begin = board_ticks();
        status = verge_planner_step(planner, (int64_t)i * CYCLE_US, vehicles, VERGE_VEHICLES_MAX,
                                    &plan);
        write_line("ticks ", board_ticks() - begin);
        write_line("plan ", plan.digest);
        for (uint32_t v = 0; v < VERGE_VEHICLES_MAX; ++v) {
            vehicles[v].x += 1e-6 * CYCLE_US * vehicles[v].speed;
        }
    }
    board_write(verge_status_text(status));
    board_write("\n");
    return status == VERGE_OK ? 0 : 1;
}
