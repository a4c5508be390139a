/// See events.h.
#define _GNU_SOURCE
#include "events.h"

#include <signal.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

int64_t clock_us(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

instant instant_now(void)
{
    return (instant){ .now = clock_us(CLOCK_MONOTONIC), .utime = clock_us(CLOCK_REALTIME) };
}

/// The signals that the loop handles.
static sigset_t own_signals(void)
{
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGHUP);
    sigaddset(&signals, SIGUSR1);
    return signals;
}

void signals_block(void)
{
    const sigset_t signals = own_signals();
    sigprocmask(SIG_BLOCK, &signals, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); // a file at its size limit makes write() fail
}

int signals_open(void)
{
    const sigset_t signals = own_signals();
    return signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC);
}

int signals_next(int signal_fd)
{
    struct signalfd_siginfo info;
    const ssize_t size = read(signal_fd, &info, sizeof info);
    return size == (ssize_t)sizeof info ? (int)info.ssi_signo : 0;
}

int timer_open(void)
{
    return timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
}

void timer_arm(int timer_fd, uint32_t period_ms)
{
    struct itimerspec spec;
    memset(&spec, 0, sizeof spec);
    spec.it_interval.tv_sec = period_ms / 1000;
    spec.it_interval.tv_nsec = (long)(period_ms % 1000) * 1000000;
    spec.it_value = spec.it_interval;
    timerfd_settime(timer_fd, 0, &spec, NULL);
}

uint64_t timer_expirations(int timer_fd)
{
    uint64_t count = 0;
    return read(timer_fd, &count, sizeof count) == (ssize_t)sizeof count ? count : 0;
}
