/// What a daemon makes for its configuration: its planner, the buses, the recording.
///
/// Memory      Heap, until setup_free(): at the start and at each reload.
/// Threads     A setup with several planning threads owns the helpers.
#ifndef VERGE_DAEMON_SETUP_H
#define VERGE_DAEMON_SETUP_H

#include "daemon/buses.h"
#include "daemon/planning.h"
#include "daemon/recorder.h"
#include "daemon/site.h"

/// How a daemon makes its setups.
typedef struct setup_def {
    const char*     path;    ///< of the configuration; outlives the setups
    const site_def* site;    ///< the daemon's own keys
    unsigned        bus_use; ///< what is received and sent, see buses_open()
    void          (*log)(void* context, const char* line); ///< for complaints of the buses
    /// Makes what plans, instead of setup.planner; null: that is made. Returns 0, EXIT_CONFIG or
    /// EXIT_OS with a line in error, and *made for unmake(), which takes null, too.
    int           (*make)(void** made, const site* site, char error[CONFIG_ERROR_SIZE]);
    void          (*unmake)(void* made);
} setup_def;

typedef struct setup {
    site*     site;
    planning  planner; ///< all zero with setup_def.make
    void*     made;    ///< by setup_def.make
    void    (*unmake)(void* made);
    buses     buses;  ///< of a next setup: count 0 means that the present buses stay
    recorder* record; ///< null: no recording, which holds one configuration only
} setup;

/// Each fills in one part of a setup, in this order, and returns 0, or an exit code with a line in
/// error. setup_free() is due in each case.
int  setup_load(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE]);
int  setup_plan(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE]);
int  setup_connect(setup* self, const setup_def* def, char error[CONFIG_ERROR_SIZE]);
void setup_free(setup* self); ///< all zero is fine

/// All three for the setup after `now`. Its configuration may follow without a restart, or it is
/// refused; buses are opened only if they differ.
int  setup_prepare(setup* self, const setup_def* def, const setup* now,
                   char error[CONFIG_ERROR_SIZE]);
/// Replaces *now by *next, which is all zero afterwards. *old gets what has to be freed.
void setup_replace(setup* now, setup* next, setup* old);

#endif
