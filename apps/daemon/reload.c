/// See reload.h. The worker has one job at a time: it prepares `next`, or frees `old`. The main
/// thread does not touch the data of the job until the worker is collected.
#include "reload.h"

#include "common/floating.h"
#include "daemon/events.h"
#include "daemon/log.h"

#include <assert.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

// ---- the main thread ------------------------------------------------------------------------

static void begin(reloader* self);
static void prepare_job(void* arg);
static void retire_job(void* arg);

bool reloader_open(reloader* self, const reloader_def* def)
{
    memset(self, 0, sizeof *self);
    self->def = *def;
    self->worker = worker_create("verge-reload", NULL);
    return self->worker != NULL;
}

void reloader_close(reloader* self)
{
    worker_destroy(self->worker);
    setup_free(&self->next);
    setup_free(&self->old);
    memset(self, 0, sizeof *self);
}

int reloader_fd(const reloader* self)
{
    return worker_fd(self->worker);
}

uint64_t reloader_ask(reloader* self)
{
    if (self->phase == RELOAD_IDLE) {
        begin(self);
        return self->begun;
    }
    self->again = true;
    return self->begun + 1;
}

reload_result reloader_answer(const reloader* self, uint64_t ticket)
{
    return self->ended >= ticket ? self->result : RELOAD_PENDING;
}

static void begin(reloader* self)
{
    assert(self->phase == RELOAD_IDLE);
    self->again = false;
    self->begun++;
    self->phase = RELOAD_PREPARING;
    worker_start(self->worker, prepare_job, self);
}

reload_result reloader_collect(reloader* self)
{
    if (!worker_collect(self->worker)) {
        return RELOAD_PENDING;
    }
    reload_result result = RELOAD_PENDING;
    if (self->phase == RELOAD_PREPARING) {
        result = self->code == 0 ? RELOAD_ACCEPTED : RELOAD_REFUSED;
        self->result = result;
        self->ended++;
        memcpy(self->error, self->code_error, sizeof self->error);
    }
    self->phase = result == RELOAD_ACCEPTED ? RELOAD_PREPARED : RELOAD_IDLE;
    if (self->phase == RELOAD_IDLE && self->again) {
        begin(self);
    }
    return result;
}

const setup* reloader_next(const reloader* self)
{
    return self->phase == RELOAD_PREPARED ? &self->next : NULL;
}

void reloader_install(reloader* self)
{
    assert(self->phase == RELOAD_PREPARED);
    setup_replace(self->def.now, &self->next, &self->old);
    self->phase = RELOAD_RETIRING;
    worker_start(self->worker, retire_job, self);
}

bool reloader_busy(const reloader* self)
{
    return self->phase == RELOAD_PREPARING || self->phase == RELOAD_RETIRING;
}

bool reloader_settled(const reloader* self)
{
    return !self->again && (self->phase == RELOAD_IDLE || self->phase == RELOAD_RETIRING);
}

// ---- the reload's thread --------------------------------------------------------------------

static void prepare_job(void* arg)
{
    reloader* self = arg;
    floating_correct(); // before the first number is read
    self->code_error[0] = '\0';
    self->code = setup_prepare(&self->next, &self->def.setup, self->def.now, self->code_error);
    if (self->code != 0) {
        setup_free(&self->next);
    }
}

static void retire_job(void* arg)
{
    reloader* self = arg;
    setup_free(&self->old);
}

// ---- with the service manager, and in the log -----------------------------------------------

uint64_t reloader_begin(reloader* self, const notify* notify)
{
    char reloading[64];
    snprintf(reloading, sizeof reloading, "RELOADING=1\nMONOTONIC_USEC=%" PRId64,
             clock_us(CLOCK_MONOTONIC));
    notify_send(notify, reloading);
    return reloader_ask(self);
}

reload_result reloader_serve(reloader* self, const notify* notify, uint64_t* ticket,
                             const char** reason)
{
    *ticket = *ticket == 0 ? reloader_begin(self, notify) : *ticket;
    *reason = self->error;
    return reloader_answer(self, *ticket);
}

static void notify_settled(const reloader* self, const notify* notify)
{
    if (reloader_settled(self)) {
        notify_send(notify, "READY=1");
    }
}

bool reloader_over(reloader* self, const notify* notify)
{
    if (reloader_collect(self) != RELOAD_REFUSED) {
        return false;
    }
    log_event(LOG_ERROR, "config_refused", "kept=0x%08x reason=\"%s\"",
              self->def.now->site->config_crc32, log_words(self->error));
    notify_settled(self, notify);
    return true;
}

void reloader_applied(const reloader* self, const notify* notify)
{
    const site* site = self->def.now->site;
    log_event(LOG_INFO, "config_applied", "config_crc32=0x%08x map_crc32=0x%08x cycle_ms=%u",
              site->config_crc32, site->map_crc32, site->cycle_ms);
    notify_settled(self, notify);
}
