/// How a daemon ends when it cannot start or go on: its exit codes, those of sysexits.h, and the
/// size of the line that gives the reason.
#ifndef VERGE_DAEMON_EXIT_H
#define VERGE_DAEMON_EXIT_H

enum {
    EXIT_USAGE = 64,       ///< wrong options
    EXIT_NO_INPUT = 66,    ///< a named file cannot be read
    EXIT_UNAVAILABLE = 69, ///< no bus
    EXIT_SOFTWARE = 70,    ///< an internal error
    EXIT_OS = 71,          ///< the system refused memory, a thread or a descriptor
    EXIT_CONFIG = 78,      ///< the configuration is wrong
};

enum { CONFIG_ERROR_SIZE = 512 }; ///< [B] of a line that gives a reason, with its zero byte

#endif
