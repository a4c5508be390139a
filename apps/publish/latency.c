#include "latency.h"

#include "common/number.h"

#include <stdlib.h>

static void series_add(latency_series* self, int64_t us)
{
    // A clock that was set in between, or a plan of another time, gives no measurement.
    if (self->count < LATENCY_MAX && us >= 0 && us < 60000000) {
        self->us[self->count++] = (int32_t)us;
    }
}

void latency_add(latency* self, const verge_vehicle_plan_t* plan, int64_t arrival_us,
                 int64_t state_sent_us)
{
    series_add(&self->plan_to_here, arrival_us - plan->utime);
    if (state_sent_us != 0) {
        series_add(&self->state_to_plan, arrival_us - state_sent_us);
    }
}

void latency_add_trajectory(latency* self, int64_t arrival_us, int64_t state_sent_us)
{
    series_add(&self->state_to_trajectory, arrival_us - state_sent_us);
}

static int ascending(const void* one, const void* other)
{
    const int32_t a = *(const int32_t*)one, b = *(const int32_t*)other;
    return (a > b) - (a < b);
}

/// The value that this share of the sorted ones does not exceed.
static double quantile_ms(const latency_series* self, double share)
{
    const uint32_t rank = (uint32_t)(share * self->count);
    return self->us[rank < self->count ? rank : self->count - 1] * 1e-3;
}

static void series_write(FILE* out, const char* name, latency_series* self)
{
    fprintf(out, "\"%s\":{\"count\":%u", name, self->count);
    if (self->count > 0) {
        qsort(self->us, self->count, sizeof self->us[0], ascending);
        const struct { const char* key; double share; } quantiles[] = {
            { "p50", 0.5 }, { "p99", 0.99 }, { "max", 1.0 },
        };
        for (int i = 0; i < 3; ++i) {
            fprintf(out, ",\"%s\":", quantiles[i].key);
            number_write(out, quantile_ms(self, quantiles[i].share));
        }
    }
    fputs("}", out);
}

void latency_write(FILE* out, latency* self)
{
    fputs("{", out);
    series_write(out, "state_to_plan_ms", &self->state_to_plan);
    fputs(",", out);
    series_write(out, "plan_to_here_ms", &self->plan_to_here);
    fputs(",", out);
    series_write(out, "state_to_trajectory_ms", &self->state_to_trajectory);
    fputs("}", out);
}
