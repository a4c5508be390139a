/// One interface to every bus: open by URL, poll a descriptor, drain messages into an array,
/// publish, read the counters.
///
///     transport* bus;
///     char error[256];
///     const char* url = "lcm:udpm://239.255.76.67:7667?ttl=0";
///     if (transport_open(&bus, url, TRANSPORT_STATES, error, sizeof error) != TRANSPORT_OK) ...
///     poll(transport_fd(bus)); n = transport_drain(bus, messages, 64);
///     transport_publish_plan(bus, &plan);
///
/// Memory      transport_open() allocates and transport_close() frees; no other function does. An
///             exception is dds: Cyclone DDS allocates at any time in its own threads and in those
///             that publish and drain. These threads must not be the planner's.
/// Threads     One thread may drain while another one publishes; each function in one at a time.
/// URLs        lcm:URL   an LCM UDP multicast URL, udpm://ADDRESS:PORT?ttl=N&recv_buf_size=N, each
///                       part optional as in LCM. A program also receives its own messages; they
///                       count as foreign unless their kind is requested. Messages that LCM would
///                       split into fragments are refused.
///             loop:NAME within the process: every open end of a name (which may be empty) receives
///                       from the others. A full queue drops its oldest message.
///             dds:N     DDS domain N, 0 to 230 (Cyclone DDS), if built in. Topics have the names
///                       of LCM's channels. States and statuses are best effort: of each vehicle
///                       (each unit) the newest message waits, older ones are dropped, and the
///                       order between vehicles is not kept. So it is with signals, by lane. Plans
///                       are sent again until they arrive or are replaced, for at most three
///                       seconds.
///             unix:PATH a Unix datagram socket of this machine, absolute or relative, 1 to 100
///                       characters, in one direction. A program that receives binds PATH (mode
///                       0660) and removes it at close. A socket left there by a program that has
///                       ended is replaced; one in use, or another file, is refused. A program that
///                       requests no kind sends to PATH, also to a receiver that starts later or
///                       again. Sending fails while no program receives there or its queue is full
///                       (the kernel's net.unix.max_dgram_qlen, often 10 messages). Receiving and
///                       announcing messages to send on one URL is refused. The datagrams are those
///                       of LCM.
///             log:FILE  an LCM event log: a regular file to read, or any file to write if opened
///                       with TRANSPORT_RECORD. Written events are in the file at each mark and at
///                       close. Writing blocks while the file does (a FIFO whose reader is slow).
///                       A FIFO is opened with or without a reader.
/// Senders     Every message has the id of its sender: on LCM address and port, on DDS the writer,
///             on loop: the end, on unix: the process id. A log has none.
/// Loss        If an open bus fails, its errors are counted, and it is opened again automatically
///             with the same descriptor. For that, drain once a second even if no message waits.
#ifndef VERGE_TRANSPORT_H
#define VERGE_TRANSPORT_H

#include "verge_lane_signal_t.h"
#include "verge_rsu_status_t.h"
#include "verge_vehicle_plan_t.h"
#include "verge_vehicle_state_t.h"
#include "verge_vehicle_trajectory_t.h"

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

/// Options of buses. All zero: the defaults. One set of options may serve all buses of a program:
/// each bus uses its own settings. Strings and arrays have to live until transport_open_with()
/// returns.
typedef struct transport_options {
    const transport_setting* settings;
    uint32_t                 setting_count;
    /// Called with faults of the bus or its middleware, one line each, rate-limited, from within
    /// transport_drain(). May be null. log_context has to live as long as the bus.
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

/// Description of a setting, for programs that read settings from a file.
typedef struct transport_setting_def {
    const char*            name;     ///< "BUS.KEY", of a member of an object "BUS.KEY.MEMBER"
    transport_setting_kind kind;
    uint32_t               list_max; ///< longest list; 0: KEY is not a list
    uint32_t               min, max; ///< of a number, both included
    const char*            preset;   ///< default; null: none
    const char*            unit;     ///< null: none
    const char*            text;     ///< its meaning
} transport_setting_def;

/// The settings of all buses that are built in, grouped by bus. Null: index is beyond the last one.
/// Static lifetime.
const transport_setting_def* transport_setting_at(uint32_t index);

typedef enum transport_kind {
    TRANSPORT_NONE = 0,
    TRANSPORT_STATE,  ///< VERGE_STATE, verge_vehicle_state_t
    TRANSPORT_PLAN,   ///< VERGE_PLAN, verge_vehicle_plan_t
    TRANSPORT_STATUS, ///< VERGE_STATUS, verge_rsu_status_t
    TRANSPORT_SIGNAL, ///< VERGE_SIGNAL, verge_lane_signal_t
    TRANSPORT_TRAJECTORY, ///< VERGE_TRAJECTORY, verge_vehicle_trajectory_t
    TRANSPORT_MARK,   ///< VERGE_CYCLE, only in logs written by the daemon: a cycle or overrun mark
} transport_kind;

/// The kinds of messages to receive and to send (bits). Other kinds are skipped.
enum {
    TRANSPORT_STATES = 1u << TRANSPORT_STATE,
    TRANSPORT_PLANS = 1u << TRANSPORT_PLAN,
    TRANSPORT_STATUSES = 1u << TRANSPORT_STATUS,
    TRANSPORT_SIGNALS = 1u << TRANSPORT_SIGNAL,
    TRANSPORT_TRAJECTORIES = 1u << TRANSPORT_TRAJECTORY,
    TRANSPORT_MARKS = 1u << TRANSPORT_MARK,
    /// Kinds that will be sent: dds: begins to discover their readers at open. The first messages
    /// of a kind that was not announced may not reach any reader.
    TRANSPORT_SENDS_STATES = 1u << (8 + TRANSPORT_STATE),
    TRANSPORT_SENDS_PLANS = 1u << (8 + TRANSPORT_PLAN),
    TRANSPORT_SENDS_STATUSES = 1u << (8 + TRANSPORT_STATUS),
    TRANSPORT_SENDS_SIGNALS = 1u << (8 + TRANSPORT_SIGNAL),
    TRANSPORT_SENDS_TRAJECTORIES = 1u << (8 + TRANSPORT_TRAJECTORY),
    TRANSPORT_RECORD = 1u << 16, ///< log: only: create the file and write what is published
};

/// A mark in the log of a daemon: the instant of a cycle.
typedef struct transport_mark {
    int64_t utime;    ///< [us] plan instant
    int64_t cycle;
    int32_t overrun;  ///< 1: at utime this cycle was still being planned, and the remainders of
                      ///< the plans before it were sent (messages with VERGE_REASON_OVERRUN)
} transport_mark;

/// A received, decoded message. Its crc32 is correct; its values are not checked (wire.h).
typedef struct transport_message {
    transport_kind kind;
    int64_t        arrival_utime; ///< [us] clock at drain; the event's own time for log:
    uint64_t       sender;        ///< id among the senders of this bus; 0: unknown
    uint32_t       bus;           ///< 0; for a caller with several buses to number them
    union {
        verge_vehicle_state_t state;
        verge_vehicle_plan_t  plan;
        verge_rsu_status_t    status;
        verge_lane_signal_t   signal;
        verge_vehicle_trajectory_t trajectory;
        transport_mark        mark;
    } as;
} transport_message;

/// Why a message on an lcm: bus with an allow list or keys was refused.
typedef enum transport_refusal {
    TRANSPORT_ADMITTED = 0, ///< not refused
    TRANSPORT_NOT_ALLOWED,  ///< its source address is not in the allow list
    TRANSPORT_UNSIGNED,
    TRANSPORT_UNKNOWN_KEY,  ///< signed with a key id that is not configured
    TRANSPORT_FORGED,       ///< the signature does not match the key and the bytes
    TRANSPORT_UNTIMELY,     ///< its stamp differs from the local clock by more than window_ms
    TRANSPORT_REPLAYED,     ///< received before, or too many senders within the window to check
    TRANSPORT_REFUSALS,
} transport_refusal;

typedef struct transport_stats {
    uint64_t received;  ///< messages returned by transport_drain()
    uint64_t published;
    uint64_t malformed; ///< truncated, oversized, of another type, wrong crc32, or not LCM
    uint64_t foreign;   ///< well-formed messages of channels that were not requested
    uint64_t dropped;   ///< by the kernel's socket buffer (SO_RXQ_OVFL) or a full loop: queue;
                        ///< log: when recording, events that could not be written
    uint64_t errors;    ///< failed sends or receives
    uint64_t refused[TRANSPORT_REFUSALS]; ///< by transport_refusal
    uint64_t lost;      ///< dds: only: senders that left or fell silent, and deadlines missed
} transport_stats;

/// "not_allowed", "unsigned", ...
const char* transport_refusal_name(transport_refusal refusal);
/// The sum of all refusals.
uint64_t transport_refused(const transport_stats* stats);

/// The result of transport_open().
typedef enum transport_result {
    TRANSPORT_OK = 0,
    TRANSPORT_BAD_URL = -1,     ///< not the URL of a bus that is built in, or invalid options
    TRANSPORT_UNAVAILABLE = -2, ///< the bus is not available: no multicast route, interface or file
} transport_result;

/// Null: the URL begins like one of a bus that is built in. Otherwise "what is wrong, what was
/// expected".
const char* transport_url_fault(const char* url);

/// True: participants without a key or certificate can receive from this bus or send on it, because
/// it uses more than the loopback interface and has no signatures or encryption, or because rules
/// of DDS Security admit them. Then words holds the reason and the remedy. False for a malformed
/// URL.
bool transport_exposed(const char* url, const transport_options* options, char* words,
                       size_t words_size);

/// True: the options require signatures or certificates on this bus. Rules of DDS Security may
/// admit others nevertheless, see transport_exposed().
bool transport_secured(const char* url, const transport_options* options);

/// True: the certificates or permissions for this bus expire. Then utime [us] is the earliest
/// expiry date, and words names the file and the remedy. Unreadable files are ignored.
bool transport_expires(const char* url, const transport_options* options, int64_t* utime,
                       char* words, size_t words_size);

/// Opens a bus. On failure *bus is null and error holds one line with the reason and the remedy.
/// options null: the defaults.
int  transport_open_with(transport** bus, const char* url, unsigned receive,
                         const transport_options* options, char* error, size_t error_size);
int  transport_open(transport** bus, const char* url, unsigned receive, char* error,
                    size_t error_size);
void transport_close(transport* bus); ///< null: no effect

/// Descriptor for poll(); -1 for log: (always ready until transport_ended()) and for an lcm: or
/// unix: bus that was opened only to send.
int  transport_fd(const transport* bus);
/// Takes at most max waiting messages and never blocks. Returns their number. 0 may also mean that
/// messages of other channels were skipped and more are waiting, as poll() shows.
uint32_t transport_drain(transport* bus, transport_message* messages, uint32_t max);
/// A sender as text: on LCM its address as 10.1.0.7:40312, on DDS the GUID of its writer, as DDS
/// tools list it, on unix: "pid 4711"; cut to size.
void transport_sender_text(const transport* bus, uint64_t sender, char* text, size_t size);
/// log: True: all messages were read.
bool transport_ended(const transport* bus);

/// Compute crc32, encode and send. 0, or -1 if sending failed (counted; the bus stays usable).
int  transport_publish_state(transport* bus, const verge_vehicle_state_t* state);
int  transport_publish_plan(transport* bus, const verge_vehicle_plan_t* plan);
int  transport_publish_status(transport* bus, const verge_rsu_status_t* status);
int  transport_publish_signal(transport* bus, const verge_lane_signal_t* signal);
int  transport_publish_trajectory(transport* bus, const verge_vehicle_trajectory_t* trajectory);
/// log: when recording only: as above, for all kinds and marks, with the given time of the event.
int  transport_record(transport* bus, int64_t event_utime, const transport_message* message);

transport_stats transport_statistics(const transport* bus);

/// zlib's CRC-32 (polynomial 0xEDB88320) of size bytes.
uint32_t transport_crc32(const void* bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif
