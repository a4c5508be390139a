/// See run.h.
#include "run.h"

#include "number.h"
#include "plan_json.h"

#include <inttypes.h>

static void head_write(FILE* out, const scenario* scene);
static void tick_write(FILE* out, const world* world);
static void planned_write(FILE* out, const world* world, const verge_plan* plan);
static void vehicle_write(FILE* out, const world* world, const world_vehicle* vehicle);

void run_write_head(FILE* out, const scenario* scene)
{
    head_write(out, scene);
    fputs("}\n", out);
}

void run_write_bus_head(FILE* out, const scenario* scene, int64_t start_utime)
{
    head_write(out, scene);
    fprintf(out, ",\"start_utime\":%" PRId64 "}\n", start_utime);
}

void run_write_tick(FILE* out, const world* world)
{
    tick_write(out, world);
    fputs("}\n", out);
}

void run_write_bus_tick(FILE* out, const world* world)
{
    const char* separator = "";
    tick_write(out, world);
    fputs(",\"yaw_rates\":[", out);
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        if (world->vehicles[i].present) {
            fputs(separator, out);
            number_write(out, world->vehicles[i].state.yaw_rate);
            separator = ",";
        }
    }
    fputs("]}\n", out);
}

void run_write_plan(FILE* out, const world* world, const verge_plan* plan)
{
    planned_write(out, world, plan);
    fputs("}\n", out);
}

void run_write_bus_plan(FILE* out, const world* world, const verge_plan* plan,
                        const run_origin* origin)
{
    planned_write(out, world, plan);
    if (origin->cycle >= 0) {
        fprintf(out, ",\"cycle\":%d,\"valid_until_utime\":%" PRId64 ",\"state_utimes\":[",
                origin->cycle, origin->valid_until_utime);
        for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
            fprintf(out, "%s%" PRId64, i == 0 ? "" : ",", origin->state_utime[i]);
        }
        fputc(']', out);
    }
    fputs("}\n", out);
}

static void write_known(FILE* out, const char* name, int32_t value)
{
    if (value < 0) {
        fprintf(out, ",\"%s\":null", name);
    } else {
        fprintf(out, ",\"%s\":%d", name, value);
    }
}

void run_write_unit(FILE* out, double t, const run_unit* unit)
{
    fputs("{\"t\":", out);
    number_write(out, t);
    fprintf(out, ",\"unit\":{\"id\":%d,\"mode\":\"%s\",\"reason\":\"%s\"", unit->vehicle_id,
            unit->mode, unit->reason);
    write_known(out, "vehicle", unit->about);
    write_known(out, "cycle", unit->cycle);
    fputs("}}\n", out);
}

void run_write_metrics(FILE* out, const metrics* metrics, bool timing)
{
    fputs("{\"metrics\":", out);
    metrics_write(out, metrics, timing, "");
    fputs("}\n", out);
}

static void head_write(FILE* out, const scenario* scene)
{
    fputs("{\"format\":\"verge-run/1\",\"scenario\":", out);
    scenario_write(out, scene);
    fputs(",\"dt\":", out);
    number_write(out, WORLD_DT);
}

static void tick_write(FILE* out, const world* world)
{
    const char* separator = "";
    fputs("{\"t\":", out);
    number_write(out, world_time(world));
    fputs(",\"vehicles\":[", out);
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        if (world->vehicles[i].present) {
            fputs(separator, out);
            vehicle_write(out, world, &world->vehicles[i]);
            separator = ",";
        }
    }
    fputc(']', out);
}

static void planned_write(FILE* out, const world* world, const verge_plan* plan)
{
    fputs("{\"t\":", out);
    number_write(out, world_time(world));
    fputs(",\"plan\":", out);
    plan_write(out, plan, world->scene->name, world->scene->def.point_s, PLAN_ONE_LINE);
}

static void vehicle_write(FILE* out, const world* world, const world_vehicle* vehicle)
{
    const verge_vehicle*     state = &vehicle->state;
    const verge_action_step* step = world_action(world, vehicle);
    const double values[] = { state->x, state->y, state->heading, state->speed,
                              state->acceleration };
    fprintf(out, "[%d", state->id);
    for (uint32_t i = 0; i < sizeof values / sizeof values[0]; ++i) {
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
