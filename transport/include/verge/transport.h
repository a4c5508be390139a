/// One small interface to every bus: open by URL, poll a descriptor, drain into fixed slots,
/// publish, read the counters.
///
///     transport* bus;
///     char error[256];
///     const char* url = "lcm:udpm://239.255.76.67:7667?ttl=0";
///     if (transport_open(&bus, url, TRANSPORT_STATES, error, sizeof error) != TRANSPORT_OK) ...
///     poll(transport_fd(bus)); n = transport_drain(bus, messages, 64);
///     transport_publish_plan(bus, &plan);
///
/// Memory      transport_open() allocates, transport_close() frees, nothing between them does. But
///             dds: Cyclone DDS allocates as it likes, in its own threads and in those that publish
///             and drain; these must not be the planner's.
/// Threads     Draining and publishing may happen in two threads; each of them in one at a time.
/// URLs        lcm:URL   an LCM UDP multicast URL, udpm://ADDRESS:PORT?ttl=N&recv_buf_size=N, each
///                       part optional as in LCM. One hears one's own messages too; they count
///                       as foreign unless asked for. Messages LCM would cut into fragments are
///                       not ours and are refused.
///             loop:NAME in process: every open end of one name (which may be empty) hears the
///                       others. A full queue gives up its oldest message.
///             dds:N     DDS domain N, 0 to 230 (Cyclone DDS), where it was built in. Topics have
///                       the names of LCM's channels. States and statuses are for whoever is
///                       there: of each vehicle (each unit) the newest message waits, older ones
///                       are given up, and the order of different vehicles is not kept. Plans are
///                       sent again until they arrive or are replaced, for three seconds at most.
///             log:FILE  an LCM event log: a regular file that is read, or any file that is
///                       written when opened with TRANSPORT_RECORD. What is written is in the file
///                       at each mark and at close; writing waits where the file does (a FIFO whose
///                       reader is slow). A FIFO is opened whether it has a reader or not.
/// Senders     Every message tells who sent it, as far as the bus knows: an LCM sender is its
///             address and port, a DDS sender its writer, a loop: sender its end; a log
///             does not know.
/// Losing it   A bus that goes away after it was opened shows in errors and comes back by itself;
///             the descriptor stays the same. For that, drain once a second even when nothing
///             is waiting.
#ifndef VERGE_TRANSPORT_H
#define VERGE_TRANSPORT_H

#include "verge_rsu_status_t.h"
#include "verge_vehicle_plan_t.h"
#include "verge_vehicle_state_t.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct transport transport;

/// One setting of a bus beyond its URL, by name: { "dds.interfaces", "eth1" }. A list is several
/// settings of one name, in order. In a list of objects each member is such a list: the first
/// "lcm.keys.id" belongs to the first "lcm.keys.file".
typedef struct transport_setting {
    const char *name, *value;
} transport_setting;

/// What a bus needs beyond its URL. All zero: the presets. One set of options serves every bus of a
/// program: each takes its own settings. Strings and arrays are copied: they need to live until
/// transport_open_with() returns.
typedef struct transport_options {
    const transport_setting* settings;
    uint32_t                 setting_count;
    /// Complaints of the bus or its middleware, one line each, rate-limited; from within
    /// transport_drain(). May be null. log_context lives as long as the bus.
    void (*log)(void* context, const char* line);
    void* log_context;
} transport_options;

typedef enum transport_setting_kind {
    TRANSPORT_SETTING_TEXT,
    TRANSPORT_SETTING_FILE,   ///< the path of a file
    TRANSPORT_SETTING_NUMBER, ///< a whole number in decimal digits
    TRANSPORT_SETTING_GROUP,  ///< no value: an object, or a list of objects, whose members follow
                              ///< in the table; all members of an object are given, or none
} transport_setting_kind;

/// What a setting is, for programs that read settings from a file.
typedef struct transport_setting_def {
    const char*            name;     ///< "BUS.KEY", of a member of an object "BUS.KEY.MEMBER"
    transport_setting_kind kind;
    uint32_t               list_max; ///< KEY is a list of at most so many; 0: it is no list
    uint32_t               min, max; ///< of a number, both included
    const char*            preset;   ///< what holds where nothing is given; null: nothing
    const char*            unit;     ///< null: none
    const char*            text;     ///< what it means
} transport_setting_def;

/// The settings of all buses that are built in, those of a bus together. Null: index is beyond the
/// last. Static lifetime.
const transport_setting_def* transport_setting_at(uint32_t index);

typedef enum transport_kind {
    TRANSPORT_NONE = 0,
    TRANSPORT_STATE,  ///< VERGE_STATE, verge_vehicle_state_t
    TRANSPORT_PLAN,   ///< VERGE_PLAN, verge_vehicle_plan_t
    TRANSPORT_STATUS, ///< VERGE_STATUS, verge_rsu_status_t
    TRANSPORT_MARK,   ///< VERGE_CYCLE, only in logs written by the daemon: a cycle or overrun mark
} transport_kind;

/// What to receive (bits); what is not asked for is skipped unseen. And what to send.
enum {
    TRANSPORT_STATES = 1u << TRANSPORT_STATE,
    TRANSPORT_PLANS = 1u << TRANSPORT_PLAN,
    TRANSPORT_STATUSES = 1u << TRANSPORT_STATUS,
    TRANSPORT_MARKS = 1u << TRANSPORT_MARK,
    /// What will be sent: a bus that has to find its listeners first (dds:) begins at open. What
    /// is sent without having been announced may not reach anyone the first time.
    TRANSPORT_SENDS_STATES = 1u << (8 + TRANSPORT_STATE),
    TRANSPORT_SENDS_PLANS = 1u << (8 + TRANSPORT_PLAN),
    TRANSPORT_SENDS_STATUSES = 1u << (8 + TRANSPORT_STATUS),
    TRANSPORT_RECORD = 1u << 16, ///< log: only: create the file and write what is published
};

/// A mark in a daemon's own log: "at utime, cycle N was planned (with these clock readings)".
typedef struct transport_mark {
    int64_t utime;    ///< [us] plan instant
    int64_t cycle;
    int32_t overrun;  ///< 1: at utime this cycle was still being planned; what was left of the
                      ///< plans before it went out (messages with VERGE_REASON_OVERRUN)
} transport_mark;

/// A received, decoded message. Its crc32 was right; its values are not checked yet (wire.h).
typedef struct transport_message {
    transport_kind kind;
    int64_t        arrival_utime; ///< [us] clock at drain; the event's own time for log:
    uint64_t       sender;        ///< who sent it, among the senders of this bus; 0 unknown
    uint32_t       bus;           ///< 0; whoever drains several buses numbers them here
    union {
        verge_vehicle_state_t state;
        verge_vehicle_plan_t  plan;
        verge_rsu_status_t    status;
        transport_mark        mark;
    } as;
} transport_message;

/// Why a message on an lcm: bus with an allow list or keys was not handed out.
typedef enum transport_refusal {
    TRANSPORT_ADMITTED = 0, ///< it was
    TRANSPORT_NOT_ALLOWED,  ///< its source address is not in the allow list
    TRANSPORT_UNSIGNED,
    TRANSPORT_UNKNOWN_KEY,  ///< signed with a key id that is not ours
    TRANSPORT_FORGED,       ///< the signature is not that of this key and these bytes
    TRANSPORT_UNTIMELY,     ///< sent more than window_ms ago, or from now, by our clock
    TRANSPORT_REPLAYED,     ///< heard before, or more senders speak at once than can be watched
    TRANSPORT_REFUSALS,
} transport_refusal;

typedef struct transport_stats {
    uint64_t received;  ///< messages handed out by transport_drain()
    uint64_t published;
    uint64_t malformed; ///< truncated, oversized, foreign type, wrong crc32, not LCM at all
    uint64_t foreign;   ///< well-formed messages of channels not asked for
    uint64_t dropped;   ///< by the kernel's socket buffer (SO_RXQ_OVFL) or a full loop: queue;
                        ///< log: when recording, events that could not be written
    uint64_t errors;    ///< failed sends or receives
    uint64_t refused[TRANSPORT_REFUSALS]; ///< by transport_refusal
    uint64_t lost;      ///< dds: only: senders that left or fell silent, and deadlines missed
} transport_stats;

/// "not_allowed", "unsigned", ...
const char* transport_refusal_name(transport_refusal refusal);
/// Of all kinds together.
uint64_t transport_refused(const transport_stats* stats);

/// What transport_open() answers.
typedef enum transport_result {
    TRANSPORT_OK = 0,
    TRANSPORT_BAD_URL = -1,     ///< not a URL of ours, or options that cannot work
    TRANSPORT_UNAVAILABLE = -2, ///< no such bus now: no multicast route, no interface, no file
} transport_result;

/// Null: the URL begins like one of a bus that is built in. Else what is wrong with it and what was
/// expected, in words.
const char* transport_url_fault(const char* url);

/// Can strangers hear this bus or speak on it: on more than this machine's loopback, and in the
/// clear or by rules of DDS Security that leave the door open? Then words tells how, and what to do
/// about it. A URL that is none is not.
bool transport_exposed(const char* url, const transport_options* options, char* words,
                       size_t words_size);

/// Do the options ask for signatures or certificates on this bus? (The rules of DDS Security may
/// leave the door open all the same, see transport_exposed().)
bool transport_secured(const char* url, const transport_options* options);

/// Does what admits us to this bus, certificates and permissions, have an end? Then utime [us] is
/// the first one, and words tells whose and what to do. What cannot be read has none.
bool transport_expires(const char* url, const transport_options* options, int64_t* utime,
                       char* words, size_t words_size);

/// Opens a bus. On failure *bus is null and error holds one line that says what to do.
/// options null: the defaults.
int  transport_open_with(transport** bus, const char* url, unsigned receive,
                         const transport_options* options, char* error, size_t error_size);
int  transport_open(transport** bus, const char* url, unsigned receive, char* error,
                    size_t error_size);
void transport_close(transport* bus); ///< null is fine

/// Descriptor for poll(); -1 for log: (always ready until transport_ended()) and for an lcm: bus
/// opened without anything to receive.
int  transport_fd(const transport* bus);
/// Takes at most max waiting messages, never blocks. Returns how many; 0 may also mean that a
/// portion of other channels' messages was skipped and more is waiting (poll says so).
uint32_t transport_drain(transport* bus, transport_message* messages, uint32_t max);
/// A sender in words for people: on LCM its address as 10.1.0.7:40312, on DDS the GUID of its
/// writer, which DDS tools list; cut to size.
void transport_sender_text(const transport* bus, uint64_t sender, char* text, size_t size);
/// log: nothing more will come.
bool transport_ended(const transport* bus);

/// Encode, fill in crc32 and send. 0, or -1 when the bus refused (counted, never fatal).
int  transport_publish_state(transport* bus, const verge_vehicle_state_t* state);
int  transport_publish_plan(transport* bus, const verge_vehicle_plan_t* plan);
int  transport_publish_status(transport* bus, const verge_rsu_status_t* status);
/// log: recording only: as above but with the event's own time, and marks.
int  transport_record(transport* bus, int64_t event_utime, const transport_message* message);

transport_stats transport_statistics(const transport* bus);

/// zlib's CRC-32 (polynomial 0xEDB88320) of size bytes.
uint32_t transport_crc32(const void* bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif
