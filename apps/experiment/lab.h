/// Common parts of the experiments: the settings of the run, scenario documents to modify, and
/// parallel trials.
///
///     lab_document* road = lab_open(self, "freeway-4av");
///     lab_parameter(road, "steps", 10);
///     const char* text = lab_text(self, road);          // valid until the experiment ends
///     trial tasks[2] = { { .text = text, .seed = 1 }, { .text = text, .seed = 2 } };
///     outcome results[2];
///     if (!lab_run(self, tasks, results, 2)) { return false; }
///
/// Parallel   One thread for each processor, at most LAB_THREADS_MAX. Trials are independent and
///            results are in the order of the tasks, so they do not depend on the threads.
/// Interrupt  After SIGINT or SIGTERM lab_run() returns false after the current trial of each
///            thread.
#ifndef VERGE_EXPERIMENT_LAB_H
#define VERGE_EXPERIMENT_LAB_H

#include "table.h"
#include "trial.h"

#include <cjson/cJSON.h>

enum { LAB_THREADS_MAX = 8 };

typedef struct lab {
    const char* experiment;  ///< running now
    const char* scenarios;   ///< folder of the scenario files
    const char* recordings;  ///< folder of recorded traffic
    const char* out;         ///< folder results go to
    uint32_t    repeats;     ///< of every setting
    uint64_t    seed;        ///< of the first repeat; the next ones count on from it
    bool        progress;    ///< says on standard error how far it is
    bool        scenes;      ///< writes generated scenarios to the folder of results
    char**      texts;       ///< see lab_text()
    uint32_t    text_count, text_capacity;
    FILE*       notes;       ///< Markdown that follows the experiment's table
} lab;

typedef cJSON lab_document;

/// A scenario by its name in the scenarios folder, or by its path. Null: a line was printed.
lab_document* lab_open(const lab* self, const char* name);
/// Sets a planner parameter.
void lab_parameter(lab_document* document, const char* name, double value);
/// Sets the duration of the run [s].
void lab_duration(lab_document* document, double duration);
/// The vehicle with this id; null: none.
cJSON* lab_vehicle(lab_document* document, int32_t id);
/// Sets a member, or adds it.
void lab_set(cJSON* object, const char* key, cJSON* value);
/// The document's text; frees the document.
const char* lab_text(lab* self, lab_document* document);
/// Forgets all texts.
void lab_clear(lab* self);

/// Runs all tasks. False: interrupted, or a trial failed (a line was printed); results are freed.
bool lab_run(const lab* self, const trial* tasks, outcome* results, uint32_t count);
void lab_free_results(outcome* results, uint32_t count);

/// The text of a file, to be freed; null (errno): not readable.
char* lab_read(const char* path);
/// Writes text to the file OUT/name. False: a line was printed.
bool lab_write(const lab* self, const char* name, const char* text, size_t size);

/// SIGINT and SIGTERM end lab_run().
void lab_catch_signals(void);
bool lab_interrupted(void);

#endif
