/// See peers.h.
#include "peers.h"

#include "status.h"

#include "verge/wire.h"

#include <string.h>

static int64_t limit_us(const peer* peer)
{
    return peer->gap_us / 2 * 5;
}

static bool same_id(const peers* self, const peer* peer)
{
    return peer->rsu_id == self->def.rsu_id;
}

void peers_init(peers* self, const peers_def* def)
{
    memset(self, 0, sizeof *self);
    self->def = *def;
}

void peers_set(peers* self, const peers_def* def)
{
    self->def = *def;
}

bool peers_leads(const peers* self, const peer* peer)
{
    return same_id(self, peer) ? peer->start_utime < self->def.start_utime
                               : !self->def.never && peer->rsu_id < self->def.rsu_id;
}

bool peers_audible(const peer* peer, int64_t now)
{
    return peer->audible && now - peer->heard < limit_us(peer);
}

bool peers_any(const peers* self, int64_t now)
{
    bool any = false;
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        any = any || peers_audible(&self->peer[i], now);
    }
    return any;
}

const peer* peers_silent(peers* self, int64_t now)
{
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        peer* peer = &self->peer[i];
        if (peer->audible && !peers_audible(peer, now)) {
            peer->audible = false;
            return peer;
        }
    }
    return NULL;
}

// ---- receiving ----------------------------------------------------------------------------

static const peer* offer_status(peers* self, const verge_rsu_status_t* status, int64_t now);
static const peer* offer_plan(peers* self, const verge_vehicle_plan_t* plan, int64_t now);

const peer* peers_offer(peers* self, const transport_message* message, int64_t now)
{
    switch (message->kind) {
    case TRANSPORT_STATUS: return offer_status(self, &message->as.status, now);
    case TRANSPORT_PLAN: return offer_plan(self, &message->as.plan, now);
    default: return NULL;
    }
}

/// The record of a unit; null: none. start_utime counts only for units with this unit's id.
static peer* find_peer(peers* self, int32_t rsu_id, int64_t start_utime)
{
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        peer* peer = &self->peer[i];
        if (peer->start_utime != 0 && peer->rsu_id == rsu_id &&
            (!same_id(self, peer) || peer->start_utime == start_utime)) {
            return peer;
        }
    }
    return NULL;
}

/// A free record, or that of the unit that was not heard for the longest time.
static peer* take_peer(peers* self)
{
    uint32_t oldest = 0;
    for (uint32_t i = 1; i < PEERS_MAX; i++) {
        oldest = self->peer[i].heard < self->peer[oldest].heard ? i : oldest;
    }
    for (uint32_t i = 0; i < PEERS_VEHICLES_MAX; i++) {
        peers_vehicle* vehicle = &self->vehicle[i];
        vehicle->claims = vehicle->by == oldest ? 0 : vehicle->claims;
    }
    peer* peer = &self->peer[oldest];
    memset(peer, 0, sizeof *peer);
    return peer;
}

/// A message of a cycle. True: the unit was silent before.
static bool hear(const peers* self, peer* peer, int32_t cycle, int64_t utime, int64_t now)
{
    const int64_t period = self->def.period_us;
    const bool    was_silent = !peers_audible(peer, now);
    if (was_silent) {
        peer->audible = true;
        peer->shares = false;
        peer->cycles = 0;
        peer->gap_us = period > PEERS_STATUS_US ? period : PEERS_STATUS_US;
    }
    if (was_silent || cycle != peer->cycle) {
        if (!was_silent) {
            const int64_t gap = (int64_t)((uint64_t)utime - (uint64_t)peer->utime);
            peer->gap_us = gap < period           ? period
                           : gap > PEERS_GAP_MAX_US ? PEERS_GAP_MAX_US
                                                    : gap;
        }
        peer->cycles++;
        peer->cycle = cycle;
        peer->utime = utime;
    }
    peer->heard = now;
    return was_silent;
}

static const peer* offer_status(peers* self, const verge_rsu_status_t* status, int64_t now)
{
    if (status->start_utime == self->def.start_utime || status->start_utime <= 0 ||
        status->rsu_id < 0) {
        return NULL; // this unit's own, or that of no unit
    }
    peer* peer = find_peer(self, status->rsu_id, status->start_utime);
    if (status->state == RSU_STOPPING) {
        if (peer != NULL) {
            peer->heard = INT64_MIN / 2; // silent at once
        }
        return NULL;
    }
    peer = peer != NULL ? peer : take_peer(self);
    peer->rsu_id = status->rsu_id;
    peer->start_utime = status->start_utime;
    peer->map_crc32 = (uint32_t)status->map_crc32;
    return hear(self, peer, status->cycle, status->utime, now) ? peer : NULL;
}

/// Does the other unit plan this vehicle, which must be in use, at present?
static bool claimed(const peers* self, const peers_vehicle* vehicle, int64_t now)
{
    const peer* by = &self->peer[vehicle->by];
    return vehicle->claims > 0 && peers_audible(by, now) &&
           now - vehicle->claimed < limit_us(by);
}

/// Did this unit plan the vehicle in one of its last cycles?
static bool planned(const peers* self, const peers_vehicle* vehicle, int64_t now)
{
    return vehicle->planned > 0 && now - vehicle->planned < self->def.period_us * 3;
}

/// The record of a vehicle; a new one takes the place of that which was not planned for the longest
/// time.
static peers_vehicle* vehicle_of(peers* self, int32_t id)
{
    peers_vehicle* oldest = &self->vehicle[0];
    for (uint32_t i = 0; i < PEERS_VEHICLES_MAX; i++) {
        peers_vehicle* one = &self->vehicle[i];
        if (one->used && one->id == id) {
            return one;
        }
        const int64_t last = one->planned > one->claimed ? one->planned : one->claimed;
        const int64_t least = oldest->planned > oldest->claimed ? oldest->planned
                                                                : oldest->claimed;
        oldest = !one->used || (oldest->used && last < least) ? one : oldest;
    }
    *oldest = (peers_vehicle){ .id = id, .used = true };
    return oldest;
}

/// Of several units, the claim of the lowest rsu_id counts.
static void claim(peers* self, peers_vehicle* vehicle, uint32_t by, int32_t cycle, int64_t now)
{
    const bool holds = claimed(self, vehicle, now);
    if (holds && self->peer[vehicle->by].rsu_id < self->peer[by].rsu_id) {
        return;
    }
    const bool goes_on = holds && vehicle->by == by;
    if (!goes_on || vehicle->claim_cycle != cycle) {
        vehicle->claims = goes_on ? vehicle->claims + 1 : 1;
    }
    vehicle->by = by;
    vehicle->claim_cycle = cycle;
    vehicle->claimed = now;
}

static const peer* offer_plan(peers* self, const verge_vehicle_plan_t* plan, int64_t now)
{
    peer* peer = find_peer(self, plan->rsu_id, 0); // none that has this unit's id
    if (peer == NULL || !peers_audible(peer, now) || wire_plan_check(plan) != NULL) {
        return NULL;
    }
    hear(self, peer, plan->cycle, plan->utime, now);
    peers_vehicle* vehicle = vehicle_of(self, plan->vehicle_id);
    const uint32_t index = (uint32_t)(peer - self->peer);
    if (plan->status == VERGE_CANCELLED) {
        vehicle->claims = vehicle->by == index ? 0 : vehicle->claims;
        return NULL;
    }
    claim(self, vehicle, index, plan->cycle, now);
    if (peer->shares || !planned(self, vehicle, now)) {
        return NULL;
    }
    peer->shares = true;
    peer->vehicle_id = plan->vehicle_id;
    return peer;
}

// ---- sending ------------------------------------------------------------------------------

void peers_begin(peers* self, int64_t now)
{
    self->sent = self->withheld = 0;
    self->led = false;
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        const peer* peer = &self->peer[i];
        if (peers_audible(peer, now) && same_id(self, peer) && peers_leads(self, peer) &&
            (peer->cycles >= PEERS_RETURN_CYCLES || !self->sends)) {
            self->led = true;
            self->leader = peer;
        }
    }
    self->sends = !self->led;
}

/// A unit that leads plans this vehicle.
static bool led_by_plan(peers* self, const peers_vehicle* vehicle, int64_t now)
{
    const peer* by = &self->peer[vehicle->by];
    return claimed(self, vehicle, now) && !same_id(self, by) && peers_leads(self, by) &&
           (vehicle->claims >= PEERS_RETURN_CYCLES || !vehicle->sent);
}

/// A unit with another id that leads on the same road; null: none.
static const peer* road_leader(const peers* self, int64_t now)
{
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        const peer* peer = &self->peer[i];
        if (peers_audible(peer, now) && !same_id(self, peer) && peers_leads(self, peer) &&
            peer->map_crc32 == self->def.map_crc32) {
            return peer;
        }
    }
    return NULL;
}

/// The unit that will plan a new vehicle, unless it is silent about it; null: none.
static const peer* awaited(const peers* self, const peers_vehicle* vehicle, int64_t now)
{
    const peer* leader = !vehicle->sent ? road_leader(self, now) : NULL;
    return leader != NULL && now - vehicle->since < limit_us(leader) ? leader : NULL;
}

bool peers_sends(peers* self, int32_t vehicle_id, int64_t now)
{
    peers_vehicle* vehicle = vehicle_of(self, vehicle_id);
    if (!planned(self, vehicle, now)) {
        vehicle->since = now;
    }
    vehicle->planned = now;
    const bool  led = led_by_plan(self, vehicle, now);
    const peer* leader = led ? &self->peer[vehicle->by] : awaited(self, vehicle, now);
    self->leader = leader != NULL ? leader : self->leader;
    vehicle->sent = !self->led && leader == NULL;
    self->sent += vehicle->sent ? 1 : 0;
    self->withheld += vehicle->sent ? 0 : 1;
    return vehicle->sent;
}

bool peers_cancels(peers* self, int32_t vehicle_id, int64_t now)
{
    peers_vehicle* vehicle = vehicle_of(self, vehicle_id);
    const bool     sent = vehicle->sent;
    vehicle->sent = false;
    vehicle->planned = 0;
    return sent && !self->led && !claimed(self, vehicle, now);
}

// ---- what operators are told --------------------------------------------------------------

const peer* peers_leader(const peers* self, int64_t now)
{
    if (self->led || self->sent + self->withheld > 0) {
        return self->sent == 0 && peers_audible(self->leader, now) ? self->leader : NULL;
    }
    return road_leader(self, now);
}

bool peers_fault(const peers* self, int64_t now)
{
    bool fault = peers_leader(self, now) != NULL;
    for (uint32_t i = 0; i < PEERS_MAX; i++) {
        const peer* peer = &self->peer[i];
        fault = fault || (peers_audible(peer, now) && same_id(self, peer));
    }
    for (uint32_t i = 0; i < PEERS_VEHICLES_MAX; i++) {
        const peers_vehicle* vehicle = &self->vehicle[i];
        fault = fault || (vehicle->sent && planned(self, vehicle, now) &&
                          vehicle->claims >= PEERS_RETURN_CYCLES && claimed(self, vehicle, now));
    }
    return fault;
}
