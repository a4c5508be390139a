/// Which lanes are fitted together, and where these chains meet.
#include "road/fit.h"

#include "base/contract.h"
#include "base/scalar.h"

/// Ends that are one point are no further apart than this share of either lane. [1]
static const double joint_share = 0.2;
/// A lane shorter than this does not tell the direction of all lanes that meet it. [m]
static const double leader_length = 10.0;

/// In place of the index of the only lane that leads somewhere.
enum { NONE = -1, SEVERAL = -2 };

/// The graph as the def has it.
typedef struct graph {
    const verge_road_def* def;
    uint16_t by_id[VERGE_LANES_MAX];
    int32_t  led_by[VERGE_LANES_MAX];
} graph;

static void graph_from(graph* all, const verge_road_def* def)
{
    all->def = def;
    vg_lanes_sort(def, all->by_id);
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        all->led_by[i] = NONE;
    }
    for (uint32_t i = 0; i < def->lane_count; ++i) {
        for (uint32_t k = 0; k < def->lanes[i].successor_count; ++k) {
            const int32_t next = vg_lanes_find(def, all->by_id, def->lanes[i].successors[k]);
            VERGE_ASSERT(next >= 0);
            all->led_by[next] = all->led_by[next] == NONE ? (int32_t)i : SEVERAL;
        }
    }
}

static double gap_between(const verge_lane_def* from, const verge_lane_def* to)
{
    const double* a = from->points[from->point_count - 1];
    const double* b = to->points[0];
    return vg_sqrt(vg_square(a[0] - b[0]) + vg_square(a[1] - b[1]));
}

// ------------------------------------------------------------------------------ chains

/// Does `lane` go on into exactly one lane, which nothing else leads to, without a gap?
static bool joined(const graph* graph, uint32_t lane, uint32_t* next)
{
    const verge_lane_def* from = &graph->def->lanes[lane];
    if (from->successor_count != 1) {
        return false;
    }
    const int32_t to = vg_lanes_find(graph->def, graph->by_id, from->successors[0]);
    if (to < 0 || graph->led_by[to] != (int32_t)lane || (uint32_t)to == lane) {
        return false;
    }
    *next = (uint32_t)to;
    return gap_between(from, &graph->def->lanes[to]) < VG_JOINT_GAP;
}

/// Adds the chain that begins with `lane`.
static void add_chain(vg_fit_chains* all, const graph* graph, bool* taken, uint32_t lane)
{
    vg_fit_chain* added = &all->of[all->count];
    added->first = all->count == 0 ? 0 : (uint16_t)(added[-1].first + added[-1].lane_count);
    added->lane_count = 0;
    ++all->count;
    bool more = true;
    while (more) {
        const uint32_t last = lane;
        all->lanes[added->first + added->lane_count++] = (uint16_t)lane;
        taken[lane] = true;
        more = joined(graph, last, &lane) && !taken[lane];
    }
}

void vg_fit_chains_from(vg_fit_chains* all, const verge_road_def* def)
{
    graph links;
    bool taken[VERGE_LANES_MAX] = { false };
    graph_from(&links, def);
    all->count = 0;
    // First chains that have a first lane; what remains after that are rings, cut anywhere.
    for (int pass = 0; pass < 2; ++pass) {
        for (uint32_t i = 0; i < def->lane_count; ++i) {
            uint32_t next;
            const int32_t before = links.led_by[i];
            const bool continues = before >= 0 && joined(&links, (uint32_t)before, &next);
            if (!taken[i] && (pass == 1 || !continues)) {
                add_chain(all, &links, taken, i);
            }
        }
    }
}

// ------------------------------------------------------------------------------ places

/// How much the road bends where one lane follows another, in direction and in curvature. [rad]
static double bend_between(const verge_lane_def* from, const verge_lane_def* to)
{
    static const double length = 3.0; // [m] over which a step of curvature counts as a turn
    const vg_bearing a = vg_survey_bearing(from, true), b = vg_survey_bearing(to, false);
    return vg_abs(vg_wrap_angle(b.heading - a.heading))
           + length * vg_abs(b.curvature - a.curvature);
}

/// All steps from a lane's end to the start of a lane that continues it, where chains meet.
typedef struct links {
    graph   all;
    bool*   inner;   ///< [lane] the lane starts inside a chain
    double* lengths; ///< [m] [lane] of its survey
} links;

/// One of them. Begin with zeros.
typedef struct link {
    uint32_t from, to;  ///< lane index
    uint32_t successor; ///< of `from`, that comes next
} link;

/// The next link, in the order of lanes. False: there are no more.
static bool next_link(const links* self, link* at)
{
    const verge_road_def* def = self->all.def;
    for (; at->from < def->lane_count; ++at->from, at->successor = 0) {
        const verge_lane_def* lane = &def->lanes[at->from];
        while (at->successor < lane->successor_count) {
            const int32_t id = lane->successors[at->successor++];
            at->to = (uint32_t)vg_lanes_find(def, self->all.by_id, id);
            const double shorter = vg_min(self->lengths[at->from], self->lengths[at->to]);
            if (!self->inner[at->to] && gap_between(lane, &def->lanes[at->to])
                                            < vg_min(VG_JOINT_GAP, joint_share * shorter)) {
                return true;
            }
        }
    }
    return false;
}

static int32_t root_of(int32_t* parents, int32_t end)
{
    while (parents[end] != end) {
        parents[end] = parents[parents[end]];
        end = parents[end];
    }
    return end;
}

/// Joins the ends of all links into sets, each named by its lowest end.
static void join_ends(int32_t* sets, const links* self)
{
    const int32_t count = 2 * (int32_t)self->all.def->lane_count;
    for (int32_t i = 0; i < count; ++i) {
        sets[i] = i;
    }
    for (link at = { 0 }; next_link(self, &at);) {
        const int32_t a = root_of(sets, 2 * (int32_t)at.from + 1);
        const int32_t b = root_of(sets, 2 * (int32_t)at.to);
        sets[a < b ? b : a] = a < b ? a : b;
    }
}

/// Numbers the sets of two ends or more, in the order of their ends.
static uint32_t number_sets(int32_t* sets, bool* used, uint32_t end_count)
{
    for (uint32_t i = 0; i < end_count; ++i) {
        sets[i] = root_of(sets, (int32_t)i); // lower than i or i itself
    }
    for (uint32_t i = 0; i < end_count; ++i) {
        used[i] = false;
    }
    for (uint32_t i = 0; i < end_count; ++i) {
        if (sets[i] != (int32_t)i) {
            used[i] = used[sets[i]] = true;
        }
    }
    uint32_t places = 0;
    for (uint32_t i = 0; i < end_count; ++i) {
        if (!used[i]) {
            sets[i] = -1;
        } else {
            sets[i] = sets[i] == (int32_t)i ? (int32_t)places++ : sets[sets[i]];
        }
    }
    return places;
}

/// Notes, for each place, the lane that all others continue (before) or lead to (behind).
static void find_leaders(vg_fit_places* places, const links* self)
{
    for (uint32_t k = 0; k < places->count; ++k) {
        places->of[k] = (vg_fit_place){ .before = NONE, .behind = NONE };
    }
    for (link at = { 0 }; next_link(self, &at);) {
        vg_fit_place* place = &places->of[places->of_ends[2 * at.from + 1]];
        const int32_t from = (int32_t)at.from, to = (int32_t)at.to;
        place->before = place->before == NONE || place->before == from ? from : SEVERAL;
        place->behind = place->behind == NONE || place->behind == to ? to : SEVERAL;
    }
}

/// Keeps the one leader, or replaces it by the two lanes that follow one another best.
static void choose_pairs(vg_fit_places* places, const links* self, double* least)
{
    const verge_lane_def* lanes = self->all.def->lanes;
    for (uint32_t k = 0; k < places->count; ++k) {
        vg_fit_place* place = &places->of[k];
        const bool leads = place->before >= 0 && place->behind < 0
                           && self->lengths[place->before] >= leader_length;
        const bool led = place->behind >= 0 && place->before < 0
                         && self->lengths[place->behind] >= leader_length;
        least[k] = leads || led ? 0.0 : VG_HUGE; // 0: decided
        place->before = leads ? place->before : NONE;
        place->behind = led ? place->behind : NONE;
    }
    for (link at = { 0 }; next_link(self, &at);) {
        const int32_t k = places->of_ends[2 * at.from + 1];
        const double bend = least[k] > 0.0 ? bend_between(&lanes[at.from], &lanes[at.to]) : 0.0;
        if (bend < least[k]) {
            least[k] = bend;
            places->of[k].before = (int32_t)at.from;
            places->of[k].behind = (int32_t)at.to;
        }
    }
}

size_t vg_fit_places_size(const verge_road_def* def)
{
    const size_t n = def->lane_count;
    return n * (sizeof(vg_fit_place) + 2 * sizeof(int32_t) + 2 * sizeof(double) + 3 * sizeof(bool))
           + sizeof(links) + 7 * VG_ARENA_ALIGN;
}

bool vg_fit_places_find(vg_fit_places* places, vg_arena* scratch, const verge_road_def* def,
                        const vg_fit_chains* chains)
{
    const uint32_t n = def->lane_count;
    links* self = vg_arena_take(scratch, sizeof *self);
    bool* inner = vg_arena_take(scratch, n * sizeof *inner);
    bool* used = vg_arena_take(scratch, 2 * n * sizeof *used);
    double* lengths = vg_arena_take(scratch, n * sizeof *lengths);
    double* least = vg_arena_take(scratch, n * sizeof *least);
    places->of_ends = vg_arena_take(scratch, 2 * n * sizeof *places->of_ends);
    places->of = vg_arena_take(scratch, n * sizeof *places->of);
    if (scratch->failed) {
        return false;
    }
    graph_from(&self->all, def);
    self->inner = inner;
    self->lengths = lengths;
    for (uint32_t i = 0; i < chains->count; ++i) {
        for (uint32_t k = 0; k < chains->of[i].lane_count; ++k) {
            inner[chains->lanes[chains->of[i].first + k]] = k > 0;
        }
    }
    for (uint32_t i = 0; i < n; ++i) {
        lengths[i] = vg_survey_length(&def->lanes[i]);
    }
    join_ends(places->of_ends, self);
    places->count = number_sets(places->of_ends, used, 2 * n);
    VERGE_ASSERT(places->count <= n);
    find_leaders(places, self);
    choose_pairs(places, self, least);
    return true;
}
