/// dds: a DDS domain, by Cyclone DDS.
///
/// A bus is a participant in a local domain with its own configuration (dds_config.h). On the
/// network all of them are in the domain of the URL, so that one process may have several buses in
/// one domain, each with its own interfaces and certificates.
///
/// Quality     VERGE_STATE   best effort, the last of each vehicle: a lost state is replaced by the
///                           next one before it could be sent again.
///             VERGE_PLAN    reliable, the last for each vehicle, kept as long as it is valid: its
///                           31 points of 0.1 s. A write blocks for at most 5 ms.
///             VERGE_STATUS  reliable, the last of each unit, kept for later readers.
/// Memory      A reader stores an instance of every vehicle as long as a writer of it exists, so a
///             hostile or a long-lived writer would fill the memory. After INSTANCES_MAX new ones
///             the readers are replaced by empty ones, at most once a second; waiting messages are
///             lost, as in a full socket. Until then the reader of states has a hard limit, and
///             states beyond it are counted as dropped. The reliable readers have none, because
///             Cyclone's receiving thread would block until there is space.
/// Endings     The instance of a vehicle whose plan was cancelled is unregistered, so that readers
///             remove it, too. Cyclone 0.10 still keeps about 300 bytes of each vehicle that ever
///             had a plan, until the domain is deleted (Cyclone DDS issue 1487).
/// Silence     Writers offer liveliness and a deadline; a sender that leaves or falls silent is
///             counted and logged. The planning of its vehicle depends on the age of its state.
/// Polling     An eventfd, written by Cyclone's threads when a message arrives.
/// Loss        Cyclone retries without reporting that no data passes. So the interfaces are checked
///             once a second; each check that finds one down counts as an error, as do the errors
///             that Cyclone reports.
#include "backend.h"
#include "codec.h"
#include "complaints.h"
#include "dds_config.h"
#include "dds_security.h"
#include "dds_types.h"
#include "settings.h"
#include "verge/plan.h"

#include <dds/ddsrt/log.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

enum {
    KINDS = TRANSPORT_TRAJECTORY + 1, // array size; TRANSPORT_NONE is unused
    INSTANCES_MAX = 1024,         // 1.3 MB of plans, 90 KB of states
    BUSES_MAX = 32,               // of a process
    LINE_SIZE = COMPLAINT_SIZE,
};

typedef struct dds {
    uint32_t     number;   ///< of the URL
    uint32_t     local;    ///< of the domain within this process
    uint32_t     shared_crc32; ///< of a secured domain's configuration; 0: not shared
    dds_entity_t domain, participant;
    dds_entity_t topics[KINDS], readers[KINDS], writers[KINDS];
    uint32_t     deadline_ms; ///< required of senders of states, 0: none
    counters*    counts;
    int          fd;       ///< eventfd
    uint32_t     turn;     ///< the kind looked at first by the next take()
    atomic_bool  full;     ///< a reader had no room, or has met INSTANCES_MAX vehicles
    uint32_t     met[KINDS]; ///< vehicles new to the reader
    int64_t      renew_at_s; ///< [s] monotonic: not before
    int64_t      watched_at_s; ///< [s] monotonic: the last look at the interfaces
    char         interfaces[DDS_INTERFACES_MAX][IF_NAMESIZE];
    bool         is_down[DDS_INTERFACES_MAX]; ///< as last logged
    uint32_t     interface_count;
    complaints   complaints;
} dds;

/// One bus is opened or closed at a time. Separate from `lock`, which Cyclone's threads take for
/// their lines meanwhile.
static pthread_mutex_t gate = PTHREAD_MUTEX_INITIALIZER;
/// Guards the list of all buses.
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static dds*            buses[BUSES_MAX];
static pthread_once_t  sink_set = PTHREAD_ONCE_INIT;
static pthread_once_t  trace_sink_set = PTHREAD_ONCE_INIT;

/// While a thread opens a bus: the buffer for Cyclone's last line, the reason of a failure.
static _Thread_local char* reason;

static bool enlist(dds* self);
static const dds* companion_of(const dds* self);
static void delist(const dds* self);
static int  domain_open(dds* self, const char* config, const dds_security_files* security);
static int  participant_open(dds* self, const dds_security_files* security);
static int  ends_open(dds* self, unsigned receive);
static int  reader_open(dds* self, transport_kind kind);
static int  writer_open(dds* self, transport_kind kind);
static void readers_renew(dds* self);
static void interfaces_watch(dds* self);
static void sink_install(void);
static void trace_sink_install(void);
static void tell(dds* self, const char* format, ...) __attribute__((format(printf, 2, 3)));

static bool domain_parse(const char* rest, uint32_t* number)
{
    char*      end = NULL;
    const long value = rest[0] >= '0' && rest[0] <= '9' ? strtol(rest, &end, 10) : -1;
    *number = (uint32_t)value;
    return value >= 0 && value <= DDS_DOMAIN_MAX && *end == '\0';
}

static void dds_bus_close(void* self);
static void explain(const dds* self, const transport_options* options, int result,
                    const char* said, char* error, size_t error_size);

static int dds_bus_open(void** self, const char* rest, unsigned receive,
                        const transport_options* options, counters* counts, char* error,
                        size_t error_size)
{
    *self = NULL;
    uint32_t number = 0;
    if (!domain_parse(rest, &number)) {
        snprintf(error, error_size, "dds:%s: expected dds:N with a domain number of 0 to %d", rest,
                 DDS_DOMAIN_MAX);
        return TRANSPORT_BAD_URL;
    }
    dds_security_files        files;
    const dds_security_files* security = dds_security_asked(options, &files);
    if (security != NULL && !dds_security_check(security, error, error_size)) {
        return TRANSPORT_BAD_URL;
    }
    static _Thread_local char config[DDS_CONFIG_SIZE];
    if (!dds_config_write(options, number, config, sizeof config, error, error_size)) {
        return TRANSPORT_UNAVAILABLE;
    }
    pthread_once(&sink_set, sink_install);
    if (security != NULL && dds_config_environment(options) == NULL) {
        pthread_once(&trace_sink_set, trace_sink_install);
    }
    char said[LINE_SIZE] = "";
    dds* made = calloc(1, sizeof *made);
    if (made == NULL) {
        snprintf(error, error_size, "dds:%s: out of memory", rest);
        return TRANSPORT_UNAVAILABLE;
    }
    made->number = number;
    made->deadline_ms = setting_number(options, "dds.deadline_ms", 0);
    made->interface_count = dds_config_interfaces(options, made->interfaces);
    made->counts = counts;
    complaints_init(&made->complaints, options);
    made->fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);

    reason = said;
    pthread_mutex_lock(&gate);
    int result = made->fd >= 0 ? domain_open(made, config, security)
                               : DDS_RETCODE_OUT_OF_RESOURCES;
    if (result == 0 && !enlist(made)) {
        result = DDS_RETCODE_OUT_OF_RESOURCES;
    }
    pthread_mutex_unlock(&gate);
    if (result == 0) {
        result = participant_open(made, security);
    }
    if (result == 0) {
        result = ends_open(made, receive);
    }
    reason = NULL;
    if (result != 0) {
        explain(made, options, result, said, error, error_size);
        dds_bus_close(made);
        // Permissions that refuse a topic will refuse it at the next try, too.
        return result == DDS_RETCODE_NOT_ALLOWED_BY_SECURITY ? TRANSPORT_BAD_URL
                                                             : TRANSPORT_UNAVAILABLE;
    }
    *self = made;
    return TRANSPORT_OK;
}

/// The reason why a bus could not be opened, with Cyclone's return code and its last line.
static void explain(const dds* self, const transport_options* options, int result,
                    const char* said, char* error, size_t error_size)
{
    const unsigned number = self->number;
    const char*    colon = said[0] != '\0' ? ": " : "";
    if (result == DDS_RETCODE_NOT_ALLOWED_BY_SECURITY) {
        snprintf(error, error_size,
                 "dds:%u: %s%s%.160s does not grant all that this program publishes and hears, "
                 "expected permissions that do, or a program that wants less",
                 number, said, colon, setting_text(options, "dds.security.permissions", 0));
    } else if (result == DDS_RETCODE_PRECONDITION_NOT_MET) {
        snprintf(error, error_size,
                 "dds:%u: this program is in the domain already with other interfaces or peers, "
                 "expected the same: a secured bus changes these at a restart only", number);
    } else {
        snprintf(error, error_size,
                 "dds:%u: %s%s%s; see dds.interfaces, dds.security and the ports %u and up", number,
                 dds_strretcode(result), colon, said, 7400 + 250 * number);
    }
}

/// Deleting waits for listeners, so none runs after it. The last bus of a domain deletes the
/// domain.
static void dds_bus_close(void* self)
{
    dds* mine = self;
    pthread_mutex_lock(&gate);
    if (mine->participant > 0) {
        dds_delete(mine->participant);
    }
    delist(mine);
    if (mine->domain > 0 && companion_of(mine) == NULL) {
        dds_delete(mine->domain);
    }
    pthread_mutex_unlock(&gate);
    if (mine->fd >= 0) {
        close(mine->fd);
    }
    complaints_destroy(&mine->complaints);
    free(mine);
}

static int dds_bus_fd(const void* self)
{
    return ((const dds*)self)->fd;
}

/// The GUID as DDS tools print it; the bare handle of a writer that has left.
static void dds_bus_sender_text(const void* self, uint64_t sender, char* text, size_t size)
{
    const dds* mine = self;
    for (uint32_t kind = TRANSPORT_STATE; kind < KINDS; ++kind) {
        dds_builtintopic_endpoint_t* writer =
            mine->readers[kind] > 0
                ? dds_get_matched_publication_data(mine->readers[kind], sender) : NULL;
        if (writer != NULL) {
            const uint8_t* v = writer->key.v;
            snprintf(text, size, "%08x:%08x:%08x:%08x", codec_get_u32(v), codec_get_u32(v + 4),
                     codec_get_u32(v + 8), codec_get_u32(v + 12));
            dds_builtintopic_free_endpoint(writer);
            return;
        }
    }
    snprintf(text, size, "%016" PRIx64, sender);
}

static bool dds_bus_exposed(const char* rest, const transport_options* options, char* words,
                            size_t words_size)
{
    char interface[64];
    if (!dds_config_leaves(options, interface, sizeof interface)) {
        return false;
    }
    dds_security_files        files;
    const dds_security_files* security = dds_security_asked(options, &files);
    if (security != NULL) {
        return dds_security_lax(security, words, words_size);
    }
    snprintf(words, words_size,
             "dds:%s: not encrypted on %s: every machine there can send as any vehicle and as this "
             "unit; "
             "set dds.security (tools/certs makes a set to try), or dds.interfaces to [\"lo\"]",
             rest, interface);
    return true;
}

static bool dds_bus_secured(const transport_options* options)
{
    return setting_count(options, "dds.security.key") > 0;
}

static bool dds_bus_expires(const transport_options* options, int64_t* utime, char* words,
                            size_t words_size)
{
    dds_security_files        files;
    const dds_security_files* security = dds_security_asked(options, &files);
    return security != NULL && dds_security_expires(security, utime, words, words_size);
}

// ---- moving messages ----------------------------------------------------------------------

/// One sample of one kind. Samples without data, as of a writer that left, are skipped.
static bool sample_take(dds* self, transport_kind kind, transport_message* message)
{
    void*             samples[1] = { &message->as };
    dds_sample_info_t info;
    for (;;) {
        const int count = dds_take(self->readers[kind], samples, &info, 1, 1);
        if (count < 0) {
            count_up(&self->counts->errors, 1);
        }
        if (count <= 0) {
            return false;
        }
        if (info.view_state == DDS_VST_NEW && ++self->met[kind] >= INSTANCES_MAX) {
            atomic_store(&self->full, true);
        }
        if (info.valid_data) {
            break;
        }
    }
    message->kind = kind;
    message->sender = info.publication_handle;
    return true;
}

static bool any_take(dds* self, transport_message* message)
{
    for (uint32_t i = 0; i < KINDS; ++i) {
        const uint32_t kind = (self->turn + i) % KINDS;
        if (self->readers[kind] > 0 && sample_take(self, (transport_kind)kind, message)) {
            self->turn = kind + 1;
            return true;
        }
    }
    return false;
}

/// The descriptor is cleared before the queue is read, so that a message in between sets it again.
static take_result dds_bus_take(void* self, transport_message* message)
{
    dds* mine = self;
    interfaces_watch(mine);
    complaints_log(&mine->complaints, backend_now_s());
    if (any_take(mine, message)) {
        return TAKE_MESSAGE;
    }
    if (atomic_load(&mine->full)) {
        readers_renew(mine);
    }
    uint64_t readings;
    (void)!read(mine->fd, &readings, sizeof readings);
    return any_take(mine, message) ? TAKE_MESSAGE : TAKE_NOTHING;
}

static int dds_bus_send(void* self, int64_t utime, const transport_message* message)
{
    (void)utime;
    dds*                 mine = self;
    const transport_kind kind = message->kind;
    if (dds_type_of(kind) == NULL || (mine->writers[kind] == 0 && writer_open(mine, kind) != 0)) {
        return -1;
    }
    const int result = dds_write(mine->writers[kind], &message->as);
    if (kind == TRANSPORT_PLAN && message->as.plan.status == VERGE_CANCELLED) {
        (void)dds_unregister_instance(mine->writers[kind], &message->as);
    }
    return result == 0 ? 0 : -1;
}

// ---- domain and topics --------------------------------------------------------------------

/// Another secured bus in the same domain with the same configuration. Within the gate.
static const dds* companion_of(const dds* self)
{
    const dds* found = NULL;
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < BUSES_MAX && found == NULL; ++i) {
        const dds* other = buses[i];
        if (other != NULL && other != self && other->number == self->number &&
            other->shared_crc32 == self->shared_crc32 && self->shared_crc32 != 0) {
            found = other;
        }
    }
    pthread_mutex_unlock(&lock);
    return found;
}

/// Each domain number can be created once in a process. The second bus gets another local number
/// and the same one on the network. A secured domain keeps its number, because Cyclone looks up the
/// local one in the governance. Secured buses of one configuration share the domain, so that a
/// daemon can enter with new certificates before it leaves with the old ones.
static int domain_open(dds* self, const char* config, const dds_security_files* security)
{
    static atomic_uint next = 1000;
    self->local = self->number;
    self->shared_crc32 = security != NULL ? transport_crc32(config, strlen(config)) : 0;
    const dds* companion = companion_of(self);
    if (companion != NULL) {
        self->local = companion->local;
        self->domain = companion->domain;
        return 0;
    }
    self->domain = dds_create_domain(self->local, config);
    while (self->domain == DDS_RETCODE_PRECONDITION_NOT_MET && security == NULL) {
        self->local = atomic_fetch_add(&next, 1);
        self->domain = dds_create_domain(self->local, config);
    }
    return self->domain < 0 ? self->domain : 0;
}

/// The property names of the security files in the standard and in Cyclone.
static void papers_set(dds_qos_t* quality, const dds_security_files* security)
{
    const struct { const char *name, *path; } papers[] = {
        { "dds.sec.auth.identity_ca", security->identity_ca },
        { "dds.sec.auth.identity_certificate", security->certificate },
        { "dds.sec.auth.private_key", security->key },
        { "dds.sec.access.permissions_ca", security->permissions_ca },
        { "dds.sec.access.governance", security->governance },
        { "dds.sec.access.permissions", security->permissions },
    };
    static const char* const plugins[][2] = {
        { "dds.sec.auth.library.path", "dds_security_auth" },
        { "dds.sec.auth.library.init", "init_authentication" },
        { "dds.sec.auth.library.finalize", "finalize_authentication" },
        { "dds.sec.access.library.path", "dds_security_ac" },
        { "dds.sec.access.library.init", "init_access_control" },
        { "dds.sec.access.library.finalize", "finalize_access_control" },
        { "dds.sec.crypto.library.path", "dds_security_crypto" },
        { "dds.sec.crypto.library.init", "init_crypto" },
        { "dds.sec.crypto.library.finalize", "finalize_crypto" },
    };
    for (size_t i = 0; i < sizeof plugins / sizeof plugins[0]; ++i) {
        dds_qset_prop(quality, plugins[i][0], plugins[i][1]);
    }
    for (size_t i = 0; i < sizeof papers / sizeof papers[0]; ++i) {
        char url[4096];
        snprintf(url, sizeof url, "file:%s", papers[i].path);
        dds_qset_prop(quality, papers[i].name, url);
    }
}

static int participant_open(dds* self, const dds_security_files* security)
{
    dds_qos_t* quality = dds_create_qos();
    if (security != NULL) {
        papers_set(quality, security);
    }
    self->participant = dds_create_participant(self->local, quality, NULL);
    dds_delete_qos(quality);
    return self->participant < 0 ? self->participant : 0;
}

static int ends_open(dds* self, unsigned receive)
{
    int result = 0;
    for (uint32_t kind = TRANSPORT_STATE; result == 0 && kind < KINDS; ++kind) {
        if ((receive & (1u << kind | 1u << (8 + kind))) == 0) {
            continue; // permissions may not name this topic
        }
        self->topics[kind] =
            dds_create_topic(self->participant, dds_type_of((transport_kind)kind),
                             codec_channel((transport_kind)kind), NULL, NULL);
        result = self->topics[kind] < 0 ? self->topics[kind] : 0;
        if (result == 0 && (receive & 1u << kind) != 0) {
            result = reader_open(self, (transport_kind)kind);
        }
        if (result == 0 && (receive & 1u << (8 + kind)) != 0) {
            result = writer_open(self, (transport_kind)kind);
        }
    }
    return result;
}

/// The quality of service that writers and readers of a topic share.
static dds_qos_t* quality_of(transport_kind kind)
{
    dds_qos_t* quality = dds_create_qos();
    dds_qset_history(quality, DDS_HISTORY_KEEP_LAST, 1);
    if (kind == TRANSPORT_STATE || kind == TRANSPORT_TRAJECTORY) { // a newer one comes in 0.1 s
        dds_qset_reliability(quality, DDS_RELIABILITY_BEST_EFFORT, 0);
    } else {
        dds_qset_reliability(quality, DDS_RELIABILITY_RELIABLE, DDS_MSECS(5));
    }
    if (kind == TRANSPORT_STATUS || kind == TRANSPORT_SIGNAL) {
        dds_qset_durability(quality, DDS_DURABILITY_TRANSIENT_LOCAL);
    }
    return quality;
}

static void on_data(dds_entity_t reader, void* self)
{
    (void)reader;
    const uint64_t one = 1;
    (void)!write(((dds*)self)->fd, &one, sizeof one);
}

static void on_rejected(dds_entity_t reader, const dds_sample_rejected_status_t status, void* self)
{
    dds* mine = self;
    count_up(&mine->counts->dropped, (uint64_t)(uint32_t)status.total_count_change);
    atomic_store(&mine->full, true);
    on_data(reader, self);
}

static void on_liveliness(dds_entity_t reader, const dds_liveliness_changed_status_t status,
                          void* self)
{
    (void)reader;
    dds* mine = self;
    if (status.alive_count_change < 0) {
        count_up(&mine->counts->lost, (uint64_t)-status.alive_count_change);
        tell(mine, "a sender of states left or fell silent, %u are there", status.alive_count);
    }
}

static void on_deadline(dds_entity_t reader, const dds_requested_deadline_missed_status_t status,
                        void* self)
{
    (void)reader;
    dds* mine = self;
    count_up(&mine->counts->lost, (uint64_t)(uint32_t)status.total_count_change);
    tell(mine, "a vehicle sent no state for %u ms (dds.deadline_ms)", mine->deadline_ms);
}

static void on_incompatible(dds_entity_t reader,
                            const dds_requested_incompatible_qos_status_t status, void* self)
{
    (void)reader;
    tell(self, "a sender is not heard, its quality of service does not fit (policy %u%s)",
         status.last_policy_id, status.last_policy_id == DDS_DEADLINE_QOS_POLICY_ID
                                    ? ": it promises no deadline as short as dds.deadline_ms" : "");
}

/// 0 or a return code of Cyclone's.
static int reader_open(dds* self, transport_kind kind)
{
    dds_qos_t*      quality = quality_of(kind);
    dds_listener_t* listener = dds_create_listener(self);
    if (kind == TRANSPORT_STATE) {
        dds_qset_resource_limits(quality, 2 * INSTANCES_MAX, 2 * INSTANCES_MAX, 1);
    }
    dds_qset_ignorelocal(quality, DDS_IGNORELOCAL_PARTICIPANT);
    dds_lset_data_available(listener, on_data);
    dds_lset_sample_rejected(listener, on_rejected);
    dds_lset_requested_incompatible_qos(listener, on_incompatible);
    if (kind == TRANSPORT_STATE) {
        dds_lset_liveliness_changed(listener, on_liveliness);
    }
    if (kind == TRANSPORT_STATE && self->deadline_ms > 0) {
        dds_qset_deadline(quality, DDS_MSECS((int64_t)self->deadline_ms));
        dds_lset_requested_deadline_missed(listener, on_deadline);
    }
    const dds_entity_t reader =
        dds_create_reader(self->participant, self->topics[kind], quality, listener);
    dds_delete_listener(listener);
    dds_delete_qos(quality);
    self->readers[kind] = reader > 0 ? reader : 0;
    return reader < 0 ? reader : 0;
}

/// 0 or a return code of Cyclone's. Deadlines: a state or a trajectory is due every 0.1 s, a status
/// or a signal every second; five and two of them may be lost. Readers need not require them.
static int writer_open(dds* self, transport_kind kind)
{
    dds_qos_t* quality = quality_of(kind);
    dds_qset_writer_data_lifecycle(quality, false);
    dds_qset_liveliness(quality, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
    switch (kind) {
    case TRANSPORT_STATE:
    case TRANSPORT_TRAJECTORY: dds_qset_deadline(quality, DDS_MSECS(500)); break;
    case TRANSPORT_PLAN: dds_qset_lifespan(quality, DDS_SECS(3)); break;
    case TRANSPORT_STATUS:
    case TRANSPORT_SIGNAL: dds_qset_deadline(quality, DDS_SECS(3)); break;
    case TRANSPORT_MARK:
    case TRANSPORT_NONE: break;
    }
    const dds_entity_t writer =
        dds_create_writer(self->participant, self->topics[kind], quality, NULL);
    dds_delete_qos(quality);
    self->writers[kind] = writer > 0 ? writer : 0;
    return writer < 0 ? writer : 0;
}

/// Replaces full readers by empty ones. A reader that cannot be created is tried again later.
static void readers_renew(dds* self)
{
    const int64_t now = backend_now_s();
    if (now < self->renew_at_s) {
        return;
    }
    self->renew_at_s = now + 1;
    atomic_store(&self->full, false);
    for (uint32_t kind = TRANSPORT_STATE; kind < KINDS; ++kind) {
        if (self->readers[kind] == 0) {
            continue;
        }
        self->met[kind] = 0;
        dds_delete(self->readers[kind]);
        if (reader_open(self, (transport_kind)kind) != 0) {
            count_up(&self->counts->errors, 1);
            tell(self, "the reader of %s could not be made again",
                 codec_channel((transport_kind)kind));
        }
    }
}

static void interfaces_watch(dds* self)
{
    const int64_t now = backend_now_s();
    if (now == self->watched_at_s) {
        return;
    }
    self->watched_at_s = now;
    for (uint32_t i = 0; i < self->interface_count; ++i) {
        const bool down = !dds_config_interface_up(self->interfaces[i]);
        if (down != self->is_down[i]) {
            tell(self, "the interface %s %s", self->interfaces[i],
                 down ? "is down, nobody is reached there" : "is up again");
        }
        self->is_down[i] = down;
        count_up(&self->counts->errors, down ? 1 : 0);
    }
}

// ---- log lines ----------------------------------------------------------------------------

static bool enlist(dds* self)
{
    bool done = false;
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < BUSES_MAX && !done; ++i) {
        if (buses[i] == NULL) {
            buses[i] = self;
            done = true;
        }
    }
    pthread_mutex_unlock(&lock);
    return done;
}

static void delist(const dds* self)
{
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < BUSES_MAX; ++i) {
        if (buses[i] == self) {
            buses[i] = NULL;
        }
    }
    pthread_mutex_unlock(&lock);
}

/// Identical lines are rate-limited by their CRC.
static void note(dds* self, const char* words)
{
    char line[LINE_SIZE + 16]; // cut to LINE_SIZE when it is added
    snprintf(line, sizeof line, "dds:%u: %s", (unsigned)self->number, words);
    complaints_add(&self->complaints, transport_crc32(line, strlen(line)), line);
}

static void tell(dds* self, const char* format, ...)
{
    char    line[LINE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    note(self, line);
}

/// Which domain of this process a line is about, UINT32_MAX: none in particular. Cyclone 0.10
/// leaves data->domid as it was on the stack; the header it wrote before the message tells:
/// "1700000000.123456 [3] recv: ", with nothing between the brackets where there is no domain.
static uint32_t domain_of(const dds_log_data_t* data)
{
    char         header[64];
    const size_t size = data->hdrsize < sizeof header ? data->hdrsize : sizeof header - 1;
    memcpy(header, data->message - data->hdrsize, size);
    header[size] = '\0';
    const char* bracket = strchr(header, '[');
    uint32_t    number = UINT32_MAX;
    return bracket != NULL && sscanf(bracket, "[%" SCNu32 "]", &number) == 1 ? number : UINT32_MAX;
}

/// Cyclone's own lines: warnings and errors of any thread. Those of no domain in particular go to
/// every bus.
static void on_line(void* argument, const dds_log_data_t* data)
{
    (void)argument;
    char         line[LINE_SIZE];
    const size_t length = strcspn(data->message, "\n");
    snprintf(line, sizeof line, "%.*s", (int)length, data->message);
    if (reason != NULL) {
        memcpy(reason, line, sizeof line);
        return;
    }
    const uint32_t local = domain_of(data);
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < BUSES_MAX; ++i) {
        dds* self = buses[i];
        if (self != NULL && (local == UINT32_MAX || local == self->local)) {
            count_up(&self->counts->errors, (data->priority & DDS_LC_ERROR) != 0 ? 1 : 0);
            note(self, line);
        }
    }
    pthread_mutex_unlock(&lock);
}

static void sink_install(void)
{
    dds_set_log_sink(on_line, NULL);
}

/// Cyclone ignores participants without a certificate in a secured domain and reports them only in
/// its trace of discovery: "Non secure remote writer 110d352:55a9f461:3d3f60e6:3c2 is not allowed".
/// A session has about a hundred such lines, ten for each participant, of which one is logged.
static void on_trace(void* argument, const dds_log_data_t* data)
{
    (void)argument;
    uint32_t participant[3];
    if (sscanf(data->message, "Non secure remote %*6s %" SCNx32 ":%" SCNx32 ":%" SCNx32,
               &participant[0], &participant[1], &participant[2]) != 3) {
        return;
    }
    const uint32_t local = domain_of(data);
    pthread_mutex_lock(&lock);
    for (uint32_t i = 0; i < BUSES_MAX; ++i) {
        if (buses[i] != NULL && buses[i]->local == local) {
            char line[LINE_SIZE];
            snprintf(line, sizeof line, "participant %x:%x:%x is not heard: it has no certificate",
                     participant[0], participant[1], participant[2]);
            note(buses[i], line);
        }
    }
    pthread_mutex_unlock(&lock);
}

static void trace_sink_install(void)
{
    dds_set_trace_sink(on_trace, NULL);
}

const backend backend_dds = {
    .scheme = "dds:",
    .form = "dds:N",
    .settings = dds_settings,
    .setting_count = DDS_SETTINGS,
    .open = dds_bus_open,
    .close = dds_bus_close,
    .fd = dds_bus_fd,
    .take = dds_bus_take,
    .send = dds_bus_send,
    .sender_text = dds_bus_sender_text,
    .exposed = dds_bus_exposed,
    .secured = dds_bus_secured,
    .expires = dds_bus_expires,
    .keeps_time = false,
};
