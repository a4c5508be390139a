/// How a new configuration replaces the one in effect.
///
/// Its own thread prepares a reload: it reads and checks the file, builds the road, allocates the
/// planner and opens new buses. The main thread continues its cycles and swaps the two
/// configurations between two cycles, which takes microseconds. Then the thread frees the old one.
/// Until the swap the old configuration is in effect, whatever goes wrong.
///
///     const uint64_t ticket = reloader_ask(&reloader);       // returns at once
///     poll(reloader_fd(&reloader));
///     reloader_collect(&reloader);                           // accepted or refused
///     if (reloader_next(&reloader) != NULL) reloader_install(&reloader);   // between two cycles
///
/// If a reload is asked for while another one is running, one more follows it.
///
/// Memory      That of the setups.
/// Threads     Only the main thread calls.
#ifndef VERGE_DAEMON_RELOAD_H
#define VERGE_DAEMON_RELOAD_H

#include "daemon/notify.h"
#include "daemon/setup.h"
#include "daemon/worker.h"

typedef enum reload_phase {
    RELOAD_IDLE,
    RELOAD_PREPARING, ///< the thread prepares `next`
    RELOAD_PREPARED,  ///< `next` waits for reloader_install()
    RELOAD_RETIRING,  ///< the thread frees `old`
} reload_phase;

typedef enum reload_result {
    RELOAD_PENDING,  ///< not over yet
    RELOAD_ACCEPTED, ///< takes effect with reloader_install()
    RELOAD_REFUSED,  ///< the old configuration stays; the reason is in reloader.error
} reload_result;

typedef struct reloader_def {
    setup_def setup; ///< how the next one is made
    setup*    now;   ///< in effect; the thread reads its configuration
} reloader_def;

typedef struct reloader {
    reloader_def  def;
    worker*       worker;
    reload_phase  phase;
    bool          again;      ///< one more reload was asked for
    uint64_t      begun;      ///< preparations; also the ticket of the last one
    uint64_t      ended;
    reload_result result;     ///< of the last one that has ended
    char          error[CONFIG_ERROR_SIZE]; ///< why it was refused
    setup         next, old;
    int           code;       ///< of the thread: result of the preparation
    char          code_error[CONFIG_ERROR_SIZE];
} reloader;

/// False: the system refuses a thread or a descriptor: errno.
bool reloader_open(reloader* self, const reloader_def* def);
/// Waits for the thread. All zero is fine.
void reloader_close(reloader* self);

/// A descriptor that becomes readable when reloader_collect() has to be called.
int  reloader_fd(const reloader* self);
/// Begins a reload, or asks for one more after the one that is running. Returns a ticket for
/// reloader_answer().
uint64_t reloader_ask(reloader* self);
/// The result of that reload, or of a later one.
reload_result reloader_answer(const reloader* self, uint64_t ticket);
/// The result of a reload, once when it is over; RELOAD_PENDING: no reload has just ended.
reload_result reloader_collect(reloader* self);

/// The setup that waits for reloader_install(); null: none.
const setup* reloader_next(const reloader* self);
/// Replaces *def.now, which nothing may be using, by the next setup.
void reloader_install(reloader* self);

/// Is the thread running a job?
bool reloader_busy(const reloader* self);
/// Is every reload over that was asked for?
bool reloader_settled(const reloader* self);

// ---- with the service manager, and in the log -----------------------------------------------

/// reloader_ask(), announced to the service manager.
uint64_t reloader_begin(reloader* self, const notify* notify);
/// For operators_def.reload: *ticket 0 begins a reload and sets its ticket. Returns its result so
/// far; *reason says why it was refused.
reload_result reloader_serve(reloader* self, const notify* notify, uint64_t* ticket,
                             const char** reason);
/// reloader_collect(): a refused configuration is logged, and the service manager told that the old
/// one goes on. True: one was refused just now.
bool reloader_over(reloader* self, const notify* notify);
/// After reloader_install(): logs the new configuration and tells the service manager.
void reloader_applied(const reloader* self, const notify* notify);

#endif
