/// A cycle begins at a tick of the timer: the waiting messages are received, the unit makes its
/// trajectory, and it is sent. See live.h.
#define _GNU_SOURCE
#include "live.h"

#include "report.h"

#include "common/floating.h"
#include "common/thread.h"
#include "daemon/events.h"
#include "daemon/notify.h"
#include "daemon/operators.h"
#include "daemon/realtime.h"
#include "daemon/reload.h"
#include "daemon/start.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

enum {
    DRAIN_BATCH = 64,
    DRAIN_ROUNDS_MAX = 16, // before a cycle: empties the sockets' buffers, but ends in a flood
    OWN_ENDS = 5,          // descriptors of the loop: signals, reload, timers, own states
    SECOND_MS = 1000,
    LOG_PATIENCE_US = 200000,
    FAIL_PATIENCE_US = 5000000, // for the reason of a start that has failed
};

static const char NAME[] = "verge-obu";

typedef struct live {
    const start_options* options;
    setup      now;            // the configuration in effect, with its unit
    reloader   reloader;
    transport* state_bus;      // of the vehicle itself; null: the buses of the setup
    transport* trajectory_bus; // null: the buses of the setup
    int        signal_fd, cycle_fd, second_fd;
    notify     notify;
    operators  operators;
    timing     cycle_time;
    int64_t    start_utime;
    int64_t    cycles;
    uint64_t   deadline_misses;
    wire_unit_mode mode;       // as logged last
    wire_unit_reason reason;
    bool       spoke;          // has made a trajectory
    uint64_t   refusals;       // of states, already in the log
    unit_counters counted;     // already in the log
    transport_message inbound[DRAIN_BATCH];
} live;

static int  start(live* self);
static void loop(live* self);
static int  stop(live* self);
static void release(live* self);

int obu_run(const start_options* options)
{
    static live self; // large; there is one daemon in a process
    memset(&self, 0, sizeof self);
    self.options = options;
    self.signal_fd = self.cycle_fd = self.second_fd = self.notify.fd = -1;
    const int code = start(&self);
    if (code != 0) {
        log_stop(FAIL_PATIENCE_US);
        release(&self);
        return code;
    }
    loop(&self);
    return stop(&self);
}

static unit* unit_of(const live* self)
{
    return self->now.made;
}

static const obu_config* config_now(const live* self)
{
    return obu_config_of(self->now.site);
}

// ---- start --------------------------------------------------------------------------------

int obu_make(void** made, const site* site, char error[CONFIG_ERROR_SIZE])
{
    const unit_def def = obu_unit_def(obu_config_of(site));
    *made = unit_open(&def, error, CONFIG_ERROR_SIZE);
    return *made != NULL ? 0 : EXIT_CONFIG;
}

void obu_unmake(void* made)
{
    unit_close(made);
}

static int fail(int code, const char* line)
{
    return start_fail(NAME, code, line);
}

static setup_def make_def(const live* self)
{
    return (setup_def){ .path = self->options->config_path, .site = &OBU_CONFIG_DEF,
                        .bus_use = OBU_BUS_USE, .log = start_complaint, .make = obu_make,
                        .unmake = obu_unmake };
}

static int load(live* self)
{
    const setup_def def = make_def(self);
    int code = start_load(&self->now, &def, self->options, NAME);
    if (code != 0) {
        return code;
    }
    if (self->options->floating_corrected) {
        log_event(LOG_WARNING, "floating_corrected", "when=start");
    }
    char error[CONFIG_ERROR_SIZE];
    code = setup_plan(&self->now, &def, error);
    return code == 0 ? 0 : fail(code, error);
}

/// Opens a bus of the vehicle's own; "" opens none.
static int open_own(transport** bus, const live* self, const char* url, unsigned use)
{
    char error[CONFIG_ERROR_SIZE];
    transport_options options = self->now.site->bus_options.transport;
    options.log = start_complaint;
    if (url[0] == '\0') {
        return 0;
    }
    const int result = transport_open_with(bus, url, use, &options, error, sizeof error);
    return result == TRANSPORT_OK        ? 0
           : result == TRANSPORT_BAD_URL ? fail(EXIT_CONFIG, error)
                                         : fail(EXIT_UNAVAILABLE, error);
}

static int open_buses(live* self)
{
    char error[CONFIG_ERROR_SIZE];
    const setup_def def = make_def(self);
    int code = setup_connect(&self->now, &def, error);
    if (code != 0) {
        return fail(code, error);
    }
    code = open_own(&self->state_bus, self, config_now(self)->state, TRANSPORT_STATES);
    return code != 0 ? code
                     : open_own(&self->trajectory_bus, self, config_now(self)->trajectory,
                                TRANSPORT_SENDS_TRAJECTORIES);
}

static int open_descriptors(live* self)
{
    self->signal_fd = signals_open();
    self->cycle_fd = timer_open();
    self->second_fd = timer_open();
    const reloader_def def = { .setup = make_def(self), .now = &self->now };
    if (self->signal_fd < 0 || self->cycle_fd < 0 || self->second_fd < 0
        || !reloader_open(&self->reloader, &def)) {
        return fail(EXIT_OS, "the system refused a descriptor or a thread, expected a higher "
                             "LimitNOFILE, LimitNPROC or TasksMax");
    }
    return 0;
}

static void answer_status(void* context, text* answer);
static void answer_vehicles(void* context, text* answer);
static void answer_plans(void* context, text* answer);
static void answer_metrics(void* context, text* page);
static reload_result reload(void* context, uint64_t* ticket, const char** reason);

static const operators_request REQUESTS[] = {
    { "status", answer_status },
    { "vehicles", answer_vehicles },
    { "plans", answer_plans },
    { NULL, NULL },
};

/// Opens what serves operators. Then everything is allocated, memory is locked, and this thread
/// gets its priority.
static int open_operators(live* self)
{
    char error[CONFIG_ERROR_SIZE];
    const service*      service = &self->now.site->service;
    const operators_def def = { .context = self, .requests = REQUESTS, .metrics = answer_metrics,
                                .answer_size = OBU_REPORT_SIZE, .reload = reload };
    const int code = operators_open(&self->operators, service, &def, error);
    if (code != 0) {
        return fail(code, error);
    }
    if (!realtime_lock(service, error, sizeof error)) {
        return fail(EXIT_OS, error);
    }
    const int refused = thread_become(&service->planning);
    if (refused != 0) {
        realtime_explain(service, refused, error, sizeof error);
        return fail(EXIT_OS, error);
    }
    return 0;
}

static int start(live* self)
{
    signals_block(); // before the first thread, because threads inherit it
    int code = load(self);
    code = code != 0 ? code : open_buses(self);
    code = code != 0 ? code : open_descriptors(self);
    code = code != 0 ? code : open_operators(self);
    if (code != 0) {
        return code;
    }
    if (!notify_open(&self->notify)) {
        log_event(LOG_WARNING, "notify_unusable",
                  "reason=\"NOTIFY_SOCKET is neither a short path nor an abstract name\"");
    }
    self->start_utime = clock_us(CLOCK_REALTIME);
    const site* site = self->now.site;
    timer_arm(self->cycle_fd, site->cycle_ms);
    timer_arm(self->second_fd, SECOND_MS);
    char buses[SITE_BUSES_MAX * SITE_BUS_SIZE];
    site_bus_list(site, buses, sizeof buses);
    const unit_memory memory = unit_memory_of(unit_of(self));
    log_event(LOG_ALWAYS, "READY",
              "version=%s vehicle=%d bus=%s state=%s trajectory=%s cycle_ms=%u planner_bytes=%zu "
              "road_bytes=%zu map_crc32=0x%08x config_crc32=0x%08x",
              VERGE_VERSION_STRING, config_now(self)->vehicle_id, buses,
              self->state_bus != NULL ? config_now(self)->state : "bus",
              self->trajectory_bus != NULL ? config_now(self)->trajectory : "bus", site->cycle_ms,
              memory.stages, memory.road, site->map_crc32, site->config_crc32);
    notify_send(&self->notify, "READY=1");
    return 0;
}

// ---- the loop -----------------------------------------------------------------------------

static bool on_signals(live* self);
static void receive(live* self);
static void on_tick(live* self);
static void on_second(live* self);

static void loop(live* self)
{
    const int64_t limit = self->options->cycles;
    while (limit == 0 || self->cycles < limit) {
        struct pollfd ends[OWN_ENDS + SITE_BUSES_MAX + OPERATORS_ENDS] = {
            { .fd = self->signal_fd, .events = POLLIN },
            { .fd = reloader_fd(&self->reloader), .events = POLLIN },
            { .fd = self->cycle_fd, .events = POLLIN },
            { .fd = self->second_fd, .events = POLLIN },
            { .fd = self->state_bus != NULL ? transport_fd(self->state_bus) : -1,
              .events = POLLIN },
        };
        uint32_t count = OWN_ENDS;
        count += buses_poll(&self->now.buses, ends + count);
        count += operators_ends(&self->operators, ends + count);
        if (poll(ends, count, SECOND_MS) < 0 && errno != EINTR) {
            log_event(LOG_ERROR, "poll", "error=%s", strerror(errno));
        }
        if (on_signals(self)) {
            return;
        }
        // An accepted configuration waits for apply_next().
        (void)reloader_over(&self->reloader, &self->notify);
        receive(self);
        on_tick(self);
        on_second(self);
        operators_serve(&self->operators, clock_us(CLOCK_MONOTONIC)); // last: operators can wait
    }
}

// ---- receiving ----------------------------------------------------------------------------

static void log_refused_plan(const live* self, const transport_message* message,
                             const uint64_t before[LEADER_VERDICTS])
{
    const leader* leader = unit_leader(unit_of(self));
    for (uint32_t i = LEADER_ACCEPTED + 1; i < LEADER_VERDICTS; i++) {
        // Several senders of old plans are normal where there is more than one bus.
        if (leader->counters[i] > before[i] && i != LEADER_OLD) {
            char sender[64];
            transport_sender_text(self->now.buses.bus[message->bus], message->sender, sender,
                                  sizeof sender);
            log_repeated(LOG_WARNING, "plan_refused", i,
                         "reason=%s rsu_id=%d cycle=%d followed_rsu=%d sender=%s",
                         leader_verdict_name((leader_verdict)i), message->as.plan.rsu_id,
                         message->as.plan.cycle, leader->rsu_id, sender);
        }
    }
}

static void receive_message(live* self, const transport_message* message)
{
    uint64_t before[LEADER_VERDICTS];
    memcpy(before, unit_leader(unit_of(self))->counters, sizeof before);
    const bool used = unit_offer(unit_of(self), message);
    if (!used && message->kind == TRANSPORT_PLAN) {
        log_refused_plan(self, message, before);
    }
}

/// An own state from the vehicle's own bus also goes to the others, with the plan that is followed.
static void forward(live* self, const transport_message* message)
{
    verge_vehicle_state_t state = message->as.state;
    const unit_view view = unit_look(unit_of(self));
    wire_unit_reason why_not;
    const verge_vehicle_plan_t* plan =
        leader_plan(unit_leader(unit_of(self)), message->arrival_utime, &why_not);
    state.followed_cycle = view.mode == WIRE_FOLLOWING && plan != NULL ? plan->cycle : -1;
    buses_publish(&self->now.buses, TRANSPORT_STATE, &state);
}

static uint32_t receive_own(live* self)
{
    if (self->state_bus == NULL) {
        return 0;
    }
    const uint32_t count = transport_drain(self->state_bus, self->inbound, DRAIN_BATCH);
    for (uint32_t i = 0; i < count; i++) {
        self->inbound[i].bus = self->now.buses.count;
        const bool own = self->inbound[i].as.state.vehicle_id == config_now(self)->vehicle_id;
        if (own && unit_offer(unit_of(self), &self->inbound[i])) {
            forward(self, &self->inbound[i]);
        }
    }
    return count;
}

/// Receives a batch from each bus. Returns the size of the largest batch.
static uint32_t receive_batches(live* self)
{
    uint32_t most = receive_own(self);
    for (uint32_t bus = 0; bus < self->now.buses.count; bus++) {
        const uint32_t count = buses_drain(&self->now.buses, bus, self->inbound, DRAIN_BATCH);
        for (uint32_t i = 0; i < count; i++) {
            receive_message(self, &self->inbound[i]);
        }
        most = count > most ? count : most;
    }
    return most;
}

static void receive(live* self)
{
    for (uint32_t round = 0; round < DRAIN_ROUNDS_MAX; round++) {
        if (receive_batches(self) < DRAIN_BATCH) {
            return;
        }
    }
}

// ---- a cycle ------------------------------------------------------------------------------

static void apply_next(live* self);

static void publish(live* self, const verge_vehicle_trajectory_t* trajectory)
{
    if (self->trajectory_bus != NULL) {
        transport_publish_trajectory(self->trajectory_bus, trajectory);
    } else {
        buses_publish(&self->now.buses, TRANSPORT_TRAJECTORY, trajectory);
    }
}

/// Each change of mode or of its reason is logged.
static void log_mode(live* self, const verge_vehicle_trajectory_t* made)
{
    const wire_unit_mode mode = (wire_unit_mode)made->mode;
    const wire_unit_reason reason = (wire_unit_reason)made->mode_reason;
    if (self->spoke && mode == self->mode && reason == self->reason) {
        return;
    }
    char about[32] = "", plan[64] = "";
    if (made->mode_vehicle >= 0) {
        snprintf(about, sizeof about, " about=%d", made->mode_vehicle);
    }
    if (made->followed_cycle >= 0) {
        snprintf(plan, sizeof plan, " rsu_id=%d cycle=%d", made->rsu_id, made->followed_cycle);
    }
    log_event(LOG_INFO, "mode", "from=%s to=%s reason=%s%s%s",
              self->spoke ? wire_unit_mode_name((int32_t)self->mode) : "none",
              wire_unit_mode_name(made->mode), wire_unit_reason_name(made->mode_reason), about,
              plan);
    self->mode = mode;
    self->reason = reason;
    self->spoke = true;
}

static void count_misses(live* self, uint64_t ticks)
{
    if (ticks > 1) {
        self->deadline_misses += ticks - 1;
        log_repeated(LOG_WARNING, "deadline_missed", 0, "cycle_ms=%u total=%" PRIu64,
                     self->now.site->cycle_ms, self->deadline_misses);
    }
}

/// Says whether the roadside unit plans what it would plan from the messages that were heard here.
static void compare(live* self)
{
    static repeat_result result; // large
    if (!unit_repeat(unit_of(self), &result) || !result.planned) {
        return;
    }
    for (uint32_t i = 0; i < result.difference_count; i++) {
        const repeat_difference* found = &result.differences[i];
        log_repeated(LOG_INFO, "plan_compared", (uint32_t)found->kind,
                     "cycle=%d same=%s vehicle=%d lane=%d state_utime=%" PRId64 " words=\"%s\"",
                     result.plan.cycle, result.same ? "yes" : "no", found->vehicle_id,
                     found->lane_id, found->state_utime, repeat_kind_text(found->kind));
    }
    log_event(LOG_DEBUG, "plan_repeated", "cycle=%d same=%s", result.plan.cycle,
              result.same ? "yes" : "no");
}

static void on_tick(live* self)
{
    const uint64_t ticks = timer_expirations(self->cycle_fd);
    if (ticks == 0) {
        return;
    }
    count_misses(self, ticks);
    apply_next(self);
    if (floating_correct()) {
        log_repeated(LOG_WARNING, "floating_corrected", 0, "when=cycle");
    }
    const int64_t begun = clock_us(CLOCK_MONOTONIC);
    verge_vehicle_trajectory_t trajectory;
    if (unit_cycle(unit_of(self), clock_us(CLOCK_REALTIME), &trajectory)) {
        publish(self, &trajectory);
        log_mode(self, &trajectory);
    }
    self->cycles++;
    timing_add(&self->cycle_time, clock_us(CLOCK_MONOTONIC) - begun);
    compare(self);
    if (self->notify.watchdog_us > 0) {
        notify_send(&self->notify, "WATCHDOG=1");
    }
}

// ---- once a second ------------------------------------------------------------------------

/// At most one line a second, with the number of states refused for each reason.
static void log_refusals(live* self)
{
    const inbox_counters* rx = &unit_inbox(unit_of(self))->counters;
    const uint64_t refusals = rx->rx_stale + rx->rx_future + rx->rx_out_of_order
                              + rx->rx_out_of_range + rx->rx_id_conflict + rx->rx_version
                              + rx->rx_over_capacity;
    if (refusals > self->refusals) {
        log_event(LOG_WARNING, "states_refused",
                  "new=%" PRIu64 " stale=%" PRIu64 " future=%" PRIu64 " out_of_order=%" PRIu64
                  " out_of_range=%" PRIu64 " id_conflict=%" PRIu64 " version=%" PRIu64
                  " over_capacity=%" PRIu64,
                  refusals - self->refusals, rx->rx_stale, rx->rx_future, rx->rx_out_of_order,
                  rx->rx_out_of_range, rx->rx_id_conflict, rx->rx_version, rx->rx_over_capacity);
    }
    self->refusals = refusals;
}

static void log_incidents(live* self)
{
    const unit_counters now = unit_count(unit_of(self));
    if (now.own_id_elsewhere > self->counted.own_id_elsewhere) {
        log_repeated(LOG_WARNING, "own_id_elsewhere", 0,
                     "vehicle=%d total=%" PRIu64 " words=\"states with the vehicle's own id come "
                     "from a bus that is not its own\"", config_now(self)->vehicle_id,
                     now.own_id_elsewhere);
    }
    if (now.clock_steps > self->counted.clock_steps) {
        log_event(LOG_WARNING, "clock_stepped", "total=%" PRIu64, now.clock_steps);
    }
    self->counted = now;
}

static void log_bus_errors(live* self)
{
    for (uint32_t bus = 0; bus < self->now.buses.count; bus++) {
        const uint64_t errors = buses_new_errors(&self->now.buses, bus);
        if (errors > 0) {
            log_repeated(LOG_WARNING, "bus_trouble", bus,
                         "errors=%" PRIu64 " bus=%s action=keeps_trying", errors,
                         self->now.site->bus[bus]);
        }
    }
    const int64_t utime = clock_us(CLOCK_REALTIME);
    if (buses_expiring(&self->now.buses, utime)) {
        log_event(LOG_WARNING, "certificate_expires", "days=%" PRId64 " words=\"%s\"",
                  buses_days_left(self->now.buses.expiry, utime),
                  log_words(self->now.buses.expiry_text));
    }
}

static void on_second(live* self)
{
    if (timer_expirations(self->second_fd) == 0) {
        return;
    }
    log_report_dropped();
    log_refusals(self);
    log_incidents(self);
    log_bus_errors(self);
    operators_write(&self->operators);
    char text[96];
    const unit_view view = unit_look(unit_of(self));
    snprintf(text, sizeof text, "vehicle %d: %s, %s", config_now(self)->vehicle_id,
             wire_unit_mode_name((int32_t)view.mode), wire_unit_reason_name((int32_t)view.reason));
    notify_status(&self->notify, text);
}

// ---- operators ----------------------------------------------------------------------------

static transport_stats statistics(const live* self)
{
    transport_stats sum = buses_statistics(&self->now.buses);
    const transport* own[] = { self->state_bus, self->trajectory_bus };
    for (unsigned i = 0; i < sizeof own / sizeof own[0]; i++) {
        if (own[i] != NULL) {
            buses_add(&sum, own[i]);
        }
    }
    return sum;
}

static obu_report view(const live* self)
{
    return (obu_report){
        .config = config_now(self),
        .unit = unit_of(self),
        .cycle_time = &self->cycle_time,
        .bus = statistics(self),
        .utime = clock_us(CLOCK_REALTIME),
        .start_utime = self->start_utime,
        .deadline_misses = self->deadline_misses,
        .log_dropped = log_dropped(),
    };
}

static void answer_status(void* context, text* answer)
{
    const obu_report from = view(context);
    obu_report_status(answer, &from);
}

static void answer_vehicles(void* context, text* answer)
{
    const obu_report from = view(context);
    obu_report_vehicles(answer, &from);
}

static void answer_plans(void* context, text* answer)
{
    const obu_report from = view(context);
    obu_report_plans(answer, &from);
}

static void answer_metrics(void* context, text* page)
{
    const obu_report from = view(context);
    obu_report_metrics(page, &from);
}

static void log_statistics(const live* self)
{
    const unit_counters made = unit_count(unit_of(self));
    const leader* leader = unit_leader(unit_of(self));
    log_event(LOG_ALWAYS, "statistics",
              "mode=%s following=%" PRIu64 " departing=%" PRIu64 " alone=%" PRIu64
              " stopping=%" PRIu64 " mode_changes=%" PRIu64 " fallbacks=%" PRIu64
              " plans_accepted=%" PRIu64 " rx_accepted=%" PRIu64 " deadline_misses=%" PRIu64
              " cycle_us_p99=%" PRIu32,
              wire_unit_mode_name((int32_t)self->mode), made.by_mode[WIRE_FOLLOWING],
              made.by_mode[WIRE_DEPARTING], made.by_mode[WIRE_ALONE], made.by_mode[WIRE_STOPPING],
              made.mode_changes, made.fallbacks, leader->counters[LEADER_ACCEPTED],
              unit_inbox(unit_of(self))->counters.rx_accepted, self->deadline_misses,
              timing_p99(&self->cycle_time));
}

// ---- signals, new configuration -----------------------------------------------------------

/// True: the daemon has to stop.
static bool on_signals(live* self)
{
    for (;;) {
        switch (signals_next(self->signal_fd)) {
        case 0: return false;
        case SIGHUP: reloader_begin(&self->reloader, &self->notify); break;
        case SIGUSR1: log_statistics(self); break;
        case SIGTERM: log_event(LOG_INFO, "stopping", "signal=SIGTERM"); return true;
        default: log_event(LOG_INFO, "stopping", "signal=SIGINT"); return true;
        }
    }
}

static reload_result reload(void* context, uint64_t* ticket, const char** reason)
{
    live* self = context;
    return reloader_serve(&self->reloader, &self->notify, ticket, reason);
}

/// Between two cycles: the accepted configuration takes effect. The new unit begins without a plan;
/// states and plans come within a cycle of their senders.
static void apply_next(live* self)
{
    const setup* next = reloader_next(&self->reloader);
    if (next == NULL) {
        return;
    }
    const uint32_t period = self->now.site->cycle_ms;
    unit_continue(next->made, unit_of(self));
    reloader_install(&self->reloader);
    if (self->now.site->cycle_ms != period) {
        timer_arm(self->cycle_fd, self->now.site->cycle_ms);
    }
    start_log_format(self->options, self->now.site);
    reloader_applied(&self->reloader, &self->notify);
}

// ---- stop ---------------------------------------------------------------------------------

static int stop(live* self)
{
    notify_send(&self->notify, "STOPPING=1");
    operators_write(&self->operators);
    log_statistics(self);
    log_event(LOG_INFO, "stopped", "cycles=%" PRId64, self->cycles);
    if (reloader_busy(&self->reloader)) { // its result is not needed any more
        operators_close(&self->operators);
        log_stop(LOG_PATIENCE_US);
        _exit(0);
    }
    release(self);
    return 0;
}

static void release(live* self)
{
    notify_close(&self->notify);
    operators_close(&self->operators);
    reloader_close(&self->reloader);
    transport_close(self->state_bus);
    transport_close(self->trajectory_bus);
    setup_free(&self->now);
    const int ends[] = { self->signal_fd, self->cycle_fd, self->second_fd };
    for (unsigned i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        if (ends[i] >= 0) {
            close(ends[i]);
        }
    }
    log_stop(LOG_PATIENCE_US);
}
