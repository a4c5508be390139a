/// What a configuration needs to be in effect, and how the next one takes its place.
///
/// A reload is prepared in a thread of its own: the file is read and checked, the road is built, the
/// planner is allocated, new buses are opened. The main thread goes on with its cycles and swaps
/// the two between two cycles, which takes microseconds. Then the thread frees the old one. Until
/// the swap the old configuration is in effect, whatever goes wrong.
///
///     const uint64_t ticket = reloader_ask(&reloader);       // returns at once
///     poll(reloader_fd(&reloader));
///     reloader_collect(&reloader);                           // accepted or refused
///     if (reloader_next(&reloader) != NULL) reloader_install(&reloader);   // between two cycles
///
/// What is asked for while a reload is under way is remembered once, and begins when that is over.
///
/// Memory      Heap, until setup_free(): at the start and at each reload.
/// Threads     The main one calls. A setup with several planning threads owns the helpers.
#ifndef VERGE_RSU_RELOAD_H
#define VERGE_RSU_RELOAD_H

#include "buses.h"
#include "config.h"
#include "recorder.h"
#include "worker.h"

#include "common/executor.h"

/// A configuration and what was made for it.
typedef struct setup {
    config*        config;
    config_planner planner;
    executor*      pool;   ///< null with one thread
    buses          buses;  ///< in a next one of count 0: those in effect stay
    recorder*      record; ///< null: nothing is recorded; a recording holds one configuration
} setup;

/// Starts the helpers and builds the planner that self->config asks for. Returns 0, or an exit
/// code with a line in error; either way setup_free() is due.
int  setup_build(setup* self, char error[CONFIG_ERROR_SIZE]);
void setup_free(setup* self); ///< all zero is fine, and is what it leaves

typedef enum reload_phase {
    RELOAD_IDLE,
    RELOAD_PREPARING, ///< the thread makes `next`
    RELOAD_PREPARED,  ///< `next` waits for reloader_install()
    RELOAD_RETIRING,  ///< the thread frees `old`
} reload_phase;

typedef enum reload_result {
    RELOAD_PENDING,  ///< not over yet; of reloader_collect(): nothing new
    RELOAD_ACCEPTED, ///< in effect after reloader_install()
    RELOAD_REFUSED,  ///< the old one stays; the reason is in reloader.error
} reload_result;

typedef struct reloader_def {
    const char* path; ///< of the configuration; outlives the reloader
    setup*      now;  ///< in effect; the thread reads its configuration
    void      (*log)(void* context, const char* line); ///< of new buses
} reloader_def;

typedef struct reloader {
    reloader_def  def;
    worker*       worker;
    reload_phase  phase;
    bool          again;      ///< asked for while another reload was under way
    uint64_t      begun;      ///< preparations, each a ticket
    uint64_t      ended;
    reload_result result;     ///< of the last one that ended
    char          error[CONFIG_ERROR_SIZE]; ///< why it was refused
    setup         next, old;
    int           code;       // of the thread, while it prepares
    char          code_error[CONFIG_ERROR_SIZE];
} reloader;

/// False: the system refuses a thread or a descriptor: errno.
bool reloader_open(reloader* self, const reloader_def* def);
/// Waits for what is under way. All zero is fine.
void reloader_close(reloader* self);

/// Becomes readable when reloader_collect() is due.
int  reloader_fd(const reloader* self);
/// Has the file read from now on or, if a reload is under way, once more after it. The ticket of
/// that reading, for reloader_answer().
uint64_t reloader_ask(reloader* self);
/// What came of it, or of a later one.
reload_result reloader_answer(const reloader* self, uint64_t ticket);
/// Once for each reload: what came of it.
reload_result reloader_collect(reloader* self);

/// What waits to be installed; null: nothing.
const setup* reloader_next(const reloader* self);
/// Between two cycles, nobody using *def.now: the next one takes its place.
void reloader_install(reloader* self);

/// Is the thread at work? It ends in its own time, see live.c.
bool reloader_busy(const reloader* self);
/// Is everything over that was asked for?
bool reloader_settled(const reloader* self);

#endif
