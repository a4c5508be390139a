/// What a configuration needs to be in force, and how the next one takes its place: it is read,
/// compared with the one in force and built while that one works on; it is installed between two
/// cycles. Whatever goes wrong before, the one in force is as if nothing had been asked.
///
/// Memory      Heap, until setup_free(): at the start and at each reload.
/// Threads     One; a setup with several planning threads owns the helpers.
#ifndef VERGE_RSU_RELOAD_H
#define VERGE_RSU_RELOAD_H

#include "buses.h"
#include "config.h"

#include "common/executor.h"

/// A configuration and what was made for it.
typedef struct setup {
    config*        config;
    config_planner planner;
    executor*      pool;  ///< null with one thread
    buses          buses; ///< in a next one of count 0: those in force stay
} setup;

/// Starts the helpers and builds the planner that self->config asks for. Returns 0, or an exit
/// code with a line in error; either way setup_free() is due.
int  setup_build(setup* self, char error[CONFIG_ERROR_SIZE]);
void setup_free(setup* self); ///< all zero is fine, and is what it leaves

/// Reads the file at path and makes all that is needed to follow `now` with it. Buses are opened
/// only where they differ from those of `now`; log is theirs. Returns 0, or another code with a
/// line in error and *next all zero.
int  reload_prepare(setup* next, const setup* now, const char* path,
                    void (*log)(void* context, const char* line), char error[CONFIG_ERROR_SIZE]);
/// Between two cycles, nobody using `now`: next takes its place and is all zero after.
void reload_install(setup* now, setup* next);

#endif
