/// See signals_json.h.
#include "signals_json.h"

#include "road_json.h"

#include <math.h>
#include <stdlib.h>

/// Instants closer than this are the same. [s]
static const double INSTANT = 1e-6;

static bool program_from_json(const json_at* at, const verge_road_def* road,
                              signal_program* program);
static void phase_from_json(const json_at* at, signal_program* program, uint32_t index);
static bool insert(signal_program* all, uint32_t count, const signal_program* program);

bool signals_from_json(const json_at* at, const verge_road_def* road, signal_program** programs,
                       uint32_t* count)
{
    *programs = NULL;
    *count = 0;
    if (!json_given(at)) {
        return true;
    }
    const uint32_t total = json_expect_array(at, 0, VERGE_LANES_MAX);
    if (at->file->error[0] != '\0') {
        return false;
    }
    *programs = calloc(total + 1, sizeof **programs); // one more: never zero bytes
    if (*programs == NULL) {
        return json_fail(at, "out of memory");
    }
    uint32_t index = 0;
    for (const cJSON* node = at->node->child; node != NULL; node = node->next, ++index) {
        const json_at  place = json_element(at, node, index);
        signal_program program = { 0 };
        if (!program_from_json(&place, road, &program)) {
            return false;
        }
        if (!insert(*programs, *count, &program)) {
            const json_at lane = json_member(&place, "lane");
            return json_fail(&lane, "is lane %d, which has a signal already, expected one a lane",
                             program.lane_id);
        }
        ++*count;
    }
    return true;
}

verge_signal signal_at(const signal_program* program, double t)
{
    double cycle = 0.0;
    for (uint32_t i = 0; i < program->phase_count; ++i) {
        cycle += program->seconds[i];
    }
    double left = fmod(t + INSTANT - program->start, cycle);
    left += left < 0.0 ? cycle : 0.0;
    uint32_t phase = 0;
    while (phase + 1 < program->phase_count && left >= program->seconds[phase]) {
        left -= program->seconds[phase++];
    }
    const double until = fmax(program->seconds[phase] - left + INSTANT, 0.0);
    return (verge_signal){ .lane_id = program->lane_id, .state = program->states[phase],
                           .change_s = program->phase_count == 1 ? -1.0 : until };
}

static bool program_from_json(const json_at* at, const verge_road_def* road,
                              signal_program* program)
{
    static const char* const keys[] = { "lane", "start", "phases", NULL };
    if (!json_expect_object(at, keys)) {
        return false;
    }
    program->lane_id = (int32_t)json_integer(at, "lane", 0, INT32_MAX);
    program->start = json_double_or(at, "start", -86400.0, 86400.0, 0.0);
    if (at->file->error[0] == '\0' && !road_has_lane(road, program->lane_id)) {
        const json_at lane = json_member(at, "lane");
        return json_fail(&lane, "is lane %d, which the road does not have, expected a lane id",
                         program->lane_id);
    }
    const json_at phases = json_member(at, "phases");
    program->phase_count = json_expect_array(&phases, 1, SIGNAL_PHASES_MAX);
    if (at->file->error[0] != '\0') {
        return false;
    }
    const cJSON* node = phases.node->child;
    for (uint32_t i = 0; i < program->phase_count; i++, node = node->next) {
        const json_at phase = json_element(&phases, node, i);
        phase_from_json(&phase, program, i);
    }
    return at->file->error[0] == '\0';
}

static void phase_from_json(const json_at* at, signal_program* program, uint32_t index)
{
    static const char* const keys[] = { "state", "seconds", NULL };
    static const char* const states[] = { "off", "red", "yellow", "green", NULL };
    if (json_expect_object(at, keys)) {
        program->states[index] = (verge_signal_state)json_choice(at, "state", states);
        program->seconds[index] = json_double(at, "seconds", 0.1, 86400.0);
    }
}

/// False: the lane has a program.
static bool insert(signal_program* all, uint32_t count, const signal_program* program)
{
    uint32_t at = count;
    while (at > 0 && all[at - 1].lane_id > program->lane_id) {
        --at;
    }
    if (at > 0 && all[at - 1].lane_id == program->lane_id) {
        return false;
    }
    for (uint32_t i = count; i > at; --i) {
        all[i] = all[i - 1];
    }
    all[at] = *program;
    return true;
}
