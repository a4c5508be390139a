/// verge-echo: prints the messages of a bus, one line each, until Ctrl-C or --count messages.
#define _GNU_SOURCE
#include "common/bus_json.h"
#include "common/message_json.h"
#include "common/options.h"

#include "verge/verge.h"
#include "verge/wire.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/signalfd.h>
#include <unistd.h>

enum {
    EXIT_USAGE = 64,
    EXIT_UNAVAILABLE = 69,
    EXIT_OS = 71,
    BATCH = 32,
    POLL_MS = 1000, // draining opens a lost bus again
};

typedef struct arguments {
    const char* url;
    const char* options_path;
    uint64_t    count; // 0: no end
    bool        json;
    bool        wanted[TRANSPORT_MARK]; // by transport_kind
} arguments;

typedef struct echo {
    const arguments* args;
    transport*       bus;
    int              signal_fd;
    uint64_t         heard[TRANSPORT_MARK]; // by transport_kind
    transport_message batch[BATCH];
} echo;

static bool read_arguments(arguments* args, int argc, char** argv, int* status);
static int  open_bus(echo* self, bus_options* options);
static bool listen_to(echo* self);
static void sum_up(const echo* self);

int main(int argc, char** argv)
{
    static echo        self; // large
    static bus_options options;
    arguments          args = { 0 };
    int                status = 0;
    if (!read_arguments(&args, argc, argv, &status)) {
        return status;
    }
    self.args = &args;
    status = open_bus(&self, &options);
    if (status == 0) {
        const bool printed = listen_to(&self);
        sum_up(&self);
        status = printed ? 0 : 1;
    }
    transport_close(self.bus);
    bus_options_free(&options);
    return status;
}

static bool read_arguments(arguments* args, int argc, char** argv, int* status)
{
    const char* count_text = NULL;
    const option_entry table[] = {
        { "--bus-options", "FILE.json", "options of the bus: {\"dds\", \"lcm\"} of a configuration",
          &args->options_path, NULL },
        { "--count", "N", "ends after N messages", &count_text, NULL },
        { "--json", NULL, "one JSON document per message, with every field", NULL, &args->json },
        { "--states", NULL, "vehicle states; default: all kinds", NULL,
          &args->wanted[TRANSPORT_STATE] },
        { "--plans", NULL, "plans", NULL, &args->wanted[TRANSPORT_PLAN] },
        { "--status", NULL, "status messages", NULL, &args->wanted[TRANSPORT_STATUS] },
        { "--signals", NULL, "traffic signals", NULL, &args->wanted[TRANSPORT_SIGNAL] },
        { "--trajectories", NULL, "trajectories of on-vehicle units", NULL,
          &args->wanted[TRANSPORT_TRAJECTORY] },
    };
    const program self = {
        .name = "verge-echo",
        .argument = "URL",
        .text = "Prints the messages of a bus: vehicle states, plans, statuses, signals and\n"
                "trajectories.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = EXIT_USAGE,
    };
    if (!options_parse(&self, argc, argv, &args->url, status)) {
        return false;
    }
    bool given = false;
    *status = EXIT_USAGE;
    if (!options_u64(&self, "--count", count_text, &args->count, &given)) {
        return false;
    }
    if (given && args->count == 0) {
        fputs("verge-echo:--count: is 0, expected a number of messages\n", stderr);
        return false;
    }
    bool any = false;
    for (int kind = TRANSPORT_STATE; kind < TRANSPORT_MARK; ++kind) {
        any = any || args->wanted[kind];
    }
    for (int kind = TRANSPORT_STATE; kind < TRANSPORT_MARK; ++kind) {
        args->wanted[kind] = args->wanted[kind] || !any;
    }
    *status = 0;
    return true;
}

/// Prints a line of the bus, such as a refused sender and the reason.
static void complain(void* context, const char* line)
{
    (void)context;
    fprintf(stderr, "verge-echo: %s\n", line);
}

static int open_bus(echo* self, bus_options* options)
{
    const arguments* args = self->args;
    // Signals first: the bus may start threads, which inherit what is blocked.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    sigprocmask(SIG_BLOCK, &signals, NULL);
    self->signal_fd = signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC);
    if (self->signal_fd < 0) {
        fprintf(stderr, "verge-echo: the system refused a descriptor (%s)\n", strerror(errno));
        return EXIT_OS;
    }
    json_file file;
    if (args->options_path != NULL && !bus_options_load(options, args->options_path, &file)) {
        fputs(file.error, stderr);
        return EXIT_USAGE;
    }
    options->transport.log = complain;
    char error[512];
    unsigned kinds = 0;
    for (int kind = TRANSPORT_STATE; kind < TRANSPORT_MARK; ++kind) {
        kinds |= args->wanted[kind] ? 1u << kind : 0u; // TRANSPORT_STATES and its like
    }
    const int result = transport_open_with(&self->bus, args->url, kinds, &options->transport,
                                           error, sizeof error);
    if (result != TRANSPORT_OK) {
        fprintf(stderr, "verge-echo: %s\n", error);
        return result == TRANSPORT_UNAVAILABLE ? EXIT_UNAVAILABLE : EXIT_USAGE;
    }
    return 0;
}

// ---- listening ----------------------------------------------------------------------------

static void print_message(echo* self, const transport_message* message);

static uint64_t heard(const echo* self)
{
    uint64_t sum = 0;
    for (int kind = TRANSPORT_STATE; kind < TRANSPORT_MARK; ++kind) {
        sum += self->heard[kind];
    }
    return sum;
}

/// Runs until a signal, the count or the end of a log. False: the output cannot be written.
static bool listen_to(echo* self)
{
    const uint64_t limit = self->args->count;
    for (;;) {
        struct pollfd ends[] = { { .fd = self->signal_fd, .events = POLLIN },
                                 { .fd = transport_fd(self->bus), .events = POLLIN } };
        const bool log = ends[1].fd < 0;
        poll(ends, 2, log ? 0 : POLL_MS);
        if (ends[0].revents != 0 || transport_ended(self->bus)) {
            return true;
        }
        const uint32_t count = transport_drain(self->bus, self->batch, BATCH);
        for (uint32_t i = 0; i < count; ++i) {
            print_message(self, &self->batch[i]);
            if (limit > 0 && heard(self) >= limit) {
                return fflush(stdout) == 0;
            }
        }
        if (count > 0 && (fflush(stdout) != 0 || ferror(stdout))) {
            fprintf(stderr, "verge-echo:standard output: %s\n", strerror(errno));
            return false;
        }
    }
}

static void print_json(const transport_message* message);
static void print_state(const verge_vehicle_state_t* state);
static void print_plan(const verge_vehicle_plan_t* plan);
static void print_status(const verge_rsu_status_t* status);
static void print_signal(const verge_lane_signal_t* signal);
static void print_trajectory(const verge_vehicle_trajectory_t* trajectory);

static void print_message(echo* self, const transport_message* message)
{
    if (message->kind == TRANSPORT_NONE || message->kind >= TRANSPORT_MARK) {
        return;
    }
    ++self->heard[message->kind];
    if (self->args->json) {
        print_json(message);
        return;
    }
    switch (message->kind) {
    case TRANSPORT_STATE: print_state(&message->as.state); break;
    case TRANSPORT_PLAN: print_plan(&message->as.plan); break;
    case TRANSPORT_STATUS: print_status(&message->as.status); break;
    case TRANSPORT_SIGNAL: print_signal(&message->as.signal); break;
    case TRANSPORT_TRAJECTORY: print_trajectory(&message->as.trajectory); break;
    case TRANSPORT_MARK:
    case TRANSPORT_NONE: break;
    }
}

static void print_json(const transport_message* message)
{
    static char buffer[2 * MESSAGE_JSON_MAX];
    text out = text_in(buffer, sizeof buffer);
    static const char* const kinds[] = {
        [TRANSPORT_STATE] = "state",   [TRANSPORT_PLAN] = "plan",
        [TRANSPORT_STATUS] = "status", [TRANSPORT_SIGNAL] = "signal",
        [TRANSPORT_TRAJECTORY] = "trajectory",
    };
    text_add(&out, "{\"kind\":\"%s\",\"arrival_utime\":%" PRId64 ",\"sender\":\"%016" PRIx64
             "\",\"message\":", kinds[message->kind], message->arrival_utime, message->sender);
    message_json(&out, message->kind, &message->as);
    text_add(&out, "}\n");
    fputs(out.bytes, stdout);
}

static void print_state(const verge_vehicle_state_t* state)
{
    printf("state  vehicle %-4d %-10s x %9.2f  y %9.2f  heading %6.3f  %5.2f m/s  "
           "%5.2f m/s^2  target lane %d  follows cycle %d\n",
           state->vehicle_id, state->controlled != 0 ? "controlled" : "seen", state->x, state->y,
           (double)state->heading, (double)state->speed, (double)state->acceleration,
           state->target_lane, state->followed_cycle);
}

static void print_plan(const verge_vehicle_plan_t* plan)
{
    printf("plan   vehicle %-4d %-10s cycle %d (%d plans)  %d points", plan->vehicle_id,
           message_plan_status(plan->status), plan->cycle, plan->plans_in_cycle,
           plan->point_count);
    if (wire_plan_check(plan) == NULL) {
        for (int32_t i = 0; i < plan->action_count; ++i) {
            const verge_plan_action_t* action = &plan->actions[i];
            printf("%s %s to %.1f s", i == 0 ? " " : ",",
                   verge_action_name((verge_action)action->action), action->t1_ms * 1e-3);
        }
    }
    if (plan->reason != VERGE_REASON_NONE) {
        printf("  (%s)", verge_reason_text((verge_reason)plan->reason));
    }
    if (plan->why != VERGE_WHY_NONE) {
        const verge_cause why = { (verge_why)plan->why, plan->why_vehicle, plan->why_lane, 0 };
        char words[128];
        verge_cause_say(&why, words, sizeof words);
        printf("  (%s)", words);
    }
    printf("\n");
}

static void print_status(const verge_rsu_status_t* status)
{
    printf("status rsu %-4d %-9s fault %s  %d vehicles, %d planned  cycle %d: p99 %.1f ms, "
           "%d misses  %d plans, %d fallbacks\n",
           status->rsu_id, message_rsu_state(status->state), message_rsu_fault(status->fault),
           status->vehicles_seen, status->vehicles_controlled, status->cycle,
           status->cycle_us_p99 * 1e-3, status->deadline_misses, status->plans_sent,
           status->fallbacks);
}

static void print_signal(const verge_lane_signal_t* signal)
{
    printf("signal lane %-7d %s", signal->lane,
           verge_signal_state_name((verge_signal_state)signal->state));
    if (signal->change_utime != 0) {
        printf(", changes in %.1f s", (double)(signal->change_utime - signal->utime) * 1e-6);
    }
    printf("\n");
}

static void print_trajectory(const verge_vehicle_trajectory_t* trajectory)
{
    printf("trajectory  vehicle %-4d %-9s", trajectory->vehicle_id,
           wire_unit_mode_name(trajectory->mode));
    if (trajectory->followed_cycle >= 0) {
        printf(" rsu %d cycle %d", trajectory->rsu_id, trajectory->followed_cycle);
    }
    printf("  %s  %d points", message_plan_status(trajectory->status), trajectory->point_count);
    if (trajectory->mode_reason != WIRE_UNIT_NONE) {
        printf("  (%s", wire_unit_reason_name(trajectory->mode_reason));
        if (trajectory->mode_vehicle >= 0) {
            printf(", vehicle %d", trajectory->mode_vehicle);
        }
        printf(")");
    }
    printf("\n");
}

static void sum_up(const echo* self)
{
    const transport_stats stats = transport_statistics(self->bus);
    fprintf(stderr, "verge-echo: %" PRIu64 " states, %" PRIu64 " plans, %" PRIu64 " status; %"
            PRIu64 " malformed, %" PRIu64 " dropped, %" PRIu64 " of other channels; %" PRIu64
            " signals, %" PRIu64 " trajectories\n",
            self->heard[TRANSPORT_STATE], self->heard[TRANSPORT_PLAN],
            self->heard[TRANSPORT_STATUS], stats.malformed, stats.dropped, stats.foreign,
            self->heard[TRANSPORT_SIGNAL], self->heard[TRANSPORT_TRAJECTORY]);
}
