/// What the loop of a daemon waits for besides its buses: signals and timers, as descriptors to
/// poll, and the two clocks that it reads.
///
/// Memory      None.
/// Threads     The main one. Every function returns at once.
#ifndef VERGE_DAEMON_EVENTS_H
#define VERGE_DAEMON_EVENTS_H

#include <stdint.h>
#include <time.h>

/// One moment by both clocks.
typedef struct instant {
    int64_t now;   ///< [us] CLOCK_MONOTONIC
    int64_t utime; ///< [us] CLOCK_REALTIME
} instant;

int64_t clock_us(clockid_t clock);
instant instant_now(void);

/// Blocks SIGTERM, SIGINT, SIGHUP and SIGUSR1, which the loop handles, and ignores those of pipes
/// and size limits, so that writing fails instead. Before the first thread: threads inherit it.
void signals_block(void);
/// A descriptor for the blocked signals; -1: the system refuses one.
int  signals_open(void);
/// The next signal that has come; 0: none waits.
int  signals_next(int signal_fd);

/// A timer that is not armed; -1: the system refuses a descriptor.
int      timer_open(void);
/// The first time after one period from now.
void     timer_arm(int timer_fd, uint32_t period_ms);
/// The periods that have ended since the last call.
uint64_t timer_expirations(int timer_fd);

#endif
