// The planner from an installed verge, in C++. Its road has a gap: the planner says so.
#include <verge/verge.h>

#include <iostream>

int main()
{
    const double points[][2] = { { 0.0, 0.0 }, { 300.0, 0.0 } };
    verge_lane_def lane = {};
    lane.points = points;
    lane.point_count = 2;
    lane.width = 3.5;
    lane.speed_limit = 15.0;
    lane.left = lane.right = VERGE_NO_LANE;
    lane.successors[0] = 7; // there is no such lane
    lane.successor_count = 1;
    const verge_road_def road = { &lane, 1 };
    verge_road_fault fault = {};
    const bool refused = verge_road_check(&road, &fault) == VERGE_ERR_ROAD;
    std::cout << "refused " << refused << ", field " << (refused ? fault.field : "none")
              << ", version " << VERGE_VERSION_STRING << "\n";
}
