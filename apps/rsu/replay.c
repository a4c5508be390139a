#include "replay.h"

#include "cycle.h"

#include <inttypes.h>
#include <string.h>

enum { BATCH = 64 };

typedef struct replay {
    const replay_options* options;
    replay_report* report;
    transport*     record;
    bool           marked;       // a log of the daemon, with marks
    int64_t        period_us;
    int64_t        next_utime;   // of an unmarked log: the next cycle; 0: none yet
    int64_t        next_number;
    bool           ran;          // at least one cycle was planned
    uint32_t       recorded;     // plans of the last cycle that the log had
    bool           done;
    cycle          cycle;
    transport_message batch[BATCH];
} replay;

static int  has_marks(const char* url, bool* marked, char* error);
static int  open_ends(replay* self, transport** log, const char* url, char* error);
static void run_through(replay* self, transport* log);

int replay_run(const replay_options* options, const config* config, replay_report* report,
               char error[CONFIG_ERROR_SIZE])
{
    static replay self; // large, and one at a time
    memset(&self, 0, sizeof self);
    memset(report, 0, sizeof *report);
    self.options = options;
    self.report = report;
    self.period_us = (int64_t)config->site.cycle_ms * 1000;

    char url[4096];
    snprintf(url, sizeof url, "log:%s", options->log_path);
    int code = has_marks(url, &self.marked, error);
    if (code != 0) {
        return code;
    }
    planning planner;
    transport* log = NULL;
    static const service plain; // helpers run as this thread does
    code = planning_open(&planner, &config->site.planner, &plain, error);
    if (code == 0) {
        code = open_ends(&self, &log, url, error);
    }
    if (code == 0) {
        const cycle_def def = config_cycle_def(config, &planner);
        cycle_init(&self.cycle, &def);
        run_through(&self, log);
    }
    transport_close(self.record);
    transport_close(log);
    planning_close(&planner);
    return code;
}

/// Has the log a cycle mark? Then its marks give the instants of the cycles, not its clock.
static int has_marks(const char* url, bool* marked, char* error)
{
    transport* log = NULL;
    static transport_message batch[BATCH];
    if (transport_open(&log, url, TRANSPORT_MARKS, error, CONFIG_ERROR_SIZE) != TRANSPORT_OK) {
        return EXIT_NO_INPUT;
    }
    *marked = false;
    while (!*marked && !transport_ended(log)) {
        *marked = transport_drain(log, batch, BATCH) > 0;
    }
    transport_close(log);
    return 0;
}

static int open_ends(replay* self, transport** log, const char* url, char* error)
{
    const unsigned receive =
        TRANSPORT_STATES | TRANSPORT_SIGNALS
        | (self->marked ? TRANSPORT_PLANS | TRANSPORT_MARKS : 0u);
    if (transport_open(log, url, receive, error, CONFIG_ERROR_SIZE) != TRANSPORT_OK) {
        return EXIT_NO_INPUT;
    }
    if (self->options->record_path == NULL) {
        return 0;
    }
    char record_url[4096];
    snprintf(record_url, sizeof record_url, "log:%s", self->options->record_path);
    if (transport_open(&self->record, record_url, TRANSPORT_RECORD, error, CONFIG_ERROR_SIZE) !=
        TRANSPORT_OK) {
        return EXIT_OS;
    }
    return 0;
}

// ---- events -------------------------------------------------------------------------------

static void on_input(replay* self, const transport_message* message);
static void on_mark(replay* self, const transport_mark* mark);
static void on_plan(replay* self, const verge_vehicle_plan_t* plan);
static void run_cycle(replay* self, int64_t number, int64_t utime);
static void run_cycles_until(replay* self, int64_t utime);

static void run_through(replay* self, transport* log)
{
    while (!self->done && !transport_ended(log)) {
        const uint32_t count = transport_drain(log, self->batch, BATCH);
        for (uint32_t i = 0; i < count && !self->done; i++) {
            const transport_message* message = &self->batch[i];
            switch (message->kind) {
            case TRANSPORT_SIGNAL:
            case TRANSPORT_STATE: on_input(self, message); break;
            case TRANSPORT_MARK: on_mark(self, &message->as.mark); break;
            case TRANSPORT_PLAN: on_plan(self, &message->as.plan); break;
            default: break;
            }
        }
    }
    if (!self->done && !self->marked && self->next_utime != 0) {
        run_cycle(self, self->next_number++, self->next_utime);
    }
}

static void on_input(replay* self, const transport_message* message)
{
    // Other instants do not occur in real logs, and sums with them would overflow.
    if (message->arrival_utime <= 0 || message->arrival_utime > INT64_MAX / 4) {
        return;
    }
    if (!self->marked) {
        run_cycles_until(self, message->arrival_utime);
    }
    if (cycle_offer(&self->cycle, message) && self->record != NULL) {
        transport_record(self->record, message->arrival_utime, message);
    }
}

/// The first multiple of the period at or after an instant.
static int64_t multiple_from(int64_t utime, int64_t period_us)
{
    return (utime + period_us - 1) / period_us * period_us;
}

/// Plans the cycles that are due before utime.
static void run_cycles_until(replay* self, int64_t utime)
{
    if (self->next_utime == 0) {
        self->next_utime = multiple_from(utime, self->period_us);
    }
    while (!self->done && self->next_utime < utime) {
        const bool empty = self->cycle.view.count == 0 && self->cycle.valid_count == 0;
        if (self->ran && empty && utime - self->next_utime > REPLAY_GAP_US) {
            self->next_utime = multiple_from(utime, self->period_us);
            return;
        }
        run_cycle(self, self->next_number++, self->next_utime);
        self->next_utime += self->period_us;
    }
}

static void report_difference(replay* self, uint64_t recorded_digest, bool count_differs)
{
    replay_report* report = self->report;
    if (report->differs) {
        return;
    }
    report->differs = true;
    report->differs_cycle = self->cycle.number;
    report->differs_utime = self->cycle.utime;
    report->recorded_digest = recorded_digest;
    report->replayed_digest = self->cycle.plan.digest;
    report->count_differs = count_differs;
}

static void on_mark(replay* self, const transport_mark* mark)
{
    if (mark->overrun != 0) {
        return; // the cycle was late, which does not change its plan
    }
    // All plans of the cycle before have been read by now.
    if (self->ran && self->recorded != self->cycle.plan.vehicle_count) {
        report_difference(self, 0, true);
    }
    run_cycle(self, mark->cycle, mark->utime);
}

static void on_plan(replay* self, const verge_vehicle_plan_t* plan)
{
    // A message of an overrun is part of an older plan, or a fallback.
    if (!self->ran || plan->status == VERGE_CANCELLED || plan->reason == VERGE_REASON_OVERRUN ||
        plan->cycle != (int32_t)(self->cycle.number & INT32_MAX)) {
        return;
    }
    self->report->compared += self->recorded == 0 ? 1 : 0;
    self->recorded++;
    if ((uint64_t)plan->digest != self->cycle.plan.digest) {
        report_difference(self, (uint64_t)plan->digest, false);
    }
}

// ---- a cycle ------------------------------------------------------------------------------

static void record_cycle(replay* self);

static void run_cycle(replay* self, int64_t number, int64_t utime)
{
    cycle_run(&self->cycle, number, utime);
    self->ran = true;
    self->recorded = 0;
    self->report->cycles++;
    if (self->options->out != NULL) {
        fprintf(self->options->out,
                "{\"cycle\":%" PRId64 ",\"utime\":%" PRId64 ",\"digest\":\"%016" PRIx64
                "\",\"vehicles\":%u}\n",
                number, utime, self->cycle.plan.digest, self->cycle.plan.vehicle_count);
    }
    record_cycle(self);
    self->done = self->options->cycles > 0 &&
                 self->report->cycles >= (uint64_t)self->options->cycles;
}

static void record_cycle(replay* self)
{
    if (self->record == NULL) {
        return;
    }
    static transport_message message;
    message.kind = TRANSPORT_MARK;
    message.as.mark = (transport_mark){ self->cycle.utime, self->cycle.number, 0 };
    transport_record(self->record, self->cycle.utime, &message);
    message.kind = TRANSPORT_PLAN;
    for (uint32_t i = 0; i < self->cycle.message_count; i++) {
        message.as.plan = self->cycle.messages[i];
        transport_record(self->record, self->cycle.utime, &message);
    }
}
