/// verge-publish: simulates the vehicles of a scenario on a bus. It publishes their states ten
/// times a second in real time. It drives each controlled vehicle along the newest valid trajectory
/// of its on-vehicle unit that it receives, or along the newest plan. A vehicle with neither keeps
/// its lane (world.h).
#define _GNU_SOURCE
#include "latency.h"
#include "progress.h"
#include "units.h"

#include "common/bus_json.h"
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "common/run.h"
#include "common/state_message.h"

#include "verge/wire.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum {
    EXIT_UNAVAILABLE = 69, // no bus; EX_UNAVAILABLE of sysexits
    TICK_US = 1000000 / WORLD_TICKS_PER_SECOND,
    DRAIN_BATCH = 32,
};

typedef struct arguments {
    const char* path;
    const char* bus;
    const char* bus_options;
    const char* out;
    const char* duration_text;
    const char* seed_text;
    bool        quiet;
    bool        all;
    bool        send_only;
    bool        units;
    double      duration; // [s] NaN: the scenario's
    uint64_t    seed;
    bool        seeded;
} arguments;

/// The plan that a vehicle follows.
typedef struct follower {
    int32_t cycle;  // -1: none yet
    int64_t utime;  // [us] of the newest plan
    int64_t state_utime; // [us] of the state the newest plan was made from
} follower;

typedef struct publisher {
    const scenario* scene;
    world           world;
    metrics         metrics;
    transport*      bus;
    bool            receives;   // plans and trajectories
    FILE*           run;        // null: not recorded
    progress        progress;
    int64_t         start;      // [us] wall clock at the world's t = 0
    uint32_t        map_crc32; ///< of the road of the scenario
    int32_t         sequence;
    int64_t         sent_utime; // [us] of the states sent last
    int64_t         sent_at;    // [us] wall clock when they were
    latency         latency;
    uint64_t        refused;    // plans with an invalid field
    units           units;      // on-vehicle units
    follower        followers[VERGE_VEHICLES_MAX]; // in the world's order
    int32_t         gathered_cycle;
    run_origin      origin;     // of the plans gathered
    verge_plan      gathered;   // the plans received of one cycle
} publisher;

static bool trailers_refused(const scenario* scene);
static int  read_arguments(arguments* args, int argc, char** argv);
static int  run(publisher* self, const arguments* args);
static bool publish(publisher* self, double duration);

int main(int argc, char** argv)
{
    static publisher self; // large: a whole plan
    arguments args;
    const int status = read_arguments(&args, argc, argv);
    if (status != 0 || args.path == NULL) {
        return status;
    }
    scenario scene;
    if (!scenario_load(&scene, args.path, args.seeded ? &args.seed : NULL)) {
        fputs(scene.file.error, stderr);
        return 2;
    }
    self.scene = &scene;
    const int code = trailers_refused(&scene) ? 2 : run(&self, &args);
    scenario_free(&scene);
    return code;
}

/// A state message has one rectangle, so a roadside unit would plan other vehicles through a
/// trailer.
static bool trailers_refused(const scenario* scene)
{
    for (uint32_t i = 0; i < scene->vehicle_count; ++i) {
        if (scene->vehicles[i].start.body.trailer_length > 0.0) {
            fprintf(stderr, "%s:vehicles[%u].body: has a trailer, which messages cannot describe,"
                            " expected a vehicle without one\n", scene->file.name, i);
            return true;
        }
    }
    return false;
}

/// Exit status; 0 without a path: help or version was printed.
static int read_arguments(arguments* args, int argc, char** argv)
{
    memset(args, 0, sizeof *args);
    args->duration = NAN;
    const option_entry table[] = {
        { "--bus", "URL", "the bus, such as lcm:udpm://239.255.76.67:7667?ttl=0 or dds:0",
          &args->bus, NULL },
        { "--bus-options", "FILE.json", "options of the bus: {\"dds\", \"lcm\"}",
          &args->bus_options, NULL },
        { "--out", "RUN.jsonl", "writes the run (format verge-run/1) to this file", &args->out,
          NULL },
        { "--duration", "S", "ends after S seconds instead of at the end of the scenario",
          &args->duration_text, NULL },
        { "--seed", "N", "replaces the seed of the scenario", &args->seed_text, NULL },
        { "--all", NULL, "prints every plan, not only those that change something", NULL,
          &args->all },
        { "--units", NULL, "every controlled vehicle has an on-vehicle unit: plans alone are not "
          "driven", NULL, &args->units },
        { "--quiet", NULL, "prints neither plans nor modes of units", NULL, &args->quiet },
        { "--send-only", NULL, "receives nothing, as a bus unix:PATH requires", NULL,
          &args->send_only },
    };
    const program self = {
        .name = "verge-publish",
        .argument = "SCENARIO.json",
        .text = "Publishes the states of a scenario's vehicles in real time, drives the plans\n"
                "and the trajectories of on-vehicle units that it receives, and prints those that\n"
                "change something and the metrics.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = 2,
    };
    int status = 0;
    if (!options_parse(&self, argc, argv, &args->path, &status)) {
        args->path = NULL;
        return status;
    }
    if (args->bus == NULL) {
        fputs("verge-publish:--bus: missing, expected a bus URL\n", stderr);
        return 2;
    }
    if (args->duration_text != NULL) {
        char* end = NULL;
        args->duration = strtod(args->duration_text, &end);
        if (*end != '\0' || !(args->duration >= 0.1 && args->duration <= 86400.0)) {
            fputs("verge-publish:--duration: is not a duration, expected 0.1 to 86400 [s]\n",
                  stderr);
            return 2;
        }
    }
    return options_u64(&self, "--seed", args->seed_text, &args->seed, &args->seeded) ? 0 : 2;
}

static int64_t clock_us(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static bool print_metrics(publisher* self);

/// Prints a fault that the bus reports. The transport limits the rate.
static void print_line(void* context, const char* line)
{
    (void)context;
    fprintf(stderr, "verge-publish: %s\n", line);
}

/// 0, or an exit status after one line on standard error.
static int open_bus(publisher* self, const arguments* args)
{
    json_file file = { 0 };
    bus_options options = { 0 };
    if (args->bus_options != NULL && !bus_options_load(&options, args->bus_options, &file)) {
        fputs(file.error, stderr);
        bus_options_free(&options);
        return 2;
    }
    options.transport.log = print_line;
    char error[512];
    const unsigned signals = self->scene->signal_count > 0 ? TRANSPORT_SENDS_SIGNALS : 0u;
    const unsigned plans = self->receives ? TRANSPORT_PLANS | TRANSPORT_TRAJECTORIES : 0u;
    const int opened = transport_open_with(&self->bus, args->bus,
                                           plans | TRANSPORT_SENDS_STATES | signals,
                                           &options.transport, error, sizeof error);
    bus_options_free(&options);
    if (opened == TRANSPORT_OK) {
        return 0;
    }
    fprintf(stderr, "verge-publish:--bus: %s\n", error);
    return opened == TRANSPORT_UNAVAILABLE ? EXIT_UNAVAILABLE : 2;
}

static int run(publisher* self, const arguments* args)
{
    static output file; // static: 8 KiB of paths
    self->receives = !args->send_only;
    const int opened = open_bus(self, args);
    if (opened != 0) {
        return opened;
    }
    self->map_crc32 = wire_map_crc32(&self->scene->def.road);
    output_guard_signals();
    if (args->out != NULL && !output_open(&file, args->out)) {
        output_report(args->out);
        transport_close(self->bus);
        return 2;
    }
    self->run = file.stream;
    const double duration = isnan(args->duration) ? self->scene->duration : args->duration;
    progress_init(&self->progress, args->bus, args->quiet, args->all, clock_us(CLOCK_MONOTONIC));
    bool good = world_init(&self->world, self->scene) && metrics_init(&self->metrics, &self->world);
    if (good && args->units) {
        world_expect_units(&self->world);
    }
    good = good && publish(self, duration);
    if (good && args->out != NULL && !output_close(&file)) {
        output_report(args->out);
        good = false;
    }
    good = good && print_metrics(self);
    output_abandon(&file);
    metrics_free(&self->metrics);
    world_free(&self->world);
    transport_close(self->bus);
    return good ? 0 : 1;
}

// ---- in real time -------------------------------------------------------------------------

static void publish_states(publisher* self);
static void follow_plans(publisher* self, int64_t until);
static void gather_end(publisher* self);

/// True: plans are received, and a controlled vehicle is in the scene.
static bool plan_expected(const publisher* self)
{
    bool found = false;
    for (uint32_t i = 0; self->receives && i < self->world.vehicle_count; ++i) {
        found = found || (self->world.vehicles[i].present &&
                          self->world.vehicles[i].state.controlled);
    }
    return found;
}

static bool publish(publisher* self, double duration)
{
    const uint32_t end = (uint32_t)lround(duration * WORLD_TICKS_PER_SECOND);
    for (uint32_t i = 0; i < VERGE_VEHICLES_MAX; ++i) {
        self->followers[i] = (follower){ .cycle = -1, .utime = INT64_MIN };
    }
    self->gathered_cycle = -1;
    // Ticks use the monotonic clock; messages carry the wall clock.
    const int64_t begun = clock_us(CLOCK_MONOTONIC);
    self->start = clock_us(CLOCK_REALTIME);
    if (self->run != NULL) {
        run_write_bus_head(self->run, self->scene, self->start);
    }
    units_init(&self->units, &self->world, self->start, self->run, self->progress.quiet);
    for (;;) {
        publish_states(self);
        metrics_tick(&self->metrics, &self->world);
        if (self->run != NULL) {
            run_write_bus_tick(self->run, &self->world);
        }
        if (self->world.tick >= end) {
            break;
        }
        progress_silence(&self->progress, plan_expected(self), clock_us(CLOCK_MONOTONIC));
        follow_plans(self, begun + ((int64_t)self->world.tick + 1) * TICK_US);
        world_advance(&self->world);
        units_tick(&self->units, &self->world);
    }
    gather_end(self);
    if (self->run != NULL) {
        run_write_metrics(self->run, &self->metrics, false);
    }
    return true;
}

static void publish_states(publisher* self)
{
    const int64_t utime = self->start + world_utime(&self->world);
    ++self->sequence;
    self->sent_utime = utime;
    self->sent_at = clock_us(CLOCK_REALTIME);
    for (uint32_t i = 0; i < self->world.signal_count; ++i) {
        const verge_lane_signal_t signal =
            signal_message(&self->world.signals[i], utime, self->map_crc32);
        transport_publish_signal(self->bus, &signal);
    }
    for (uint32_t i = 0; i < self->world.vehicle_count; ++i) {
        const world_vehicle* vehicle = &self->world.vehicles[i];
        if (!vehicle->present) {
            continue;
        }
        const int32_t cycle =
            vehicle->unit ? units_cycle(&self->units, i) : self->followers[i].cycle;
        const verge_vehicle_state_t state =
            state_message(&vehicle->state, utime, self->sequence, cycle, self->map_crc32);
        transport_publish_state(self->bus, &state);
    }
}

static void on_plan(publisher* self, const verge_vehicle_plan_t* message, int64_t arrival);
static void on_trajectory(publisher* self, const verge_vehicle_trajectory_t* message,
                          int64_t arrival);

/// Receives plans and trajectories until the next tick is due. Also drains when none waits, as a
/// bus requires.
static void follow_plans(publisher* self, int64_t until)
{
    static transport_message batch[DRAIN_BATCH];
    for (;;) {
        const int64_t left = until - clock_us(CLOCK_MONOTONIC);
        if (left <= 0) {
            return;
        }
        struct pollfd bus = { .fd = transport_fd(self->bus), .events = POLLIN };
        const struct timespec wait = { .tv_nsec = (long)(left * 1000) };
        (void)ppoll(&bus, 1, &wait, NULL);
        const uint32_t count = transport_drain(self->bus, batch, DRAIN_BATCH);
        for (uint32_t i = 0; i < count; ++i) {
            if (batch[i].kind == TRANSPORT_PLAN) {
                on_plan(self, &batch[i].as.plan, batch[i].arrival_utime);
            } else if (batch[i].kind == TRANSPORT_TRAJECTORY) {
                on_trajectory(self, &batch[i].as.trajectory, batch[i].arrival_utime);
            }
        }
    }
}

static void on_trajectory(publisher* self, const verge_vehicle_trajectory_t* message,
                          int64_t arrival)
{
    const bool answers = message->state_utime == self->sent_utime;
    if (units_hear(&self->units, &self->world, message) == UNITS_DRIVEN && answers) {
        latency_add_trajectory(&self->latency, arrival, self->sent_at);
    }
}

// ---- plans --------------------------------------------------------------------------------

static verge_vehicle_plan plan_of(const verge_vehicle_plan_t* message);
static void gather(publisher* self, const verge_vehicle_plan_t* message,
                   const verge_vehicle_plan* plan);
static void follow(publisher* self, uint32_t index, const verge_vehicle_plan_t* message,
                   const verge_vehicle_plan* plan, int64_t arrival);

static void on_plan(publisher* self, const verge_vehicle_plan_t* message, int64_t arrival)
{
    const char* fault = wire_plan_check(message);
    if (fault != NULL) {
        ++self->refused;
        fprintf(stderr, "verge-publish: a plan was refused, its field %s is invalid\n", fault);
        return;
    }
    for (uint32_t i = 0; i < self->world.vehicle_count; ++i) {
        const world_vehicle* vehicle = &self->world.vehicles[i];
        if (vehicle->state.id == message->vehicle_id && vehicle->state.controlled) {
            const verge_vehicle_plan plan = plan_of(message);
            gather(self, message, &plan); // also a plan that the vehicle does not follow
            follow(self, i, message, &plan, arrival);
        }
    }
}

/// A vehicle follows a plan that is not older than the one it has.
static void follow(publisher* self, uint32_t index, const verge_vehicle_plan_t* message,
                   const verge_vehicle_plan* plan, int64_t arrival)
{
    follower* follower = &self->followers[index];
    if (!self->world.vehicles[index].present || message->utime < follower->utime) {
        return;
    }
    const bool answers = message->state_utime == self->sent_utime &&
                         message->state_utime != follower->state_utime;
    if (message->status != VERGE_CANCELLED && message->reason != VERGE_REASON_OVERRUN) {
        latency_add(&self->latency, message, arrival, answers ? self->sent_at : 0);
    }
    follower->state_utime = message->state_utime;
    follower->utime = message->utime;
    follower->cycle = message->status == VERGE_CANCELLED ? -1 : message->cycle;
    world_follow(&self->world, plan, (double)(message->utime - self->start) * 1e-6);
    progress_plan(&self->progress, index, world_time(&self->world), message, plan,
              clock_us(CLOCK_MONOTONIC));
}

/// The message as a plan of the planner. Quantities that the message lacks are NaN.
static verge_vehicle_plan plan_of(const verge_vehicle_plan_t* message)
{
    verge_vehicle_plan plan;
    memset(&plan, 0, sizeof plan);
    plan.vehicle_id = message->vehicle_id;
    plan.status = (verge_plan_status)message->status;
    plan.reason = (verge_reason)message->reason;
    verge_vehicle_decision decision;
    if (wire_decision_from_plan(message, &decision)) {
        plan.action_count = decision.step_count;
        memcpy(plan.actions, decision.steps, decision.step_count * sizeof decision.steps[0]);
        plan.why = decision.why;
        plan.pass_count = decision.pass_count;
        memcpy(plan.passes, decision.passes, sizeof plan.passes);
    }
    plan.point_count = wire_points_from_plan(message, plan.points);
    plan.cost = (verge_cost){ NAN, NAN, NAN, NAN, NAN, NAN, NAN };
    return plan;
}

/// Collects the plans of one cycle for the run file and the metrics.
static void gather(publisher* self, const verge_vehicle_plan_t* message,
                   const verge_vehicle_plan* plan)
{
    if (message->cycle != self->gathered_cycle) {
        gather_end(self);
        self->gathered_cycle = message->cycle;
        self->gathered.utime = message->utime;
        self->gathered.digest = (uint64_t)message->digest;
        self->origin.cycle = message->reason == VERGE_REASON_OVERRUN ? -1 : message->cycle;
        self->origin.valid_until_utime = message->valid_until_utime;
    }
    if (plan->status == VERGE_CANCELLED || self->gathered.vehicle_count >= VERGE_CONTROLLED_MAX) {
        return;
    }
    self->gathered.fallback_count += plan->status != VERGE_PLANNED ? 1 : 0;
    self->origin.state_utime[self->gathered.vehicle_count] = message->state_utime;
    self->gathered.vehicles[self->gathered.vehicle_count++] = *plan;
    if (self->gathered.vehicle_count == (uint32_t)message->plans_in_cycle) {
        gather_end(self);
    }
}

static void gather_end(publisher* self)
{
    if (self->gathered.vehicle_count > 0) {
        metrics_cycle(&self->metrics, &self->gathered, NULL, -1.0);
        if (self->run != NULL) {
            run_write_bus_plan(self->run, &self->world, &self->gathered, &self->origin);
        }
    }
    memset(&self->gathered, 0, sizeof self->gathered);
    self->gathered_cycle = -1;
}

static bool print_metrics(publisher* self)
{
    fputs("{\"scenario\":", stdout);
    string_write(stdout, self->scene->name);
    fputs(",\"seed\":", stdout);
    number_write_u64(stdout, self->scene->def.seed);
    fputs(",\n\"metrics\":", stdout);
    metrics_write(stdout, &self->metrics, false, "\n");
    fputs(",\n\"latency\":", stdout);
    latency_write(stdout, &self->latency);
    fputs(",\n\"trajectories\":", stdout);
    units_write(stdout, &self->units);
    fputs("}\n", stdout);
    return output_flush("verge-publish");
}
