/// See metrics.h.
#include "metrics.h"

#include "number.h"
#include "standing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void intention_check(metrics_vehicle* vehicle, const world* world,
                            const world_vehicle* there);
static void end_check(metrics_vehicle* vehicle, const world* world, const world_vehicle* there);
static void unit_check(metrics_unit* unit, const char* mode);
static void pair_check(metrics* self, const world* world, uint32_t a, uint32_t b);
static metrics_direction road_direction(const world* world, const world_vehicle* there);
static void ahead_check(metrics* self, const verge_vehicle* ego, const verge_vehicle* other);
static metrics_direction direction_of(double heading);
static double mean_of(const metrics* self, size_t offset);
static void times_write(FILE* out, const metrics* self, const char* name, size_t offset);
static void timing_write(FILE* out, const metrics* self);
static void units_write(FILE* out, const metrics* self, const char* line);
static int  by_value(const void* a, const void* b);

/// A vehicle has reached its target lane when its centre is this close to the centreline. [m]
static const double REACHED_OFFSET = 0.5;
/// The paper's gap: among vehicles this close laterally, less one car's length. [m]
static const double GAP_LATERAL = 2.0;
static const double GAP_LENGTH = 5.0;
/// Cosine of the largest angle between the headings of two vehicles that drive in the same
/// direction. A crossing vehicle has no time to collision.
static const double SAME_WAY = 0.7;
/// A smaller closing speed is rounding, as between two vehicles at standstill. [m/s]
static const double CLOSING_MIN = 1e-3;
static const double PI = 3.14159265358979323846;

bool metrics_init(metrics* self, const world* world)
{
    const uint32_t count = world->vehicle_count;
    *self = (metrics){ .vehicle_count = count, .min_distance = INFINITY,
                       .min_center_gap = INFINITY, .min_ttc = INFINITY,
                       .reordered = NAN, .unstuck = NAN };
    self->vehicles = calloc(count + 1, sizeof *self->vehicles);
    self->touched = calloc((size_t)count * count + 1, sizeof *self->touched);
    self->road_directions = calloc(count + 1, sizeof *self->road_directions);
    if (self->vehicles == NULL || self->touched == NULL || self->road_directions == NULL) {
        metrics_free(self);
        return false;
    }
    for (uint32_t i = 0; i < count; ++i) {
        const world_vehicle* there = &world->vehicles[i];
        const int32_t        target = there->state.target_lane;
        self->vehicles[i] = (metrics_vehicle){
            .id = there->state.id,
            .intends = there->state.controlled && target != VERGE_NO_LANE,
            .keeps = target != VERGE_NO_LANE && there->lane != VERGE_NO_LANE &&
                     verge_road_continues(world->road, target, there->lane),
            .finish_time = NAN,
            .reached_time = NAN,
        };
    }
    return true;
}

void metrics_free(metrics* self)
{
    free(self->vehicles);
    free(self->touched);
    free(self->road_directions);
    free(self->cycle_ms);
    *self = (metrics){ 0 };
}

void metrics_tick(metrics* self, const world* world)
{
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        self->road_directions[i] = road_direction(world, &world->vehicles[i]);
    }
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        const world_vehicle* vehicle = &world->vehicles[i];
        end_check(&self->vehicles[i], world, vehicle);
        if (!vehicle->present) {
            continue;
        }
        intention_check(&self->vehicles[i], world, vehicle);
        if (vehicle->mode != NULL) {
            unit_check(&self->vehicles[i].unit, vehicle->mode);
        }
        if (vehicle->state.controlled) {
            self->max_abs_acceleration =
                fmax(self->max_abs_acceleration, fabs(vehicle->state.acceleration));
            self->max_abs_jerk = fmax(self->max_abs_jerk, fabs(vehicle->jerk));
            self->max_abs_curvature = fmax(self->max_abs_curvature, fabs(vehicle->curvature));
        }
        for (uint32_t k = i + 1; k < self->vehicle_count; ++k) {
            if (world->vehicles[k].present) {
                pair_check(self, world, i, k);
            }
        }
    }
}

void metrics_cycle(metrics* self, const verge_plan* plan, const verge_counters* counters,
                   double ms)
{
    if (counters != NULL) {
        self->reordered = (double)counters->reordered;
        self->unstuck = (double)counters->unstuck;
    }
    ++self->cycles;
    self->fallbacks += plan->fallback_count;
    self->nodes += plan->search.nodes;
    if (!(ms >= 0.0)) {
        return;
    }
    if (self->cycle_ms_count == self->cycle_ms_capacity) {
        const uint32_t capacity = self->cycle_ms_capacity * 2 + 64;
        double*        larger = realloc(self->cycle_ms, capacity * sizeof *larger);
        if (larger == NULL) {
            return; // the percentiles are of the cycles so far
        }
        self->cycle_ms = larger;
        self->cycle_ms_capacity = capacity;
    }
    self->cycle_ms[self->cycle_ms_count++] = ms;
}

bool metrics_success(const metrics* self)
{
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        if (self->vehicles[i].off_road || self->vehicles[i].standing) {
            return false;
        }
    }
    return metrics_reached(self);
}

bool metrics_reached(const metrics* self)
{
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        if (self->vehicles[i].intends && isnan(self->vehicles[i].reached_time)) {
            return false;
        }
    }
    return self->collisions == 0;
}

static void counts_write(FILE* out, const metrics* self, const char* line)
{
    uint32_t off_road = 0, standing = 0;
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        off_road += self->vehicles[i].off_road ? 1 : 0;
        standing += self->vehicles[i].standing ? 1 : 0;
    }
    const struct { const char* name; uint32_t value; } counts[] = {
        { "collisions", self->collisions }, { "collisions_human", self->collisions_human },
        { "off_road", off_road }, { "standing", standing },
    };
    for (uint32_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
        fprintf(out, "\"%s\":%u,%s", counts[i].name, counts[i].value, line);
    }
}

double metrics_finish_mean(const metrics* self)
{
    return mean_of(self, offsetof(metrics_vehicle, finish_time));
}

double metrics_reached_mean(const metrics* self)
{
    return mean_of(self, offsetof(metrics_vehicle, reached_time));
}

void metrics_write(FILE* out, const metrics* self, bool timing, const char* line)
{
    const struct { const char* name; double value; } fields[] = {
        { "min_distance", self->min_distance },
        { "min_center_gap", self->min_center_gap },
        { "min_ttc", self->min_ttc },
        { "max_abs_acceleration", self->max_abs_acceleration },
        { "max_abs_jerk", self->max_abs_jerk },
        { "max_abs_curvature", self->max_abs_curvature },
        { "fallbacks", (double)self->fallbacks },
        { "nodes_mean", self->nodes > 0 ? (double)self->nodes / (double)self->cycles
                                        : (double)NAN },
        { "reordered", self->reordered },
        { "unstuck", self->unstuck },
    };
    fprintf(out, "{\"success\":%s,%s", metrics_success(self) ? "true" : "false", line);
    counts_write(out, self, line);
    times_write(out, self, "finish_time", offsetof(metrics_vehicle, finish_time));
    fprintf(out, ",%s", line);
    times_write(out, self, "reached_time", offsetof(metrics_vehicle, reached_time));
    for (uint32_t i = 0; i < sizeof fields / sizeof fields[0]; ++i) {
        fprintf(out, ",%s\"%s\":", line, fields[i].name);
        number_write(out, fields[i].value);
    }
    if (timing) {
        fprintf(out, ",%s", line);
        timing_write(out, self);
    }
    units_write(out, self, line);
    fputc('}', out);
}

double percentile(const double* sorted, uint32_t count, double share)
{
    if (count == 0) {
        return NAN;
    }
    const double rank = ceil(share * (double)count); // nearest rank, from 1
    const double index = fmin(fmax(rank, 1.0), (double)count) - 1.0;
    return sorted[(uint32_t)index];
}

/// The conditions that count at the end of the run.
static void end_check(metrics_vehicle* vehicle, const world* world, const world_vehicle* there)
{
    const bool controlled = there->state.controlled;
    vehicle->off_road = controlled && there->off_road;
    vehicle->standing = controlled && standing_without_cause(world, there);
}

/// Stores the first instants in the target lane and near its centreline.
static void intention_check(metrics_vehicle* vehicle, const world* world,
                            const world_vehicle* there)
{
    const verge_vehicle*  state = &there->state;
    const verge_road_def* road = &world->scene->def.road;
    if (!vehicle->intends || !isnan(vehicle->reached_time)) {
        return;
    }
    for (uint32_t i = 0; i < road->lane_count; ++i) {
        const int32_t lane = road->lanes[i].id;
        if (!verge_road_continues(world->road, state->target_lane, lane)) {
            continue;
        }
        const verge_lane_position at =
            verge_road_project_on(world->road, lane, state->x, state->y);
        if (!at.contained) {
            continue;
        }
        if (isnan(vehicle->finish_time)) {
            vehicle->finish_time = world_time(world);
        }
        if (fabs(at.d) <= REACHED_OFFSET) {
            vehicle->reached_time = world_time(world);
            return;
        }
    }
}

/// Direction of the lane at the position of a vehicle; its own heading if it is on no lane.
static metrics_direction road_direction(const world* world, const world_vehicle* there)
{
    const verge_vehicle* state = &there->state;
    if (there->lane == VERGE_NO_LANE) {
        return direction_of(state->heading);
    }
    const verge_lane_position at =
        verge_road_project_on(world->road, there->lane, state->x, state->y);
    return direction_of(at.heading);
}

/// The paper's gap, for this direction of the road.
static void gap_check(metrics* self, metrics_direction road, const verge_vehicle* one,
                      const verge_vehicle* other)
{
    const double x = other->x - one->x;
    const double y = other->y - one->y;
    if (fabs(y * road.x - x * road.y) <= GAP_LATERAL) {
        self->min_center_gap = fmin(self->min_center_gap, sqrt(x * x + y * y) - GAP_LENGTH);
    }
}

static void pair_check(metrics* self, const world* world, uint32_t a, uint32_t b)
{
    const verge_vehicle* one = &world->vehicles[a].state;
    const verge_vehicle* other = &world->vehicles[b].state;
    bool*                touched = &self->touched[(size_t)a * self->vehicle_count + b];
    self->min_distance = fmin(self->min_distance, verge_vehicles_distance(one, other));
    if (!*touched && verge_vehicles_overlap(one, other)) {
        *touched = true;
        if (one->controlled || other->controlled) {
            ++self->collisions;
        } else {
            ++self->collisions_human;
        }
    }
    ahead_check(self, one, other);
    ahead_check(self, other, one);
    gap_check(self, self->road_directions[a], one, other);
    gap_check(self, self->road_directions[b], one, other);
}

/// Updates the time to collision of ego with the other vehicle.
static void ahead_check(metrics* self, const verge_vehicle* ego, const verge_vehicle* other)
{
    const metrics_direction mine = direction_of(ego->heading);
    const metrics_direction theirs = direction_of(other->heading);
    const double    x = other->x - ego->x;
    const double    y = other->y - ego->y;
    const double    along = x * mine.x + y * mine.y;
    const double    across = fabs(y * mine.x - x * mine.y);
    const double same_way = mine.x * theirs.x + mine.y * theirs.y;
    const double closing = ego->speed - other->speed * same_way;
    const bool   in_path = along > 0.0 && across < 0.5 * (ego->width + other->width);
    if (in_path && same_way > SAME_WAY && closing > CLOSING_MIN) {
        const double gap = along - 0.5 * (ego->length + other->length);
        self->min_ttc = fmin(self->min_ttc, fmax(gap, 0.0) / closing);
    }
}

/// Cosine and sine by their series, within 1e-15. The last bit of libm's depends on the processor,
/// and a run has to print the same bytes on all of them. heading: in [-pi, pi].
static metrics_direction direction_of(double heading)
{
    const double half = 0.5 * fmin(fmax(heading, -PI), PI); // the series is short up to pi / 2
    const double square = half * half;
    double cosine = 1.0, sine = half, term_cosine = 1.0, term_sine = half;
    for (int n = 1; n <= 12; ++n) {
        term_cosine *= -square / ((2 * n - 1) * (2 * n));
        term_sine *= -square / ((2 * n) * (2 * n + 1));
        cosine += term_cosine;
        sine += term_sine;
    }
    return (metrics_direction){ .x = cosine * cosine - sine * sine, .y = 2.0 * sine * cosine };
}

/// The mean over the vehicles that reached a target lane other than that of their start.
static double mean_of(const metrics* self, size_t offset)
{
    double   sum = 0.0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        double time;
        memcpy(&time, (const char*)&self->vehicles[i] + offset, sizeof time);
        if (self->vehicles[i].intends && !self->vehicles[i].keeps && !isnan(time)) {
            sum += time;
            ++count;
        }
    }
    return count > 0 ? sum / count : (double)NAN;
}

static void times_write(FILE* out, const metrics* self, const char* name, size_t offset)
{
    fprintf(out, "\"%s\":{\"mean\":", name);
    number_write(out, mean_of(self, offset));
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        if (self->vehicles[i].intends && !self->vehicles[i].keeps) {
            double time;
            memcpy(&time, (const char*)&self->vehicles[i] + offset, sizeof time);
            fprintf(out, ",\"%d\":", self->vehicles[i].id);
            number_write(out, time);
        }
    }
    fputc('}', out);
}

static void timing_write(FILE* out, const metrics* self)
{
    const uint32_t count = self->cycle_ms_count;
    if (count > 0) {
        qsort(self->cycle_ms, count, sizeof *self->cycle_ms, by_value);
    }
    fputs("\"cycle_ms\":{\"p50\":", out);
    number_write(out, percentile(self->cycle_ms, count, 0.50));
    fputs(",\"p99\":", out);
    number_write(out, percentile(self->cycle_ms, count, 0.99));
    fputs(",\"max\":", out);
    number_write(out, percentile(self->cycle_ms, count, 1.0));
    fputc('}', out);
}

/// Adds one tick in a mode.
static void unit_check(metrics_unit* unit, const char* mode)
{
    uint32_t i = 0;
    while (i < unit->mode_count && strcmp(unit->modes[i], mode) != 0) {
        ++i;
    }
    if (i == METRICS_MODES_MAX) {
        return; // there are fewer modes
    }
    unit->changes += unit->mode_count > 0 && i != unit->latest ? 1 : 0;
    unit->mode_count += i == unit->mode_count ? 1 : 0;
    unit->modes[i] = mode;
    unit->latest = i;
    ++unit->ticks[i];
}

static void units_write(FILE* out, const metrics* self, const char* line)
{
    bool any = false;
    for (uint32_t i = 0; i < self->vehicle_count; ++i) {
        const metrics_unit* unit = &self->vehicles[i].unit;
        if (unit->mode_count == 0) {
            continue;
        }
        fprintf(out, any ? "," : ",%s\"units\":{", line);
        any = true;
        fprintf(out, "\"%d\":{", self->vehicles[i].id);
        for (uint32_t k = 0; k < unit->mode_count; ++k) {
            fprintf(out, "\"%s\":", unit->modes[k]);
            number_write(out, (double)unit->ticks[k] / WORLD_TICKS_PER_SECOND);
            fputc(',', out);
        }
        fprintf(out, "\"changes\":%u}", unit->changes);
    }
    fputs(any ? "}" : "", out);
}

static int by_value(const void* a, const void* b)
{
    const double x = *(const double*)a;
    const double y = *(const double*)b;
    return (x > y) - (x < y);
}
