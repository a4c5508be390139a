/// verge-ctl: sends a request to the control socket of a running verge-rsu or verge-obu and prints
/// the answer, as tables or as JSON.
#define _GNU_SOURCE
#include "common/json.h"
#include "common/message_json.h"
#include "common/options.h"

#include "verge/verge.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#define SOCKET_DEFAULT "/run/verge/rsu.sock"

enum {
    EXIT_REFUSED = 1,      // the daemon refused the configuration
    EXIT_USAGE = 64,
    EXIT_UNAVAILABLE = 69, // no daemon answers
    ANSWER_MAX = 1 << 20,  // [B]
    FAULTS_MAX = 32,
    PATIENCE_S = 10,
    RELOAD_PATIENCE_S = 60, // a large road and a large planner take time
};

static int  ask(const char* path, const char* request, char* answer, size_t size);
static void print_json(const char* answer);
static void make_printable(char* text);
static void make_tree_printable(cJSON* node);
static int  show(const char* request, const json_at* root);

int main(int argc, char** argv)
{
    static char answer[ANSWER_MAX];
    const char* path = SOCKET_DEFAULT;
    const char* request = NULL;
    bool        json = false;
    const option_entry table[] = {
        { "--socket", "PATH", "control socket; default " SOCKET_DEFAULT, &path, NULL },
        { "--json", NULL, "prints the answer as one JSON document", NULL, &json },
    };
    const program self = {
        .name = "verge-ctl",
        .argument = "status|vehicles|plans|reload",
        .text = "Prints state, vehicles or plans of a running verge-rsu or verge-obu, or makes it\n"
                "read its configuration again.",
        .options = table,
        .option_count = sizeof table / sizeof table[0],
        .usage_status = EXIT_USAGE,
    };
    int status = 0;
    if (!options_parse(&self, argc, argv, &request, &status)) {
        return status;
    }
    if (strcmp(request, "status") != 0 && strcmp(request, "vehicles") != 0 &&
        strcmp(request, "plans") != 0 && strcmp(request, "reload") != 0) {
        fprintf(stderr, "verge-ctl:%.40s: unknown, expected status, vehicles, plans or reload\n",
                request);
        return EXIT_USAGE;
    }
    status = ask(path, request, answer, sizeof answer);
    if (status != 0) {
        return status;
    }
    json_file file;
    if (!json_file_parse(&file, path, answer, strlen(answer))) {
        make_printable(file.error);
        fprintf(stderr, "verge-ctl: no answer of a verge-rsu or verge-obu: %s", file.error);
        return EXIT_UNAVAILABLE;
    }
    const json_at root = json_root(&file);
    if (json) {
        print_json(answer);
    }
    make_tree_printable(file.document);
    status = json ? (strcmp(request, "reload") == 0 && !json_bool_or(&root, "accepted", false)
                         ? EXIT_REFUSED : 0)
                  : show(request, &root);
    json_file_free(&file);
    return fflush(stdout) == 0 ? status : EXIT_REFUSED;
}

static int unreachable(const char* path)
{
    const char* remedy =
        errno == EACCES ? "expected a user of the socket's group"
        : errno == EAGAIN ? "the daemon does not answer"
        : "expected a running verge-rsu or verge-obu whose configuration has this path as control";
    fprintf(stderr, "verge-ctl: %s: %s, %s\n", path, strerror(errno), remedy);
    return EXIT_UNAVAILABLE;
}

/// Sends the request and reads the whole answer.
static int ask(const char* path, const char* request, char* answer, size_t size)
{
    struct sockaddr_un address = { .sun_family = AF_UNIX };
    if (strlen(path) >= sizeof address.sun_path) {
        fprintf(stderr, "verge-ctl:--socket: is too long, expected at most %zu characters\n",
                sizeof address.sun_path - 1);
        return EXIT_USAGE;
    }
    strcpy(address.sun_path, path);
    const bool reload = strcmp(request, "reload") == 0;
    const struct timeval patience = { .tv_sec = reload ? RELOAD_PATIENCE_S : PATIENCE_S };
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    char line[32];
    const int length = snprintf(line, sizeof line, "%s\n", request);
    if (fd < 0 || connect(fd, (const struct sockaddr*)&address, sizeof address) != 0 ||
        send(fd, line, (size_t)length, MSG_NOSIGNAL) != length) {
        const int code = unreachable(path);
        close(fd);
        return code;
    }
    size_t  got = 0;
    ssize_t part = 0;
    while (got + 1 < size && (part = recv(fd, answer + got, size - 1 - got, 0)) > 0) {
        got += (size_t)part;
    }
    answer[got] = '\0';
    if (part == 0 && got == 0) {
        errno = ECONNRESET; // it has ended
    }
    const int code = part < 0 || got == 0 ? unreachable(path) : 0;
    close(fd);
    return code;
}

// ---- control characters -------------------------------------------------------------------

/// The size [B] and the code of a control character in UTF-8: U+0000 to U+001F, U+007F, U+0080 to
/// U+009F. 0: there is none at this place. A terminal executes them.
static size_t control_at(const char* at, unsigned* code)
{
    const unsigned char first = (unsigned char)at[0], second = (unsigned char)at[1];
    if (first < ' ' || first == 0x7f) {
        *code = first;
        return 1;
    }
    *code = second;
    return first == 0xc2 && second >= 0x80 && second <= 0x9f ? 2 : 0;
}

/// Prints the document with the control characters in its strings escaped.
static void print_json(const char* answer)
{
    for (const char* at = answer; *at != '\0';) {
        unsigned     code = 0;
        const size_t control = *at != '\n' ? control_at(at, &code) : 0;
        if (control > 0) {
            printf("\\u%04x", code);
        } else {
            putchar(*at);
        }
        at += control > 0 ? control : 1;
    }
}

/// Replaces control characters by question marks, except a line break at the end.
static void make_printable(char* text)
{
    for (char* at = text; *at != '\0';) {
        unsigned     code = 0;
        const bool   ends = at[0] == '\n' && at[1] == '\0';
        const size_t control = ends ? 0 : control_at(at, &code);
        memset(at, '?', control);
        at += control > 0 ? control : 1;
    }
}

static void make_tree_printable(cJSON* node)
{
    for (; node != NULL; node = node->next) {
        if (node->string != NULL) {
            make_printable(node->string);
        }
        if (node->valuestring != NULL) {
            make_printable(node->valuestring);
        }
        make_tree_printable(node->child);
    }
}

// ---- tables -------------------------------------------------------------------------------

static void show_status(const json_at* root);
static void show_vehicles(const json_at* root);
static void show_plans(const json_at* root);
static int  show_reload(const json_at* root);

static int show(const char* request, const json_at* root)
{
    int status = 0;
    if (strcmp(request, "status") == 0) {
        show_status(root);
    } else if (strcmp(request, "vehicles") == 0) {
        show_vehicles(root);
    } else if (strcmp(request, "plans") == 0) {
        show_plans(root);
    } else {
        status = show_reload(root);
    }
    if (root->file->error[0] != '\0') {
        make_printable(root->file->error);
        fprintf(stderr, "verge-ctl: not understood: %s", root->file->error);
        return EXIT_UNAVAILABLE;
    }
    return status;
}

static int64_t whole(const json_at* of, const char* key)
{
    return json_integer(of, key, INT64_MIN / 2, INT64_MAX / 2);
}

static double real(const json_at* of, const char* key)
{
    return json_double(of, key, -1e300, 1e300);
}

/// Active faults with their numbers, the worst first.
static void show_faults(const json_at* root)
{
    const json_at faults = json_member(root, "faults");
    json_expect_array(&faults, 0, FAULTS_MAX);
    const char*  before = ", fault ";
    const cJSON* node = NULL;
    cJSON_ArrayForEach(node, faults.node)
    {
        const char* name = cJSON_IsString(node) ? node->valuestring : "";
        for (int32_t number = 1; number < FAULTS_MAX; number++) {
            if (strcmp(name, message_rsu_fault(number)) == 0) {
                printf("%s%s (%d)", before, name, number);
                before = ", ";
            }
        }
    }
}

/// A counter that a daemon of an older version may not have.
static int64_t counted(const json_at* counters, const char* key)
{
    return json_integer_or(counters, key, 0, INT64_MAX / 2, 0);
}

/// Of the accepted states, those that are used without what they do not say.
static void show_lacking(const json_at* counters)
{
    const int64_t target = counted(counters, "states_unknown_target");
    const int64_t incomplete = counted(counters, "states_incomplete");
    if (target > 0) {
        printf("; %" PRId64 " with an unknown target", target);
    }
    if (incomplete > 0) {
        printf("; %" PRId64 " without heading or speed", incomplete);
    }
}

/// Counters above 0 of an object whose keys begin with a prefix, but for one of them.
static void show_counted(const json_at* of, const char* prefix, const char* but)
{
    const size_t length = strlen(prefix);
    const cJSON* member = NULL;
    cJSON_ArrayForEach(member, of->node)
    {
        if (member->string != NULL && strncmp(member->string, prefix, length) == 0
            && strcmp(member->string + length, but) != 0 && member->valuedouble > 0) {
            printf(", %.0f %s", member->valuedouble, member->string + length);
        }
    }
}

/// Other roadside units that are heard, which a daemon of an older version does not list.
static void show_others(const json_at* root)
{
    const json_at others = json_member(root, "others");
    const cJSON*  node = NULL;
    uint32_t      index = 0;
    cJSON_ArrayForEach(node, others.node)
    {
        const json_at other = json_element(&others, node, index);
        const bool    leads = json_bool_or(&other, "leads", false);
        printf("%srsu_id %" PRId64 "%s", index == 0 ? "  other units      " : ", ",
               whole(&other, "rsu_id"), leads ? " (leads)" : "");
        index++;
    }
    printf("%s", index == 0                              ? ""
                 : json_bool_or(root, "standby", false) ? "; this one stands by\n"
                                                         : "\n");
}

static void show_up(const json_at* of)
{
    const int64_t up = (whole(of, "utime") - whole(of, "start_utime")) / 1000000;
    printf("  up               %" PRId64 " h %02" PRId64 " min %02" PRId64 " s\n", up / 3600,
           up / 60 % 60, up % 60);
}

static void show_cycle_time(double last_us, double p99_us, double max_us, int64_t misses)
{
    printf("  cycle time       last %.1f ms, p99 %.1f ms, max %.1f ms, %" PRId64
           " deadline misses\n", last_us * 1e-3, p99_us * 1e-3, max_us * 1e-3, misses);
}

static void show_messages(const json_at* root, const json_at* counters)
{
    printf("\n  messages         %" PRId64 " received, %" PRId64 " sent, %" PRId64
           " bus errors, %" PRId64 " of other channels, %" PRId64 " senders lost",
           counted(counters, "bus_received"), counted(counters, "bus_published"),
           counted(counters, "bus_errors"), counted(counters, "bus_foreign"),
           counted(counters, "bus_lost"));
    const json_at strangers = json_member(root, "strangers");
    show_counted(&strangers, "", "");
}

/// Of an on-vehicle unit: its mode and the reason, the plan, the counters.
static void show_unit(const json_at* root)
{
    const json_at times = json_member(root, "cycle_us"), made = json_member(root, "trajectories");
    const json_at plans = json_member(root, "plans"), states = json_member(root, "states");
    const json_at counters = json_member(root, "counters");
    const int64_t about = whole(root, "about"), cycle = whole(root, "followed_cycle");
    const int64_t age_ms = whole(root, "state_age_ms");
    printf("verge-obu %s, vehicle %" PRId64 ": %s, %s", json_string(root, "version"),
           whole(root, "vehicle_id"), json_string(root, "mode"), json_string(root, "reason"));
    if (about >= 0) {
        printf(" with vehicle %" PRId64, about);
    }
    printf("\n  bus              %s\n", json_string(root, "bus"));
    show_up(root);
    printf("  configuration    %s, map %s\n", json_string(root, "config_crc32"),
           json_string(root, "map_crc32"));
    if (age_ms >= 0) {
        printf("  own state        %" PRId64 " ms old\n", age_ms);
    } else {
        printf("  own state        none\n");
    }
    if (cycle >= 0) {
        printf("  plan             cycle %" PRId64 " of roadside unit %" PRId64 "\n", cycle,
               whole(root, "rsu_id"));
    } else {
        printf("  plan             none\n");
    }
    printf("  neighbours       %" PRId64 "\n", whole(root, "neighbours"));
    printf("  cycle            %" PRId64 ", each %" PRId64 " ms\n", counted(&counters, "cycles"),
           whole(root, "cycle_ms"));
    show_cycle_time(real(&times, "last"), real(&times, "p99"), real(&times, "max"),
                    whole(root, "deadline_misses"));
    printf("  trajectories     %" PRId64 " following, %" PRId64 " departing, %" PRId64
           " alone, %" PRId64 " stopping; %" PRId64 " fallbacks, %" PRId64 " changes of mode\n",
           whole(&made, "following"), whole(&made, "departing"), whole(&made, "alone"),
           whole(&made, "stopping"), counted(&counters, "fallbacks"),
           counted(&counters, "mode_changes"));
    printf("  plans            %" PRId64 " accepted", whole(&plans, "accepted"));
    show_counted(&plans, "", "accepted");
    if (counted(&counters, "plans_repeated") > 0) {
        printf("; %" PRId64 " planned again, %" PRId64 " the same",
               counted(&counters, "plans_repeated"), counted(&counters, "plans_repeated_same"));
    }
    printf("\n  states           %" PRId64 " accepted", whole(&states, "accepted"));
    show_counted(&states, "", "accepted");
    show_messages(root, &counters);
    printf("\n  lost             %" PRId64 " lines of the log\n", whole(root, "log_dropped"));
}

static void show_status(const json_at* root)
{
    const json_at mode = json_member(root, "mode");
    if (json_given(&mode)) {
        show_unit(root);
        return;
    }
    const json_at of = json_member(root, "status");
    printf("verge-rsu %s, rsu_id %" PRId64 ": %s", json_string(root, "version"),
           whole(&of, "rsu_id"), json_string(root, "state"));
    show_faults(root);
    printf("\n  bus              %s\n", json_string(root, "bus"));
    show_others(root);
    show_up(&of);
    printf("  configuration    %s, map %s\n", json_string(&of, "config_crc32"),
           json_string(&of, "map_crc32"));
    printf("  vehicles         %" PRId64 " seen, %" PRId64 " planned\n",
           whole(&of, "vehicles_seen"), whole(&of, "vehicles_controlled"));
    printf("  cycle            %" PRId64 ", each %" PRId64 " ms\n", whole(&of, "cycle"),
           whole(root, "cycle_ms"));
    show_cycle_time(real(&of, "cycle_us_last"), real(&of, "cycle_us_p99"),
                    real(&of, "cycle_us_max"), whole(&of, "deadline_misses"));
    const json_at counters = json_member(root, "counters");
    printf("  plans            %" PRId64 " sent, %" PRId64 " of them fallbacks, %" PRId64
           " for late ones; %" PRId64 " cancelled\n",
           whole(&of, "plans_sent"), whole(&of, "fallbacks"), counted(&counters, "overruns"),
           counted(&counters, "plans_cancelled"));
    printf("  standstills      %" PRId64 " circles reordered, %" PRId64 " vehicles unstuck\n",
           counted(&counters, "reordered"), counted(&counters, "unstuck"));
    printf("  states           %" PRId64 " accepted", whole(&of, "rx_accepted"));
    show_counted(&of, "rx_", "accepted");
    show_lacking(&counters);
    show_messages(root, &counters);
    printf("\n  lost             %" PRId64 " lines of the log, %" PRId64 " events of the recording",
           json_integer_or(root, "log_dropped", 0, INT64_MAX / 2, 0),
           json_integer_or(root, "record_dropped", 0, INT64_MAX / 2, 0));
    printf("\n  planner memory   %.1f of %.1f MB used at most, %" PRId64 " nodes, %" PRId64
           " iterations without room\n",
           real(&of, "arena_peak_bytes") * 1e-6, real(&of, "arena_size_bytes") * 1e-6,
           whole(&of, "nodes_peak"), counted(&counters, "unexpanded"));
    printf("  candidates       %" PRId64 " trajectories\n", counted(&counters, "candidates"));
    const int64_t refused = counted(&counters, "cycles_refused");
    const int64_t unusable = counted(&counters, "vehicles_unusable");
    if (refused > 0 || unusable > 0) {
        printf("  planner refused  %" PRId64 " cycles, %" PRId64 " vehicles\n", refused, unusable);
    }
}

static void show_vehicles(const json_at* root)
{
    const json_at vehicles = json_member(root, "vehicles");
    json_expect_array(&vehicles, 0, VERGE_VEHICLES_MAX);
    printf("%8s %-9s %6s %5s %7s %10s %10s %8s %8s\n", "vehicle", "plan", "age ms", "lane",
           "target", "x m", "y m", "heading", "m/s");
    const cJSON* node = NULL;
    uint32_t index = 0;
    cJSON_ArrayForEach(node, vehicles.node)
    {
        const json_at vehicle = json_element(&vehicles, node, index++);
        const json_at plan = json_member(&vehicle, "plan");
        printf("%8" PRId64 " %-9s %6" PRId64 " %5" PRId64 " %7" PRId64
               " %10.2f %10.2f %8.3f %8.2f\n",
               whole(&vehicle, "id"), json_none(&plan) ? "-" : json_string(&vehicle, "plan"),
               whole(&vehicle, "age_ms"), whole(&vehicle, "lane"), whole(&vehicle, "target_lane"),
               real(&vehicle, "x"), real(&vehicle, "y"), real(&vehicle, "heading"),
               real(&vehicle, "speed"));
    }
}

static void show_plans(const json_at* root)
{
    const json_at plans = json_member(root, "plans");
    json_expect_array(&plans, 0, VERGE_CONTROLLED_MAX);
    printf("%8s %-9s %8s %6s  %s\n", "vehicle", "status", "cycle", "points", "actions");
    const cJSON* node = NULL;
    uint32_t index = 0;
    cJSON_ArrayForEach(node, plans.node)
    {
        const json_at plan = json_element(&plans, node, index++);
        printf("%8" PRId64 " %-9s %8" PRId64 " %6" PRId64 " ", whole(&plan, "vehicle_id"),
               message_plan_status((int32_t)whole(&plan, "status")), whole(&plan, "cycle"),
               (int64_t)cJSON_GetArraySize(json_member(&plan, "points").node));
        const json_at actions = json_member(&plan, "actions");
        const cJSON*  step = NULL;
        uint32_t      at = 0;
        cJSON_ArrayForEach(step, actions.node)
        {
            const json_at action = json_element(&actions, step, at++);
            printf(" %s to %.1f s", verge_action_name((verge_action)json_integer(
                       &action, "action", 0, VERGE_ACTION_COUNT - 1)),
                   real(&action, "t1_ms") * 1e-3);
        }
        const verge_cause why = { (verge_why)whole(&plan, "why"),
                                  (int32_t)whole(&plan, "why_vehicle"),
                                  (int32_t)whole(&plan, "why_lane"), 0 };
        char words[128];
        verge_cause_say(&why, words, sizeof words);
        printf("%s%s%s\n", words[0] != '\0' ? "  (" : "", words, words[0] != '\0' ? ")" : "");
    }
}

static int show_reload(const json_at* root)
{
    if (json_bool_or(root, "accepted", false)) {
        printf("accepted: takes effect at the next cycle\n");
        return 0;
    }
    printf("refused, the old configuration stays in effect: %s\n", json_string(root, "reason"));
    return EXIT_REFUSED;
}
