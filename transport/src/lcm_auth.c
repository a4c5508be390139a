#include "lcm_auth.h"

#include "codec.h"
#include "secret.h"
#include "settings.h"

#include <arpa/inet.h>
#include <assert.h>
#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

/// Where the parts of a trailer begin. [B]
enum { AT_MAGIC = 0, AT_KEY = 4, AT_SENDER = 8, AT_STAMP = 16, AT_CODE = 24 };
static_assert(AT_CODE + LCM_AUTH_CODE_SIZE == LCM_AUTH_TRAILER_SIZE, "the code comes last");

static const uint32_t magic = 0x56474831; // "VGH1"

enum { KEY_SIZE_MIN = 32 }; // [B] as long as the hash: shorter ones weaken it (RFC 2104)

static bool networks_read(lcm_auth* self, const transport_options* options, char* error,
                          size_t error_size);
static bool keys_read(lcm_auth* self, const transport_options* options, char* error,
                      size_t error_size);
static bool key_read(lcm_auth_key* key, const char* path, char* error, size_t error_size);
static const lcm_auth_key* key_of(const lcm_auth* self, uint32_t id);
static transport_refusal stamp_judge(lcm_auth* self, int64_t now_utime, uint32_t key_id,
                                     uint64_t sender, int64_t stamp);

static bool fail(char* error, size_t error_size, const char* format, ...)
    __attribute__((format(printf, 3, 4)));

static bool fail(char* error, size_t error_size, const char* format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(error, error_size, format, args);
    va_end(args);
    return false;
}

const transport_setting_def lcm_auth_settings[LCM_AUTH_SETTINGS] = {
    { .name = "lcm.allow", .kind = TRANSPORT_SETTING_TEXT, .list_max = LCM_AUTH_NETWORKS_MAX,
      .text = "networks (10.1.0.0/16) or addresses from which messages are accepted; empty: any "
              "address" },
    { .name = "lcm.keys", .kind = TRANSPORT_SETTING_GROUP, .list_max = LCM_AUTH_KEYS_MAX,
      .text = "each message must be signed with one of these keys; empty: unsigned messages are "
              "accepted" },
    { .name = "lcm.keys.id", .kind = TRANSPORT_SETTING_NUMBER, .min = 1, .max = INT32_MAX,
      .text = "number of the key, contained in each message" },
    { .name = "lcm.keys.file", .kind = TRANSPORT_SETTING_FILE,
      .text = "file with 64 to 128 hexadecimal digits, readable by its owner only (mode 0600)" },
    { .name = "lcm.sign_with", .kind = TRANSPORT_SETTING_NUMBER, .min = 1, .max = INT32_MAX,
      .text = "id of the key that signs the messages of this unit; absent: they are not signed" },
    { .name = "lcm.window_ms", .kind = TRANSPORT_SETTING_NUMBER, .min = 10, .max = 60000,
      .preset = "1000", .unit = "ms",
      .text = "largest age of a signed message, and largest difference of clocks" },
};

bool lcm_auth_init(lcm_auth* self, const transport_options* options, char* error,
                   size_t error_size)
{
    memset(self, 0, sizeof *self);
    self->window_us = (int64_t)setting_number(options, "lcm.window_ms", 0) * 1000;
    if (!networks_read(self, options, error, error_size) ||
        !keys_read(self, options, error, error_size)) {
        lcm_auth_wipe(self);
        return false;
    }
    const uint32_t sign_with = setting_number(options, "lcm.sign_with", 0);
    if (sign_with == 0) {
        return true;
    }
    self->own_key = key_of(self, sign_with);
    if (self->own_key == NULL) {
        lcm_auth_wipe(self);
        return fail(error, error_size, "lcm.sign_with: is %u, expected the id of one of lcm.keys",
                    sign_with);
    }
    if (getrandom(&self->own_sender, sizeof self->own_sender, 0) !=
        (ssize_t)sizeof self->own_sender) {
        lcm_auth_wipe(self);
        return fail(error, error_size, "lcm.sign_with: the system gives no random numbers (%s)",
                    strerror(errno));
    }
    return true;
}

void lcm_auth_wipe(lcm_auth* self)
{
    hmac_wipe(self, sizeof *self);
}

/// Datagrams to a group on loopback have the source 0.0.0.0, unless the route names another one.
/// Other machines cannot use it: the kernel drops multicast datagrams that arrive with this source.
bool lcm_auth_allows(const lcm_auth* self, uint32_t address)
{
    address = address == INADDR_ANY ? INADDR_LOOPBACK : address;
    for (uint32_t i = 0; i < self->network_count; ++i) {
        if ((address & self->networks[i].mask) == self->networks[i].address) {
            return true;
        }
    }
    return self->network_count == 0;
}

void lcm_auth_sign(lcm_auth* self, int64_t now_utime, const struct iovec* parts, int part_count,
                   uint8_t trailer[LCM_AUTH_TRAILER_SIZE])
{
    enum { PARTS_MAX = 3 };
    assert(self->own_key != NULL && part_count < PARTS_MAX);

    // If the clock stands or steps back, the stamp still increases.
    self->own_stamp = now_utime > self->own_stamp ? now_utime : self->own_stamp + 1;
    codec_put_u32(trailer + AT_MAGIC, magic);
    codec_put_u32(trailer + AT_KEY, self->own_key->id);
    codec_put_u64(trailer + AT_SENDER, self->own_sender);
    codec_put_u64(trailer + AT_STAMP, (uint64_t)self->own_stamp);

    struct iovec covered[PARTS_MAX];
    memcpy(covered, parts, (size_t)part_count * sizeof *parts);
    covered[part_count] = (struct iovec){ .iov_base = trailer, .iov_len = AT_CODE };
    uint8_t code[HMAC_SIZE];
    hmac_sha256(&self->own_key->hmac, covered, part_count + 1, code);
    memcpy(trailer + AT_CODE, code, LCM_AUTH_CODE_SIZE);
}

/// The code is checked first, so that no other field of a forged message is used.
transport_refusal lcm_auth_verify(lcm_auth* self, int64_t now_utime, const uint8_t* event,
                                  size_t size)
{
    if (!lcm_auth_signed(event, size)) {
        return TRANSPORT_UNSIGNED;
    }
    const uint8_t*      trailer = event + size - LCM_AUTH_TRAILER_SIZE;
    const uint32_t      key_id = codec_get_u32(trailer + AT_KEY);
    const lcm_auth_key* key = key_of(self, key_id);
    if (key == NULL) {
        return TRANSPORT_UNKNOWN_KEY;
    }
    const struct iovec covered = {
        .iov_base = (void*)(uintptr_t)event,
        .iov_len = size - LCM_AUTH_CODE_SIZE,
    };
    uint8_t code[HMAC_SIZE];
    hmac_sha256(&key->hmac, &covered, 1, code);
    if (!hmac_same(code, trailer + AT_CODE, LCM_AUTH_CODE_SIZE)) {
        return TRANSPORT_FORGED;
    }
    return stamp_judge(self, now_utime, key_id, codec_get_u64(trailer + AT_SENDER),
                       (int64_t)codec_get_u64(trailer + AT_STAMP));
}

bool lcm_auth_signed(const uint8_t* bytes, size_t size)
{
    return size >= LCM_AUTH_TRAILER_SIZE &&
           codec_get_u32(bytes + size - LCM_AUTH_TRAILER_SIZE) == magic;
}

const char* lcm_auth_text(transport_refusal refusal)
{
    switch (refusal) {
    case TRANSPORT_ADMITTED: return "admitted";
    case TRANSPORT_NOT_ALLOWED: return "its address is not in lcm.allow";
    case TRANSPORT_UNSIGNED: return "its sender needs lcm.keys and lcm.sign_with";
    case TRANSPORT_UNKNOWN_KEY: return "its key id is not in lcm.keys";
    case TRANSPORT_FORGED: return "or its sender has another key under the same id";
    case TRANSPORT_UNTIMELY: return "sent long ago, or the clocks differ by more than "
                                    "lcm.window_ms";
    case TRANSPORT_REPLAYED: return "this sender's message was heard before";
    case TRANSPORT_REFUSALS: break;
    }
    return "unknown";
}

// ---- replay -------------------------------------------------------------------------------

/// A place whose stamp has left the window is free: earlier messages of that sender are refused by
/// their age, unless the local clock steps back by more than the window.
static transport_refusal stamp_judge(lcm_auth* self, int64_t now_utime, uint32_t key_id,
                                     uint64_t sender, int64_t stamp)
{
    const int64_t oldest = now_utime - self->window_us;
    if (stamp <= 0 || stamp < oldest || stamp > now_utime + self->window_us) {
        return TRANSPORT_UNTIMELY;
    }
    lcm_auth_sender* place = NULL;
    for (uint32_t i = 0; i < LCM_AUTH_SENDERS_MAX; ++i) {
        lcm_auth_sender* known = &self->senders[i];
        if (known->stamp != 0 && known->sender == sender && known->key_id == key_id) {
            place = known;
            break;
        }
        if (place == NULL && known->stamp < oldest) {
            place = known;
        }
    }
    if (place == NULL) {
        return TRANSPORT_REPLAYED;
    }
    if (place->sender == sender && place->key_id == key_id && stamp <= place->stamp) {
        return TRANSPORT_REPLAYED;
    }
    *place = (lcm_auth_sender){ .sender = sender, .stamp = stamp, .key_id = key_id };
    return TRANSPORT_ADMITTED;
}

static const lcm_auth_key* key_of(const lcm_auth* self, uint32_t id)
{
    for (uint32_t i = 0; i < self->key_count; ++i) {
        if (self->keys[i].id == id) {
            return &self->keys[i];
        }
    }
    return NULL;
}

// ---- settings -----------------------------------------------------------------------------

/// "10.1.0.0/16", or an address alone.
static bool network_parse(lcm_auth_network* network, const char* text)
{
    char         address[INET_ADDRSTRLEN];
    const size_t length = strcspn(text, "/");
    if (length >= sizeof address) {
        return false;
    }
    memcpy(address, text, length);
    address[length] = '\0';
    struct in_addr parsed;
    if (inet_pton(AF_INET, address, &parsed) != 1) {
        return false;
    }
    unsigned long prefix = 32;
    if (text[length] == '/') {
        const char* digits = text + length + 1;
        char*       end = NULL;
        prefix = strtoul(digits, &end, 10);
        if (*digits < '0' || *digits > '9' || *end != '\0' || prefix > 32) {
            return false;
        }
    }
    network->mask = prefix == 0 ? 0 : UINT32_MAX << (32 - prefix);
    network->address = ntohl(parsed.s_addr);
    return (network->address & ~network->mask) == 0;
}

static bool networks_read(lcm_auth* self, const transport_options* options, char* error,
                          size_t error_size)
{
    const uint32_t count = setting_count(options, "lcm.allow");
    assert(count <= LCM_AUTH_NETWORKS_MAX);
    for (uint32_t i = 0; i < count; ++i) {
        const char* network = setting_text(options, "lcm.allow", i);
        if (!network_parse(&self->networks[i], network)) {
            return fail(error, error_size,
                        "lcm.allow[%u]: is \"%.40s\", expected a network such as 10.1.0.0/16, "
                        "with no bit set behind its prefix, or an address", i, network);
        }
    }
    self->network_count = count;
    return true;
}

static bool keys_read(lcm_auth* self, const transport_options* options, char* error,
                      size_t error_size)
{
    const uint32_t count = setting_count(options, "lcm.keys.id");
    assert(count <= LCM_AUTH_KEYS_MAX && count == setting_count(options, "lcm.keys.file"));
    if (count > 0 && !hmac_available()) {
        return fail(error, error_size, "lcm.keys: this build has no OpenSSL, expected none; "
                                       "VERGE_OPENSSL=ON builds with it");
    }
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t id = setting_number(options, "lcm.keys.id", i);
        if (key_of(self, id) != NULL) {
            return fail(error, error_size, "lcm.keys[%u].id: is %u, expected an id of its own", i,
                        id);
        }
        const int named = snprintf(error, error_size, "lcm.keys[%u].file: ", i);
        if (!key_read(&self->keys[i], setting_text(options, "lcm.keys.file", i), error + named,
                      error_size - (size_t)named)) {
            return false;
        }
        self->keys[i].id = id;
        ++self->key_count;
    }
    error[0] = '\0';
    return true;
}

static uint8_t hex_value(char digit)
{
    return (uint8_t)(digit <= '9' ? digit - '0' : (digit | 0x20) - 'a' + 10);
}

static bool key_read(lcm_auth_key* key, const char* path, char* error, size_t error_size)
{
    enum { DIGITS_MAX = 2 * HMAC_KEY_SIZE_MAX };
    char      text[DIGITS_MAX + 2]; // a newline; one more shows that it is too long
    const int fd = secret_open(path, error, error_size);
    if (fd < 0) {
        return false;
    }
    const ssize_t got = read(fd, text, sizeof text);
    close(fd);
    size_t size = got > 0 ? (size_t)got : 0;
    if (size > 0 && text[size - 1] == '\n') {
        --size;
    }
    uint8_t bytes[HMAC_KEY_SIZE_MAX];
    bool    good = size % 2 == 0 && size >= 2 * KEY_SIZE_MIN && size <= DIGITS_MAX;
    for (size_t i = 0; good && i < size; i += 2) {
        good = isxdigit((unsigned char)text[i]) && isxdigit((unsigned char)text[i + 1]);
        bytes[i / 2] = (uint8_t)(hex_value(text[i]) << 4 | hex_value(text[i + 1]));
    }
    if (good) {
        hmac_key_init(&key->hmac, bytes, size / 2);
    }
    hmac_wipe(text, sizeof text);
    hmac_wipe(bytes, sizeof bytes);
    return good || fail(error, error_size,
                        "%s: is no key, expected %d to %d hexadecimal digits on one line, such as "
                        "openssl rand -hex 32 gives",
                        path, 2 * KEY_SIZE_MIN, DIGITS_MAX);
}
