/// Access control of an lcm: bus: a list of source networks, and messages signed with a shared key.
///
/// Trailer     40 bytes behind the payload, numbers big-endian:
///                 "VGH1" | key id, 4 | sender, 8 | stamp, 8 | first half of the HMAC-SHA256, 16
///             The code covers every byte after LCM's header and before itself: channel, payload,
///             key id, sender, stamp. LCM's decoders ignore bytes after a message, so a program
///             without keys can read signed messages.
/// Replay      sender is drawn at random when a bus is opened. stamp is the instant of sending
///             [us since 1970], increased if it is not larger than the sender's last one. A
///             receiver accepts stamps within window_ms of its own clock, and only growing ones
///             from each sender. It remembers a sender for the length of the window; older messages
///             are refused by their age. The source address has no influence, so a copy from
///             another address is a replay, too. A receiver that has just started accepts a replay
///             of a message within the window once.
/// Memory      All in the struct, about 10 KiB.
/// Threads     lcm_auth_sign() and lcm_auth_verify() may run in two threads, one each.
#ifndef LCM_AUTH_H
#define LCM_AUTH_H

#include "hmac.h"
#include "verge/transport.h"

enum {
    LCM_AUTH_TRAILER_SIZE = 40,
    LCM_AUTH_CODE_SIZE = 16,    // of the HMAC
    LCM_AUTH_SENDERS_MAX = 256, // within a window; only senders with a key are counted
    LCM_AUTH_NETWORKS_MAX = 32,
    LCM_AUTH_KEYS_MAX = 16,
    LCM_AUTH_SETTINGS = 6,
};

/// The settings "lcm.allow", "lcm.keys" and so on.
extern const transport_setting_def lcm_auth_settings[LCM_AUTH_SETTINGS];

typedef struct lcm_auth_network {
    uint32_t address, mask; // host byte order
} lcm_auth_network;

typedef struct lcm_auth_key {
    uint32_t id;
    hmac_key hmac;
} lcm_auth_key;

typedef struct lcm_auth_sender {
    uint64_t sender;
    int64_t  stamp;  // [us] of its last message; 0: a free place
    uint32_t key_id;
} lcm_auth_sender;

/// All zero: all messages are accepted, and none is signed.
typedef struct lcm_auth {
    lcm_auth_network networks[LCM_AUTH_NETWORKS_MAX];
    uint32_t         network_count; // 0: any address
    lcm_auth_key     keys[LCM_AUTH_KEYS_MAX];
    uint32_t         key_count;     // 0: unsigned messages are accepted
    int64_t          window_us;
    // Sending.
    const lcm_auth_key* own_key;    // null: nothing is signed
    uint64_t         own_sender;
    int64_t          own_stamp;     // [us] of the last message sent
    // Receiving.
    lcm_auth_sender  senders[LCM_AUTH_SENDERS_MAX];
} lcm_auth;

/// Reads the key files that the options name. False: error holds one line that begins with the
/// setting's name. The struct must not be moved afterwards.
bool lcm_auth_init(lcm_auth* self, const transport_options* options, char* error,
                   size_t error_size);
void lcm_auth_wipe(lcm_auth* self);

/// address: an IPv4 source address in host byte order; 0.0.0.0 counts as 127.0.0.1.
bool lcm_auth_allows(const lcm_auth* self, uint32_t address);

/// The trailer for an event that consists of these parts: channel with its terminator, payload.
/// own_key must not be null.
void lcm_auth_sign(lcm_auth* self, int64_t now_utime, const struct iovec* parts, int part_count,
                   uint8_t trailer[LCM_AUTH_TRAILER_SIZE]);

/// event: all bytes after LCM's header. TRANSPORT_ADMITTED only with a valid trailer.
transport_refusal lcm_auth_verify(lcm_auth* self, int64_t now_utime, const uint8_t* event,
                                  size_t size);

/// True: these bytes end in a trailer, valid or not.
bool lcm_auth_signed(const uint8_t* bytes, size_t size);

/// The text for a refusal: the fault of the message and the remedy.
const char* lcm_auth_text(transport_refusal refusal);

#endif
