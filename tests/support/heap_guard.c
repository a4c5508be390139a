/// Counts heap calls of a running program: proof of "after READY nothing allocates".
///
///     HEAP_GUARD_FILE=count.txt LD_PRELOAD=libheap_guard.so verge-rsu --config rsu.json &
///     kill -USR2 $!        # after READY: counting starts from zero
///     ...                  # let it work
///     kill -USR2 $!        # counting stops; count.txt now holds one line
///
/// The line is "allocations N frees N bytes N". It is also written when the program ends while
/// counting. A program that knows of the guard may call heap_guard_arm() and heap_guard_disarm()
/// through weak symbols instead of being signalled.
///
/// Method: the heap functions of the C library are replaced and passed on to glibc's own names
/// for them (no dlsym, which allocates). Threads are counted together, unless HEAP_GUARD_THREAD
/// names those to count: where middleware allocates in threads of its own, our own must not.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);
void  __libc_free(void* memory);

void heap_guard_arm(void);
void heap_guard_disarm(void);

static atomic_bool          armed;
static atomic_uint_fast64_t allocations, frees, bytes;

static const char* thread_name; // null: every thread counts

static bool counts_here(void)
{
    if (!atomic_load(&armed)) {
        return false;
    }
    char name[16] = "";
    return thread_name == NULL || (prctl(PR_GET_NAME, name) == 0 && strcmp(name, thread_name) == 0);
}

static void count(size_t size)
{
    if (counts_here()) {
        atomic_fetch_add(&allocations, 1);
        atomic_fetch_add(&bytes, size);
    }
}

void* malloc(size_t size)
{
    count(size);
    return __libc_malloc(size);
}

void* calloc(size_t number, size_t size)
{
    count(number * size);
    return __libc_calloc(number, size);
}

void* realloc(void* memory, size_t size)
{
    count(size);
    return __libc_realloc(memory, size);
}

void* memalign(size_t alignment, size_t size)
{
    count(size);
    return __libc_memalign(alignment, size);
}

void* aligned_alloc(size_t alignment, size_t size)
{
    return memalign(alignment, size);
}

int posix_memalign(void** memory, size_t alignment, size_t size)
{
    *memory = memalign(alignment, size);
    return *memory != NULL ? 0 : ENOMEM;
}

void free(void* memory)
{
    if (memory != NULL && counts_here()) {
        atomic_fetch_add(&frees, 1);
    }
    __libc_free(memory);
}

/// Appends a number in decimal; stdio would allocate and is not for signal handlers.
static char* put_number(char* end, uint64_t value)
{
    char     digits[20];
    unsigned length = 0;
    do {
        digits[length++] = (char)('0' + value % 10);
        value /= 10;
    } while (value > 0);
    while (length > 0) {
        *end++ = digits[--length];
    }
    return end;
}

static char* put_text(char* end, const char* text)
{
    const size_t length = strlen(text);
    memcpy(end, text, length);
    return end + length;
}

static void write_count(void)
{
    const char* path = getenv("HEAP_GUARD_FILE");
    if (path == NULL) {
        return;
    }
    char  line[128];
    char* end = put_text(line, "allocations ");
    end = put_number(end, atomic_load(&allocations));
    end = put_text(end, " frees ");
    end = put_number(end, atomic_load(&frees));
    end = put_text(end, " bytes ");
    end = put_number(end, atomic_load(&bytes));
    end = put_text(end, "\n");

    const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (file >= 0) {
        const ssize_t written = write(file, line, (size_t)(end - line));
        (void)written; // a reader that finds no line reports it
        close(file);
    }
}

void heap_guard_arm(void)
{
    atomic_store(&allocations, 0);
    atomic_store(&frees, 0);
    atomic_store(&bytes, 0);
    atomic_store(&armed, true);
}

void heap_guard_disarm(void)
{
    if (atomic_exchange(&armed, false)) {
        write_count();
    }
}

static void on_signal(int number)
{
    (void)number;
    const int saved = errno;
    if (atomic_load(&armed)) {
        heap_guard_disarm();
    } else {
        heap_guard_arm();
    }
    errno = saved;
}

__attribute__((constructor)) static void install(void)
{
    thread_name = getenv("HEAP_GUARD_THREAD");
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigaction(SIGUSR2, &action, NULL);
}

__attribute__((destructor)) static void report_at_exit(void)
{
    heap_guard_disarm();
}
