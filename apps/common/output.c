/// See output.h.
#include "output.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void remove_partial(int signal_number);

/// The file that a signal has to remove; "": none.
static char guarded[sizeof((output*)0)->partial];

bool output_open(output* out, const char* path)
{
    struct stat existing;
    *out = (output){ 0 };
    if (strlen(path) >= sizeof out->path) {
        errno = ENAMETOOLONG;
        return false;
    }
    if (path[0] == '\0') {
        errno = ENOENT;
        return false;
    }
    strcpy(out->path, path);
    if (stat(path, &existing) == 0 && S_ISDIR(existing.st_mode)) {
        errno = EISDIR;
        return false;
    }
    if (stat(path, &existing) != 0 || S_ISREG(existing.st_mode)) {
        snprintf(out->partial, sizeof out->partial, "%s.partial.%ld", path, (long)getpid());
    }
    out->stream = fopen(out->partial[0] != '\0' ? out->partial : path, "w");
    if (out->stream != NULL) {
        strcpy(guarded, out->partial);
    }
    return out->stream != NULL;
}

bool output_close(output* out)
{
    const bool written = fflush(out->stream) == 0 && !ferror(out->stream);
    int        trouble = errno;
    const bool closed = fclose(out->stream) == 0;
    out->stream = NULL;
    bool good = written && closed;
    if (written && !closed) {
        trouble = errno;
    }
    if (good && out->partial[0] != '\0') {
        good = rename(out->partial, out->path) == 0;
        trouble = errno;
    }
    if (!good && out->partial[0] != '\0') {
        unlink(out->partial);
    }
    guarded[0] = '\0';
    errno = trouble;
    return good;
}

void output_abandon(output* out)
{
    if (out->stream == NULL) {
        return;
    }
    fclose(out->stream);
    if (out->partial[0] != '\0') {
        unlink(out->partial);
    }
    out->stream = NULL;
    guarded[0] = '\0';
}

void output_report(const char* path)
{
    fprintf(stderr, "%s:file: cannot be written (%s), expected a file with free space\n", path,
            strerror(errno));
}

bool output_flush(const char* program)
{
    const bool written = fflush(stdout) == 0 && !ferror(stdout);
    if (!written) {
        fprintf(stderr, "%s:standard output: cannot be written (%s), expected an open stream with"
                        " free space\n", program, strerror(errno));
    }
    return written;
}

void output_guard_signals(void)
{
    const int signals[] = { SIGINT, SIGTERM, SIGHUP };
    struct sigaction action = { .sa_handler = remove_partial, .sa_flags = (int)SA_RESETHAND };
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof signals / sizeof signals[0]; ++i) {
        sigaction(signals[i], &action, NULL);
    }
}

static void remove_partial(int signal_number)
{
    if (guarded[0] != '\0') {
        unlink(guarded);
    }
    raise(signal_number); // the default action is back: the program ends by this signal
}
