/// See units.h.
#include "units.h"

#include "common/state_message.h"

#include "verge/wire.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

typedef struct span span;
static uint32_t           index_of(const world* world, int32_t id);
static units_verdict      judged(const world_vehicle* vehicle, double now, const span* valid,
                                 const verge_vehicle_plan* trajectory);
static void               tell(units* self, const world* world, uint32_t index);

/// When a trajectory is valid, in the world's time.
struct span {
    double begun, until; ///< [s]
};

/// A trajectory that begins farther from the vehicle than this is refused. [m], [m/s]
static const double FAR = 1.0;
/// Clocks may differ by this much. [s]
static const double CLOCKS = 0.04;
/// A vehicle that is not in the world.
static const uint32_t NOBODY = UINT32_MAX;

void units_init(units* self, const world* world, int64_t start, FILE* run, bool quiet)
{
    memset(self, 0, sizeof *self);
    self->start = start;
    self->run = run;
    self->quiet = quiet;
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        self->each[i].utime = INT64_MIN;
        self->each[i].now = (run_unit){ .vehicle_id = world->vehicles[i].state.id, .about = -1,
                                        .cycle = -1 };
    }
}

static span span_of(const units* self, const verge_vehicle_trajectory_t* message,
                    const verge_vehicle_plan* trajectory)
{
    const double begun = (double)(message->utime - self->start) * 1e-6;
    const double until = (double)(message->valid_until_utime - self->start) * 1e-6;
    return (span){ begun, fmin(until, begun + trajectory->points[trajectory->point_count - 1].t) };
}

units_verdict units_hear(units* self, world* world, const verge_vehicle_trajectory_t* message)
{
    if (wire_trajectory_check(message) != NULL) {
        ++self->counts[UNITS_INVALID];
        return UNITS_INVALID;
    }
    const uint32_t index = index_of(world, message->vehicle_id);
    if (index == NOBODY) {
        return UNITS_IGNORED;
    }
    units_one*               unit = &self->each[index];
    const verge_vehicle_plan trajectory = trajectory_plan(message);
    const span               valid = span_of(self, message, &trajectory);
    const bool               newer = message->utime > unit->utime ||
                       (message->utime == unit->utime && message->sequence > unit->sequence);
    const units_verdict verdict =
        newer ? judged(&world->vehicles[index], world_time(world), &valid, &trajectory)
              : UNITS_OLDER;
    ++self->counts[verdict];
    if (verdict == UNITS_DRIVEN) {
        unit->utime = message->utime;
        unit->sequence = message->sequence;
        unit->now.mode = wire_unit_mode_name(message->mode);
        unit->now.reason = wire_unit_reason_name(message->mode_reason);
        unit->now.about = message->mode_vehicle;
        unit->now.cycle = message->followed_cycle;
        world_drive(world, &trajectory, valid.begun, valid.until, unit->now.mode);
        tell(self, world, index);
    }
    return verdict;
}

/// Index of a controlled vehicle that is in the scene.
static uint32_t index_of(const world* world, int32_t id)
{
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const world_vehicle* vehicle = &world->vehicles[i];
        if (vehicle->state.id == id && vehicle->state.controlled && vehicle->present) {
            return i;
        }
    }
    return NOBODY;
}

/// Is the vehicle far from where the trajectory has it? ahead: [s] from the vehicle's state to the
/// point.
static bool is_far(const verge_vehicle* state, double ahead, const verge_point* point)
{
    const double speed = state->speed + state->acceleration * ahead;
    const double distance = 0.5 * (state->speed + speed) * ahead;
    const double x = point->x - (state->x + distance * cos(state->heading));
    const double y = point->y - (state->y + distance * sin(state->heading));
    return x * x + y * y > FAR * FAR || fabs(point->speed - speed) > FAR;
}

/// A newer trajectory. now: [s] time of the vehicle's state.
static units_verdict judged(const world_vehicle* vehicle, double now, const span* valid,
                            const verge_vehicle_plan* trajectory)
{
    verge_point  point;
    const double at = fmax(valid->begun, now);
    if (valid->until < now || !world_point_at(trajectory, at - valid->begun, &point)) {
        return UNITS_LATE;
    }
    if (valid->begun > now + WORLD_DT + CLOCKS) {
        return UNITS_EARLY;
    }
    return is_far(&vehicle->state, at - now, &point) ? UNITS_FAR : UNITS_DRIVEN;
}

void units_tick(units* self, const world* world)
{
    for (uint32_t i = 0; i < world->vehicle_count; ++i) {
        const char* mode = world->vehicles[i].mode;
        if (mode != NULL && strcmp(mode, WORLD_MODE_NONE) == 0) {
            self->each[i].now.mode = mode;
            self->each[i].now.reason = wire_unit_reason_name(WIRE_UNIT_NONE);
            self->each[i].now.about = self->each[i].now.cycle = -1;
            tell(self, world, i);
        }
    }
}

int32_t units_cycle(const units* self, uint32_t index)
{
    return self->each[index].now.cycle;
}

static void print_mode(double time, const run_unit* unit)
{
    printf("%6.1f s  vehicle %-3d mode %s", time, unit->vehicle_id, unit->mode);
    if (strcmp(unit->reason, wire_unit_reason_name(WIRE_UNIT_NONE)) != 0) {
        printf(", %s", unit->reason);
    }
    if (unit->about >= 0) {
        printf(", vehicle %d", unit->about);
    }
    if (unit->cycle >= 0) {
        printf(", plan of cycle %d", unit->cycle);
    }
    printf("\n");
    fflush(stdout);
}

/// Reports what the unit does if its mode, its reason or the vehicle of the reason is another one
/// than reported last.
static void tell(units* self, const world* world, uint32_t index)
{
    const run_unit* now = &self->each[index].now;
    run_unit*       told = &self->each[index].told;
    if (told->mode != NULL && strcmp(told->mode, now->mode) == 0 &&
        strcmp(told->reason, now->reason) == 0 && told->about == now->about) {
        return;
    }
    *told = *now;
    if (self->run != NULL) {
        run_write_unit(self->run, world_time(world), now);
    }
    if (!self->quiet) {
        print_mode(world_time(world), now);
    }
}

void units_write(FILE* out, const units* self)
{
    static const char* const names[UNITS_VERDICTS] = { "driven", "invalid", "older",
                                                       "late", "early", "far" };
    for (uint32_t i = 0; i < UNITS_VERDICTS; ++i) {
        fprintf(out, "%s\"%s\":%" PRIu64, i == 0 ? "{" : ",", names[i], self->counts[i]);
    }
    fputc('}', out);
}
