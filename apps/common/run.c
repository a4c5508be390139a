/// See run.h.
#include "run.h"

#include "number.h"
#include "plan_json.h"

static void vehicle_write(FILE* out, const world* world, const world_vehicle* vehicle);

void run_write_head(FILE* out, const scenario* scene)
{
    fputs("{\"format\":\"verge-run/1\",\"scenario\":", out);
    scenario_write(out, scene);
    fputs(",\"dt\":", out);
    number_write(out, WORLD_DT);
    fputs("}\n", out);
}

void run_write_tick(FILE* out, const world* world)
{
    const char* separator = "";
    fputs("{\"t\":", out);
    number_write(out, world_time(world));
    fputs(",\"vehicles\":[", out);
    for (uint32_t i = 0; i < world->vehicle_count; i++) {
        if (world->vehicles[i].present) {
            fputs(separator, out);
            vehicle_write(out, world, &world->vehicles[i]);
            separator = ",";
        }
    }
    fputs("]}\n", out);
}

void run_write_plan(FILE* out, const world* world, const verge_plan* plan)
{
    fputs("{\"t\":", out);
    number_write(out, world_time(world));
    fputs(",\"plan\":", out);
    plan_write(out, plan, world->scene->name, world->scene->def.point_s, PLAN_ONE_LINE);
    fputs("}\n", out);
}

void run_write_metrics(FILE* out, const metrics* metrics, bool timing)
{
    fputs("{\"metrics\":", out);
    metrics_write(out, metrics, timing, "");
    fputs("}\n", out);
}

static void vehicle_write(FILE* out, const world* world, const world_vehicle* vehicle)
{
    const verge_vehicle*     state = &vehicle->state;
    const verge_action_step* step = world_action(world, vehicle);
    const double values[] = { state->x, state->y, state->heading, state->speed,
                              state->acceleration };
    fprintf(out, "[%d", state->id);
    for (uint32_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        fputc(',', out);
        number_write(out, values[i]);
    }
    if (vehicle->lane == VERGE_NO_LANE) {
        fputs(",null", out);
    } else {
        fprintf(out, ",%d", vehicle->lane);
    }
    if (step == NULL) {
        fputs(",null,false,\"none\"]", out);
    } else {
        fprintf(out, ",\"%s\",%s,\"%s\"]", verge_action_name(step->action),
                step->brake_light ? "true" : "false", turn_signal_name(step->turn_signal));
    }
}
