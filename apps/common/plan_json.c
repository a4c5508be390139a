/// See plan_json.h.
#include "plan_json.h"

#include "number.h"

#include <math.h>

enum { SAY_SIZE = 200 };

static void search_write(FILE* out, const verge_search_report* search);
static void vehicle_write(FILE* out, const verge_vehicle_plan* vehicle, double dt,
                          const char* line);
static void hypotheses_write(FILE* out, const verge_prediction* prediction);
static void status_write(FILE* out, const verge_vehicle_plan* vehicle);
static void order_write(FILE* out, const verge_vehicle_plan* vehicle);
static void changed_write(FILE* out, uint32_t changed);
static void action_write(FILE* out, const verge_action_step* step, const char* say);
static void cost_write(FILE* out, const verge_cost* cost);
static void row_write(FILE* out, const double* values, uint32_t count);

void plan_write(FILE* out, const verge_plan* plan, const char* scenario, double dt,
                plan_layout layout)
{
    const char* line = layout == PLAN_READABLE ? "\n" : "";
    fputs("{\"format\":\"verge-plan/1\",\"scenario\":", out);
    string_write(out, scenario);
    fprintf(out, ",\"utime\":%lld,\"digest\":", (long long)plan->utime);
    digest_write(out, plan->digest);
    fprintf(out, ",%s\"search\":", line);
    search_write(out, &plan->search);
    fprintf(out, ",%s\"vehicles\":[", line);
    for (uint32_t i = 0; i < plan->vehicle_count; ++i) {
        fprintf(out, "%s%s", i == 0 ? "" : ",", line);
        vehicle_write(out, &plan->vehicles[i], dt, line);
    }
    fprintf(out, "],%s\"predictions\":[", line);
    for (uint32_t i = 0; i < plan->prediction_count; ++i) {
        const verge_prediction* prediction = &plan->predictions[i];
        fprintf(out, "%s%s{\"id\":%d,\"points\":[", i == 0 ? "" : ",", line,
                prediction->vehicle_id);
        for (uint32_t k = 0; k < prediction->point_count; ++k) {
            const verge_pose* pose = &prediction->points[k];
            const double      row[] = { pose->t, pose->x, pose->y, pose->heading };
            fprintf(out, "%s%s", k == 0 ? "" : ",", line);
            row_write(out, row, 4);
        }
        fputs("],\"hypotheses\":", out);
        hypotheses_write(out, prediction);
        fputc('}', out);
    }
    fprintf(out, "]}%s", line);
}

/// Null where nothing is known.
static void hypotheses_write(FILE* out, const verge_prediction* prediction)
{
    float sum = 0.0f;
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        sum += prediction->hypotheses[k];
    }
    if (sum <= 0.0f) {
        fputs("null", out);
        return;
    }
    for (uint32_t k = 0; k < VERGE_HYPOTHESIS_COUNT; ++k) {
        fprintf(out, "%s\"%s\":", k == 0 ? "{" : ",", verge_hypothesis_name((verge_hypothesis)k));
        number_write(out, (double)prediction->hypotheses[k]);
    }
    fputc('}', out);
}

const char* turn_signal_name(int32_t turn_signal)
{
    return turn_signal < 0 ? "right" : turn_signal > 0 ? "left" : "none";
}

static void search_write(FILE* out, const verge_search_report* search)
{
    fprintf(out, "{\"iterations\":%u,\"nodes\":%u,\"nodes_first\":%u,\"depth\":%u,\"pruned\":%u,"
            "\"unexpanded\":%u,\"reward\":", search->iterations, search->nodes, search->nodes_first,
            search->depth, search->pruned, search->unexpanded);
    number_write(out, search->reward);
    fprintf(out, ",\"bound\":");
    number_write(out, search->bound);
    // Within this share of the bound; null where there is nothing to decide.
    fprintf(out, ",\"gap\":");
    number_write(out, search->bound > 0.0 ? 1.0 - search->reward / search->bound : (double)NAN);
    fprintf(out, ",\"conflicts\":%u,\"complete\":%s}", search->conflicts, search->complete ? "true" : "false");
}

static void vehicle_write(FILE* out, const verge_vehicle_plan* vehicle, double dt, const char* line)
{
    fprintf(out, "{\"id\":%d,", vehicle->vehicle_id);
    status_write(out, vehicle);
    fprintf(out, ",%s", line);
    order_write(out, vehicle);
    fprintf(out, ",%s\"actions\":[", line);
    for (uint32_t i = 0; i < vehicle->action_count; ++i) {
        char say[SAY_SIZE];
        if (i == 0) {
            verge_plan_say(vehicle, say, sizeof say);
        } else {
            verge_action_say(&vehicle->actions[i], say, sizeof say);
        }
        fprintf(out, "%s%s", i == 0 ? "" : ",", line);
        action_write(out, &vehicle->actions[i], say);
    }
    fprintf(out, "],%s\"trajectory\":{\"dt\":", line);
    number_write(out, dt);
    fputs(",\"columns\":[\"t\",\"x\",\"y\",\"heading\",\"speed\",\"acceleration\",\"curvature\","
          "\"jerk\"],\"points\":[", out);
    for (uint32_t i = 0; i < vehicle->point_count; ++i) {
        const verge_point* p = &vehicle->points[i];
        const double row[] = { p->t, p->x, p->y, p->heading, p->speed, p->acceleration,
                               p->curvature, p->jerk };
        fprintf(out, "%s%s", i == 0 ? "" : ",", line);
        row_write(out, row, 8);
    }
    fprintf(out, "]},%s\"cost\":", line);
    cost_write(out, &vehicle->cost);
    fputc('}', out);
}

static void status_write(FILE* out, const verge_vehicle_plan* vehicle)
{
    if (vehicle->status == VERGE_PLANNED) {
        fputs("\"status\":\"planned\"", out);
        return;
    }
    fprintf(out, "\"status\":\"fallback\",\"fallback\":\"%s\",\"reason\":",
            vehicle->status == VERGE_FALLBACK_BRAKE ? "brake" : "keep_lane");
    string_write(out, verge_reason_text(vehicle->reason));
}

static void id_write(FILE* out, const char* key, int32_t id)
{
    fprintf(out, id < 0 ? ",\"%s\":null" : ",\"%s\":%d", key, id);
}

/// Why it waits, after whom it passes, and what is new.
static void order_write(FILE* out, const verge_vehicle_plan* vehicle)
{
    char say[SAY_SIZE];
    if (vehicle->why.code == VERGE_WHY_NONE) {
        fputs("\"why\":null", out);
    } else {
        verge_cause_say(&vehicle->why, say, sizeof say);
        fprintf(out, "\"why\":{\"code\":\"%s\",\"text\":", verge_why_name(vehicle->why.code));
        string_write(out, say);
        id_write(out, "vehicle", vehicle->why.vehicle_id);
        id_write(out, "area", vehicle->why.lane_id);
        fputc('}', out);
    }
    fputs(",\"passes\":[", out);
    for (uint32_t i = 0; i < vehicle->pass_count; ++i) {
        const verge_pass* pass = &vehicle->passes[i];
        fprintf(out, "%s{\"area\":[%d,%d],\"after\":%d}", i == 0 ? "" : ",", pass->lane_id,
                pass->other_lane_id, pass->after_id);
    }
    fputs("],\"changed\":[", out);
    changed_write(out, vehicle->changed);
    fputc(']', out);
}

static void changed_write(FILE* out, uint32_t changed)
{
    static const char* const names[] = { "first", "status", "action", "why", "order" };
    const char* comma = "";
    for (uint32_t i = 0; i < sizeof names / sizeof names[0]; ++i) {
        if ((changed >> i & 1u) != 0) {
            fprintf(out, "%s\"%s\"", comma, names[i]);
            comma = ",";
        }
    }
}

static void action_write(FILE* out, const verge_action_step* step, const char* say)
{
    const struct { const char* name; double value; } fields[] = {
        { "s", step->s }, { "d", step->d }, { "v", step->v },
    };
    fputs("{\"t0\":", out);
    number_write(out, step->t0);
    fputs(",\"t1\":", out);
    number_write(out, step->t1);
    fprintf(out, ",\"action\":\"%s\",\"lane\":%d", verge_action_name(step->action), step->lane_id);
    for (uint32_t i = 0; i < 3; ++i) {
        fprintf(out, ",\"%s\":", fields[i].name);
        number_write(out, fields[i].value);
    }
    fprintf(out, ",\"brake_light\":%s,\"turn_signal\":\"%s\",\"say\":",
            step->brake_light ? "true" : "false", turn_signal_name(step->turn_signal));
    string_write(out, say);
    fputc('}', out);
}

static void cost_write(FILE* out, const verge_cost* cost)
{
    const struct { const char* name; double value; } terms[] = {
        { "total", cost->total },   { "curvature", cost->curvature },
        { "heading", cost->heading }, { "offset", cost->offset },
        { "acceleration", cost->acceleration }, { "jerk", cost->jerk },
        { "obstacle", cost->obstacle },
    };
    for (uint32_t i = 0; i < sizeof terms / sizeof terms[0]; ++i) {
        fprintf(out, "%s\"%s\":", i == 0 ? "{" : ",", terms[i].name);
        number_write(out, terms[i].value);
    }
    fputc('}', out);
}

static void row_write(FILE* out, const double* values, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        fputc(i == 0 ? '[' : ',', out);
        number_write(out, values[i]);
    }
    fputc(']', out);
}
