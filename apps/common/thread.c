/// See thread.h.
#define _GNU_SOURCE
#include "thread.h"

#include <sched.h>
#include <signal.h>
#include <stddef.h>

static int attributes_set(pthread_attr_t* attributes, const thread_options* options);

int thread_start(pthread_t* thread, const thread_options* options, void* (*run)(void*), void* arg)
{
    pthread_attr_t attributes;
    int refused = pthread_attr_init(&attributes);
    if (refused != 0) {
        return refused;
    }
    refused = attributes_set(&attributes, options);
    if (refused == 0) {
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &before);
        refused = pthread_create(thread, &attributes, run, arg);
        pthread_sigmask(SIG_SETMASK, &before, NULL);
    }
    pthread_attr_destroy(&attributes);
    return refused;
}

static cpu_set_t cpu_set_of(const thread_options* options)
{
    cpu_set_t set;
    CPU_ZERO(&set);
    for (uint32_t i = 0; i < options->cpu_count; ++i) {
        CPU_SET(options->cpus[i], &set);
    }
    return set;
}

int thread_become(const thread_options* options)
{
    int refused = 0;
    if (options->priority > 0) {
        const struct sched_param parameter = { .sched_priority = options->priority };
        refused = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
    }
    if (refused == 0 && options->cpu_count > 0) {
        const cpu_set_t set = cpu_set_of(options);
        refused = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
    }
    return refused;
}

static int attributes_set(pthread_attr_t* attributes, const thread_options* options)
{
    int refused = pthread_attr_setstacksize(attributes, THREAD_STACK_SIZE);
    if (refused == 0 && options != NULL && options->priority > 0) {
        const struct sched_param parameter = { .sched_priority = options->priority };
        pthread_attr_setinheritsched(attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(attributes, SCHED_FIFO);
        refused = pthread_attr_setschedparam(attributes, &parameter);
    }
    if (refused == 0 && options != NULL && options->cpu_count > 0) {
        const cpu_set_t set = cpu_set_of(options);
        refused = pthread_attr_setaffinity_np(attributes, sizeof set, &set);
    }
    return refused;
}
