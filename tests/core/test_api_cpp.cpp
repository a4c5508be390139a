// The interface from C++17: one include and no casts.
#include "verge/verge.h"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <type_traits>
#include <vector>

static_assert(std::is_trivially_copyable<verge_plan>::value, "a plan is plain data");
static_assert(std::is_trivially_copyable<verge_planner_def>::value, "a def is plain data");

#define REQUIRE(condition)                                                      \
    do {                                                                        \
        if (!(condition)) {                                                     \
            std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            return 1;                                                           \
        }                                                                       \
    } while (false)

namespace {

struct Free {
    void operator()(void* memory) const { std::free(memory); }
};

int plan_one_lane_change()
{
    const double right[][2] = { { 0.0, 0.0 }, { 300.0, 0.0 } };
    const double left[][2] = { { 0.0, 4.0 }, { 300.0, 4.0 } };
    verge_lane_def lanes[2] = {};
    lanes[0].points = right;
    lanes[1].points = left;
    for (std::int32_t i = 0; i < 2; ++i) {
        lanes[i].id = i;
        lanes[i].point_count = 2;
        lanes[i].width = 4.0;
        lanes[i].speed_limit = 15.0;
        lanes[i].left = i == 0 ? 1 : VERGE_NO_LANE;
        lanes[i].right = i == 1 ? 0 : VERGE_NO_LANE;
    }
    verge_planner_def def = verge_planner_default_def();
    def.road = { lanes, 2 };
    def.iterations = 200;

    const std::size_t size = verge_planner_memory_size(&def);
    REQUIRE(size > 0 && size % 64 == 0);
    std::unique_ptr<void, Free> memory(std::aligned_alloc(64, size));
    verge_planner* planner = nullptr;
    REQUIRE(verge_planner_init(&planner, &def, memory.get(), size) == VERGE_OK);

    std::vector<verge_vehicle> vehicles(2, verge_vehicle_default());
    vehicles[0].id = 7;
    vehicles[0].controlled = true;
    vehicles[0].x = 50.0;
    vehicles[0].speed = 10.0;
    vehicles[0].target_lane = 1;
    vehicles[1].id = 3;
    vehicles[1].x = 80.0;
    vehicles[1].speed = 10.0;
    const auto plan = std::make_unique<verge_plan>();
    REQUIRE(verge_planner_step(planner, 1, vehicles.data(), 2, plan.get()) == VERGE_OK);
    REQUIRE(plan->vehicle_count == 1 && plan->prediction_count == 1);
    REQUIRE(plan->vehicles[0].vehicle_id == 7 && plan->vehicles[0].status == VERGE_PLANNED);
    REQUIRE(plan->search.complete);
    char text[80];
    REQUIRE(verge_action_say(&plan->vehicles[0].actions[0], text, sizeof text) > 0);
    REQUIRE(verge_road_length(verge_planner_road(planner), 1) > 299.0);
    return 0;
}

} // namespace

int main()
{
    const int status = plan_one_lane_change();
    std::puts(status == 0 ? "the C++ caller got its plan" : "the C++ caller failed");
    return status;
}
