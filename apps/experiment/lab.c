/// See lab.h.
#include "lab.h"

#include "common/input.h"
#include "common/number.h"
#include "common/output.h"
#include "must.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

/// The trials of a run, taken by the threads one after the other.
typedef struct queue {
    pthread_mutex_t lock;
    const lab*      self;
    const trial*    tasks;
    outcome*        results;
    uint32_t        count, next;
    bool            failed;
} queue;

static volatile sig_atomic_t interrupted;

static void* work(void* queue_given);
static bool  take(queue* from, uint32_t* index);
static void  on_signal(int signal_number);

lab_document* lab_open(const lab* self, const char* name)
{
    char path[4096];
    if (strchr(name, '/') != NULL) {
        snprintf(path, sizeof path, "%s", name);
    } else {
        snprintf(path, sizeof path, "%s/%s.json", self->scenarios, name);
    }
    char* text = lab_read(path);
    if (text == NULL) {
        fprintf(stderr, "%s:file: cannot be read (%s)\n", path, strerror(errno));
        return NULL;
    }
    lab_document* document = cJSON_Parse(text);
    free(text);
    if (document == NULL) {
        fprintf(stderr, "%s:file: is not JSON\n", path);
    }
    return document;
}

static cJSON* member(lab_document* document, const char* key)
{
    cJSON* found = cJSON_GetObjectItemCaseSensitive(document, key);
    return found != NULL ? found : must(cJSON_AddObjectToObject(document, key));
}

void lab_set(cJSON* object, const char* key, cJSON* value)
{
    cJSON_DeleteItemFromObjectCaseSensitive(object, key);
    cJSON_AddItemToObject(object, key, must(value));
}

void lab_parameter(lab_document* document, const char* name, double value)
{
    lab_set(member(document, "planner"), name, cJSON_CreateNumber(value));
}

void lab_duration(lab_document* document, double duration)
{
    lab_set(member(document, "simulation"), "duration", cJSON_CreateNumber(duration));
}

cJSON* lab_vehicle(lab_document* document, int32_t id)
{
    cJSON* vehicle;
    cJSON_ArrayForEach(vehicle, cJSON_GetObjectItemCaseSensitive(document, "vehicles")) {
        const cJSON* own = cJSON_GetObjectItemCaseSensitive(vehicle, "id");
        if (own != NULL && own->valueint == id) {
            return vehicle;
        }
    }
    return NULL;
}

const char* lab_text(lab* self, lab_document* document)
{
    if (self->text_count == self->text_capacity) {
        self->text_capacity = 2 * self->text_capacity + 64;
        self->texts = must_realloc(self->texts, self->text_capacity * sizeof *self->texts);
    }
    char* text = must(value_text(document));
    cJSON_Delete(document);
    self->texts[self->text_count++] = text;
    return text;
}

void lab_clear(lab* self)
{
    for (uint32_t i = 0; i < self->text_count; ++i) {
        free(self->texts[i]);
    }
    free(self->texts);
    self->texts = NULL;
    self->text_count = self->text_capacity = 0;
}

bool lab_run(const lab* self, const trial* tasks, outcome* results, uint32_t count)
{
    queue from = { .lock = PTHREAD_MUTEX_INITIALIZER, .self = self, .tasks = tasks,
                   .results = results, .count = count };
    pthread_t  threads[LAB_THREADS_MAX];
    const long processors = sysconf(_SC_NPROCESSORS_ONLN);
    const uint32_t wanted = processors < 1 ? 1
                            : processors < LAB_THREADS_MAX ? (uint32_t)processors
                                                           : LAB_THREADS_MAX;
    uint32_t started = 0;
    memset(results, 0, count * sizeof *results);
    while (started + 1 < wanted && pthread_create(&threads[started], NULL, work, &from) == 0) {
        ++started;
    }
    work(&from); // this thread, too: there is always one
    for (uint32_t i = 0; i < started; ++i) {
        pthread_join(threads[i], NULL);
    }
    pthread_mutex_destroy(&from.lock);
    if (self->progress) {
        fputs("\r\033[K", stderr);
    }
    bool good = !from.failed && !lab_interrupted();
    for (uint32_t i = 0; i < count && from.failed; ++i) {
        if (results[i].error[0] != '\0') {
            const char* line_end = strchr(results[i].error, '\n') != NULL ? "" : "\n";
            fprintf(stderr, "%s%s", results[i].error, line_end);
            break;
        }
    }
    if (!good) {
        lab_free_results(results, count);
    }
    return good;
}

void lab_free_results(outcome* results, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) {
        outcome_free(&results[i]);
    }
}

char* lab_read(const char* path)
{
    const char* reason = NULL;
    FILE* in = input_open(path, &reason);
    char* text = NULL;
    if (in == NULL) {
        return NULL;
    }
    size_t size = 0, capacity = 0;
    for (;;) {
        if (size == capacity) {
            capacity = 2 * capacity + 65536;
            text = must_realloc(text, capacity);
        }
        const size_t got = fread(text + size, 1, capacity - size, in);
        size += got;
        if (got == 0) {
            break;
        }
    }
    const bool failed = ferror(in) != 0;
    fclose(in);
    if (failed) {
        free(text);
        return NULL;
    }
    text[size] = '\0';
    return text;
}

bool lab_write(const lab* self, const char* name, const char* text, size_t size)
{
    static output file; // large
    char          path[4096];
    snprintf(path, sizeof path, "%s/%s", self->out, name);
    bool good = output_open(&file, path);
    good = good && fwrite(text, 1, size, file.stream) == size;
    good = good && output_close(&file);
    if (!good) {
        fprintf(stderr, "%s:file: cannot be written (%s)\n", path, strerror(errno));
        output_abandon(&file);
    }
    return good;
}

void lab_catch_signals(void)
{
    struct sigaction action = { .sa_handler = on_signal, .sa_flags = SA_RESTART };
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool lab_interrupted(void)
{
    return interrupted != 0;
}

static void on_signal(int signal_number)
{
    (void)signal_number;
    interrupted = 1;
}

static void* work(void* queue_given)
{
    queue*   from = queue_given;
    uint32_t index;
    while (take(from, &index)) {
        trial_run(&from->tasks[index], &from->results[index]);
        if (!from->results[index].done) {
            pthread_mutex_lock(&from->lock);
            from->failed = true;
            pthread_mutex_unlock(&from->lock);
        }
    }
    return NULL;
}

static bool take(queue* from, uint32_t* index)
{
    pthread_mutex_lock(&from->lock);
    const bool any = from->next < from->count && !from->failed && !lab_interrupted();
    if (any) {
        *index = from->next++;
    }
    if (any && from->self->progress) {
        fprintf(stderr, "\r%s %u of %u\033[K", from->self->experiment, *index + 1, from->count);
    }
    pthread_mutex_unlock(&from->lock);
    return any;
}
