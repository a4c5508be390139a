// The planner and a bus from an installed verge, in C.
#include <verge/inbox.h>
#include <verge/verge.h>

#include <stdio.h>

int main(void)
{
    static _Alignas(64) unsigned char memory[16 << 20];
    static verge_plan plan;
    const double line[][2] = { { 0.0, 0.0 }, { 300.0, 0.0 } };
    const verge_lane_def lane = { .points = line, .point_count = 2, .width = 3.5,
                                  .speed_limit = 15.0, .left = VERGE_NO_LANE,
                                  .right = VERGE_NO_LANE };
    verge_planner_def def = verge_planner_default_def();
    def.road = (verge_road_def){ &lane, 1 };
    verge_planner* planner;
    verge_vehicle car = verge_vehicle_default();
    car.x = 50.0;
    car.speed = 10.0;
    car.controlled = true;
    char error[256];
    transport* bus;
    if (verge_planner_init(&planner, &def, memory, sizeof memory) != VERGE_OK ||
        verge_planner_step(planner, 1, &car, 1, &plan) != VERGE_OK ||
        transport_open(&bus, "loop:", TRANSPORT_STATES, error, sizeof error) != TRANSPORT_OK) {
        return 1;
    }
    verge_vehicle_state_t state = wire_state_from_vehicle(&car, VERGE_NORMAL, 1, 1, -1);
    const int sent = transport_publish_state(bus, &state);
    transport_close(bus);
    printf("planned %d, sent %d, version %s\n", plan.vehicles[0].status == VERGE_PLANNED,
           sent == TRANSPORT_OK, VERGE_VERSION_STRING);
    return 0;
}
