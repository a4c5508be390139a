// Firmware of an on-vehicle unit: plans one vehicle among 8 neighbours, ten times a second, without
// an operating system. All memory is static; that of the planner is in a linker section of its own.
// Results go to the UART. Ends with 1 where a call fails.
#include "board.h"
#include "vehicle.h"

#define ARENA static __attribute__((section(".arena"), aligned(64)))

ARENA unsigned char           decider_memory[28 << 10];
ARENA unsigned char           predictor_memory[1280];
ARENA unsigned char           sampler_memory[41 << 10];
ARENA verge_track             bodies[VEHICLES];
ARENA verge_vehicle           heard[VEHICLES], vehicles[VEHICLES];
ARENA verge_lane_position     positions[VEHICLES];
ARENA verge_commitment        commitment; // the decision of the last cycle
ARENA verge_vehicle_decision  decisions[1];
ARENA verge_vehicle_plan      plans[2]; // of this cycle and of the last one, in turn
static unsigned char          road_memory[192 << 10] __attribute__((aligned(64)));
static verge_decider*         decider;
static verge_predictor*       predictor;
static verge_sampler*         sampler;

/// The assert hook of the library, for a build without NDEBUG.
void verge_assert_failed(const char* condition, const char* file, int line)
{
    (void)line;
    board_write(file);
    board_write(": assertion failed: ");
    board_write(condition);
    board_write("\n");
    board_exit(3);
}

static void write_number(const char* name, uint64_t value)
{
    char text[17] = "0000000000000000";
    for (int i = 15; value != 0; --i, value /= 16) {
        text[i] = "0123456789abcdef"[value % 16];
    }
    board_write(name);
    board_write(text);
}

/// A number that differs where any point of the plan does (FNV-1a).
static uint64_t digest(const verge_vehicle_plan* plan)
{
    uint64_t hash = 0xcbf29ce484222325;
    const unsigned char* bytes = (const unsigned char*)plan->points;
    for (size_t i = 0; i < plan->point_count * sizeof plan->points[0]; ++i) {
        hash = (hash ^ bytes[i]) * 0x100000001b3;
    }
    return hash;
}

static verge_status start(const verge_road** road)
{
    verge_planner_def def = verge_planner_default_def();
    def.vehicles_max = VEHICLES;
    def.controlled_max = 1;
    def.search = VERGE_SEARCH_POLICY;
    def.road = vehicle_road();
    verge_status status = verge_road_init(road, &def.road, road_memory, sizeof road_memory);
    def.road.lane_count = 0; // any road
    if (status == VERGE_OK) {
        status = verge_decider_init(&decider, &def, decider_memory, sizeof decider_memory);
    }
    if (status == VERGE_OK) {
        status = verge_predictor_init_shared(&predictor, decider, predictor_memory,
                                             sizeof predictor_memory);
    }
    if (status == VERGE_OK) {
        status = verge_sampler_init(&sampler, &def, sampler_memory, sizeof sampler_memory);
    }
    return status;
}

/// One cycle: from the states of all vehicles to the plan of the own one.
static verge_status plan_cycle(verge_scene* scene, const verge_vehicle_plan* before,
                               verge_vehicle_plan* plan)
{
    verge_tracks tracks = verge_tracks_make(bodies, VEHICLES);
    verge_decision decision = verge_decision_make(decisions, 1);
    verge_status status = verge_scene_place(scene, scene->utime + CYCLE_US, heard, VEHICLES, NULL);
    if (status == VERGE_OK) {
        status = verge_decide(decider, scene, &commitment, &decision);
    }
    if (status == VERGE_OK) {
        status = verge_predict(predictor, scene, &decision, &tracks);
    }
    if (status == VERGE_OK) {
        status = verge_plan_vehicle(sampler, scene, decisions, &tracks, before, plan);
    }
    return status;
}

int main(void)
{
    const verge_road* road = NULL;
    verge_status status = start(&road);
    verge_scene scene = verge_scene_make(road, vehicles, positions, VEHICLES);
    for (int i = 0; status == VERGE_OK && board_wait(); ++i) {
        verge_vehicle_plan* plan = &plans[i % 2];
        vehicle_receive(heard);
        const uint32_t begin = board_ticks();
        status = plan_cycle(&scene, i > 0 ? &plans[1 - i % 2] : NULL, plan);
        const uint32_t ticks = board_ticks() - begin;
        if (status == VERGE_OK) {
            vehicle_drive(plan);
            write_number("plan ", digest(plan));
            write_number(" status ", plan->status);
            write_number(" ticks ", ticks);
            board_write("\n");
        }
    }
    board_write(verge_status_text(status));
    board_write("\n");
    return status == VERGE_OK ? 0 : 1;
}
