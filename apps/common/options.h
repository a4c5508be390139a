/// The command line: one table of options, one positional argument, --help and --version.
///
///     const char* out = NULL;
///     bool quiet = false;
///     const option_entry table[] = {
///         { "--out", "FILE", "writes the run to FILE", &out, NULL },
///         { "--quiet", NULL, "prints nothing", NULL, &quiet },
///     };
///     const program self = { "verge-x", "SCENARIO.json", "does x.", table, 2, 2 };
///     const char* path;
///     int status;
///     if (!options_parse(&self, argc, argv, &path, &status)) { return status; }
///
/// A value may follow as the next argument or after "=". "--" ends the options.
#ifndef VERGE_APPS_OPTIONS_H
#define VERGE_APPS_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct option_entry {
    const char*  name;       ///< with its dashes
    const char*  value_name; ///< null: takes no value
    const char*  text;       ///< one line for --help
    const char** value;      ///< set where value_name is given
    bool*        flag;       ///< set to true otherwise
} option_entry;

typedef struct program {
    const char*         name;
    const char*         argument;     ///< name of the positional argument; null: none
    const char*         text;         ///< what the program does, for --help
    const option_entry* options;
    uint32_t            option_count;
    int                 usage_status; ///< exit status of a wrong command line
} program;

/// True: continue. False: return *status from main; help or version was printed, or one line on
/// standard error names the fault. argument may be null for a program without one.
bool options_parse(const program* self, int argc, char** argv, const char** argument, int* status);

/// The value of an option as a number. text null: absent, *value stays and *given is false.
/// False: one line was printed. given may be null.
bool options_u64(const program* self, const char* name, const char* text, uint64_t* value,
                 bool* given);

/// The number of an option, from min to max. text null: *value keeps its default. False: it is not
/// one; one line on standard error.
bool options_number(const program* self, const char* name, const char* text, double min, double max,
                    double* value);

#endif
