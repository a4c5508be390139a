/// verge-experiment: runs the experiments of the paper and further ones by name. Each gives rows,
/// as a table on standard output, and as JSON, Markdown and run files in the folder of results.
///
/// The files of an experiment are written when it ends. After an interrupt those of finished
/// experiments are complete, and the interrupted one has none. Results do not depend on the number
/// of threads.
#include "common/data.h"
#include "common/number.h"
#include "common/options.h"
#include "common/output.h"
#include "experiments.h"
#include "must.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { repeats_max = 100000 };

typedef struct request {
    const char* only;
    const char* repeats_text;
    const char* seed_text;
    const char* json;
    const char* page;
    bool        list, no_progress;
    uint64_t    repeats; ///< 0: each experiment's own
} request;

static bool usage_check(const request* with, const lab* self);
static bool folder_make(const char* path);
static bool file_check(const char* path);
static int  run_all(const request* with, lab* self);
static bool run_one(const experiment* one, lab* self, table* rows);
static bool write_json(const char* path, const table* all, uint32_t count);
static bool write_page(const char* path, const lab* self);

int main(int argc, char** argv)
{
    request with = { 0 };
    char    scenarios[DATA_PATH_SIZE], recordings[DATA_PATH_SIZE];
    lab     self = { .scenarios = data_path(scenarios, "scenarios"),
                     .recordings = data_path(recordings, "recordings"),
                     .out = "out/experiments", .seed = 1 };
    const option_entry options[] = {
        { "--only", "NAME", "runs this experiment only", &with.only, NULL },
        { "--repeats", "N", "seeds or scenes of each setting (default: of each experiment)",
          &with.repeats_text, NULL },
        { "--seed", "N", "seed of the first repeat (default 1); each further repeat adds 1",
          &with.seed_text, NULL },
        { "--json", "FILE", "also writes the rows to this file", &with.json, NULL },
        { "--page", "FILE", "writes a page of all tables in the folder of results", &with.page,
          NULL },
        { "--out", "DIR", "folder of results (default out/experiments)", &self.out, NULL },
        { "--scenarios", "DIR", "takes the scenario files from DIR", &self.scenarios, NULL },
        { "--recordings", "DIR", "takes recorded traffic from DIR", &self.recordings, NULL },
        { "--scenes", NULL, "writes generated scenarios to the folder of results", NULL,
          &self.scenes },
        { "--list", NULL, "lists the names of the experiments", NULL, &with.list },
        { "--no-progress", NULL, "prints no progress", NULL, &with.no_progress },
    };
    const program this = {
        .name = "verge-experiment",
        .text = "Runs the experiments of the paper and prints their tables.",
        .options = options,
        .option_count = sizeof options / sizeof options[0],
        .usage_status = 2,
    };
    int status = 0;
    bool repeats_given = false;
    if (!options_parse(&this, argc, argv, NULL, &status)) {
        return status;
    }
    if (!options_u64(&this, "--repeats", with.repeats_text, &with.repeats, &repeats_given)
        || !options_u64(&this, "--seed", with.seed_text, &self.seed, NULL)) {
        return 2;
    }
    for (uint32_t i = 0; with.list && i < experiment_count; ++i) {
        printf("%-14s %s\n", experiments[i].name, experiments[i].text);
    }
    if (with.list) {
        return 0;
    }
    if (repeats_given && (with.repeats == 0 || with.repeats > repeats_max)) {
        fprintf(stderr, "verge-experiment:--repeats: is %s, expected 1 to %d\n", with.repeats_text,
                repeats_max);
        return 2;
    }
    if (!usage_check(&with, &self)) {
        return 2;
    }
    self.progress = !with.no_progress && isatty(STDERR_FILENO) != 0;
    lab_catch_signals();
    return run_all(&with, &self);
}

static bool usage_check(const request* with, const lab* self)
{
    bool known = with->only == NULL;
    for (uint32_t i = 0; !known && i < experiment_count; ++i) {
        known = strcmp(experiments[i].name, with->only) == 0;
    }
    if (!known) {
        fprintf(stderr, "verge-experiment:--only: there is no experiment \"%s\", expected",
                with->only);
        for (uint32_t i = 0; i < experiment_count; ++i) {
            fprintf(stderr, "%s %s", i > 0 ? "," : "", experiments[i].name);
        }
        fputc('\n', stderr);
        return false;
    }
    char probe[4096];
    snprintf(probe, sizeof probe, "%s/.probe", self->out);
    if (!folder_make(self->out) || !file_check(probe)) {
        fprintf(stderr, "%s:folder: cannot be written (%s), expected a folder for results\n",
                self->out, strerror(errno));
        return false;
    }
    const char* const files[] = { with->json, with->page };
    for (uint32_t i = 0; i < sizeof files / sizeof files[0]; ++i) {
        if (files[i] != NULL && !file_check(files[i])) {
            fprintf(stderr, "%s:file: cannot be written (%s)\n", files[i], strerror(errno));
            return false;
        }
    }
    return true;
}

/// Creates a folder and all folders above it. False (errno).
static bool folder_make(const char* path)
{
    char part[4096];
    if ((size_t)snprintf(part, sizeof part, "%s", path) >= sizeof part) {
        errno = ENAMETOOLONG;
        return false;
    }
    for (char* at = part + 1; part[0] != '\0' && *at != '\0'; ++at) {
        if (*at == '/') {
            *at = '\0';
            if (mkdir(part, 0777) != 0 && errno != EEXIST) {
                return false;
            }
            *at = '/';
        }
    }
    return mkdir(part, 0777) == 0 || errno == EEXIST;
}

/// True: a file can be written there. The test file is removed. False (errno).
static bool file_check(const char* path)
{
    static output file; // large
    const bool good = output_open(&file, path);
    const int  reason = errno;
    output_abandon(&file);
    errno = reason;
    return good;
}

static int run_all(const request* with, lab* self)
{
    table*   all = must_calloc(experiment_count, sizeof *all);
    uint32_t done = 0;
    bool     good = true;
    for (uint32_t i = 0; good && i < experiment_count; ++i) {
        const experiment* one = &experiments[i];
        if (with->only != NULL && strcmp(one->name, with->only) != 0) {
            continue;
        }
        self->repeats = with->repeats > 0 ? (uint32_t)with->repeats : one->repeats;
        good = run_one(one, self, &all[done]);
        done += good ? 1 : 0;
        good = good && (with->json == NULL || write_json(with->json, all, done));
    }
    good = good && (with->page == NULL || write_page(with->page, self));
    if (lab_interrupted()) {
        fprintf(stderr, "verge-experiment:interrupted: %u finished, results in %s\n", done,
                self->out);
    }
    for (uint32_t i = 0; i < experiment_count; ++i) {
        table_free(&all[i]);
    }
    free(all);
    return good ? 0 : 1;
}

/// Writes the rows to standard output and to the folder of results.
static bool run_one(const experiment* one, lab* self, table* rows)
{
    char   name[128];
    char*  text = NULL;
    char*  notes = NULL;
    size_t size = 0, notes_size = 0;
    *rows = (table){ .experiment = one->name };
    self->experiment = one->name;
    self->notes = must(open_memstream(&notes, &notes_size));
    bool good = one->run(self, rows);
    fclose(self->notes);
    self->notes = NULL;
    lab_clear(self);
    if (good) {
        FILE* out = must(open_memstream(&text, &size));
        table_write_json(out, rows);
        fclose(out);
        snprintf(name, sizeof name, "%s.json", one->name);
        good = lab_write(self, name, text, size);
        free(text);
        text = NULL;
    }
    if (good) {
        FILE* out = must(open_memstream(&text, &size));
        fprintf(out, "## %s\n\n%s Repeats: %u. Seed: %llu.\n", one->name, one->text, self->repeats,
                (unsigned long long)self->seed);
        table_write_markdown(out, rows);
        fputs(notes, out);
        fclose(out);
        snprintf(name, sizeof name, "%s.md", one->name);
        good = lab_write(self, name, text, size);
        good = good && printf("%s\n", text) >= 0 && fflush(stdout) == 0;
        free(text);
    }
    free(notes);
    return good;
}

/// Writes one experiment as an object, several as an array.
static bool write_json(const char* path, const table* all, uint32_t count)
{
    static output file; // large
    bool good = output_open(&file, path);
    if (good && count > 1) {
        fputs("{\"experiments\": [\n", file.stream);
    }
    for (uint32_t i = 0; good && i < count; ++i) {
        fputs(i > 0 ? "," : "", file.stream);
        table_write_json(file.stream, &all[i]);
    }
    if (good && count > 1) {
        fputs("]}\n", file.stream);
    }
    good = good && output_close(&file);
    if (!good) {
        fprintf(stderr, "%s:file: cannot be written (%s)\n", path, strerror(errno));
        output_abandon(&file);
    }
    return good;
}

static void write_picture(FILE* page, const char* name)
{
    fprintf(page, "![%s](figures/%s.png)\n", name, name);
}

/// Writes the Markdown of all experiments in the folder of results, with their commands.
static bool write_page(const char* path, const lab* self)
{
    static output file; // large
    bool good = output_open(&file, path);
    if (good) {
        fputs("# Results of verge-experiment\n\nMade by\n\n"
              "    build/bin/verge-experiment --out out/experiments --page"
              " apps/experiment/RESULTS.md\n"
              "    tools/experiment_plots.py out/experiments --no-runs --out"
              " apps/experiment/figures\n\n"
              "One experiment alone: `--only NAME`; its number of seeds: `--repeats N`, as each"
              " section states it. The second command draws the figures; without `--no-runs` it"
              " also draws the runs. The columns are explained in apps/common/metrics.h,"
              " apps/experiment/trial.h and summary.h. `worst` is the worst of all runs. A dash"
              " means \"not measured\" or, for a worst finish time, \"a vehicle did not finish\"."
              " `nodes` counts the nodes created until the returned plan was first found, `nodes"
              " total` all nodes. Settings, methods, and the choices where the paper is silent:"
              " freeway.c, decided.h, sequential.h.\n", file.stream);
    }
    for (uint32_t i = 0; good && i < experiment_count; ++i) {
        char name[4096];
        snprintf(name, sizeof name, "%s/%s.md", self->out, experiments[i].name);
        char* text = lab_read(name);
        if (text != NULL) {
            fprintf(file.stream, "\n%s\n", text);
            write_picture(file.stream, experiments[i].name);
            for (uint32_t k = 0; experiments[i].pictures[k] != NULL; ++k) {
                write_picture(file.stream, experiments[i].pictures[k]);
            }
        }
        free(text);
    }
    good = good && output_close(&file);
    if (!good) {
        fprintf(stderr, "%s:file: cannot be written (%s)\n", path, strerror(errno));
        output_abandon(&file);
    }
    return good;
}
