/// Goal: an lcm: bus with an allow list or keys accepts only allowed or signed messages, each once,
///       and counts and logs every other one under its cause.
/// Method: HMAC against the vectors of RFC 4231; the trailer by hand; then real sockets: messages
///         of a good sender are captured on the wire, changed, and sent again from other addresses.
#include "check.h"
#include "codec.h"
#include "lcm_auth.h"
#include "rng.h"

#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define GROUP "239.255.76.67"
enum { PORT = 27667, HEADER = 8, ROOM = 2048 };
static const char url[] = "lcm:udpm://239.255.76.67:27667?ttl=0";

static char key_one[] = "/tmp/verge_test_key_XXXXXX";
static char key_two[] = "/tmp/verge_test_key_XXXXXX";
static char key_bad[] = "/tmp/verge_test_key_XXXXXX";

static void write_key(const char* path, const char* text, mode_t mode)
{
    FILE* file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
    assert_int_equal(chmod(path, mode), 0);
}

static int make_keys(void** state)
{
    (void)state;
    char* const paths[] = { key_one, key_two, key_bad };
    char        text[66];
    for (int i = 0; i < 3; ++i) {
        close(mkstemp(paths[i]));
        memset(text, "1aF"[i], 64);
        memcpy(text + 64, "\n", 2);
        write_key(paths[i], text, 0600);
    }
    return 0;
}

static int remove_keys(void** state)
{
    (void)state;
    return remove(key_one) | remove(key_two) | remove(key_bad);
}

/// Everything but the cases without keys needs OpenSSL.
static void need_openssl(void)
{
    if (!hmac_available()) {
        printf("             SKIPPED: built without OpenSSL (VERGE_OPENSSL=OFF)\n");
        skip();
    }
}

// ---------------------------------------------------------------- the code

static size_t from_hex(const char* hex, uint8_t* bytes)
{
    size_t   size = 0;
    unsigned value;
    for (; sscanf(hex + 2 * size, "%2x", &value) == 1; ++size) {
        bytes[size] = (uint8_t)value;
    }
    return size;
}

static void test_the_code_is_that_of_rfc_4231(void** state)
{
    (void)state;
    need_openssl();
    static const struct { const char *key, *data, *code; } vectors[] = {
        { "0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b0b", "4869205468657265",          // case 1
          "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7" },
        { "4a656665", "7768617420646f2079612077616e7420666f72206e6f7468696e673f",   // case 2
          "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843" },
        { "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa",                              // case 3
          "dddddddddddddddddddddddddddddddddddddddddddddddddd"
          "dddddddddddddddddddddddddddddddddddddddddddddddddd",
          "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe" },
        { "0102030405060708090a0b0c0d0e0f10111213141516171819",                    // case 4
          "cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd"
          "cdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcdcd",
          "82558a389a443c0ea4cc819899f2083a85f0faa3e578f8077a2e3ff46729665b" },
        { "0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c0c",                              // case 5
          "546573742057697468205472756e636174696f6e", "a3b6167473100ee06e0c796c2955552b" },
    };
    for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; ++i) {
        uint8_t      key[64], data[64], expected[HMAC_SIZE], code[HMAC_SIZE];
        const size_t key_size = from_hex(vectors[i].key, key);
        const size_t data_size = from_hex(vectors[i].data, data);
        const size_t code_size = from_hex(vectors[i].code, expected);
        hmac_key     prepared;
        hmac_key_init(&prepared, key, key_size);
        for (size_t cut = 0; cut <= data_size; ++cut) { // in two parts, wherever they meet
            const struct iovec parts[] = { { data, cut }, { data + cut, data_size - cut } };
            hmac_sha256(&prepared, parts, 2, code);
            assert_memory_equal(code, expected, code_size);
        }
    }
}

// ---------------------------------------------------------------- the trailer

static const int64_t now = 1700000000000000; // [us]

/// The settings of a test, in a shape that reads well.
typedef struct lcm_key {
    uint32_t    id;
    const char* file;
} lcm_key;
typedef struct lcm_asked {
    const char* const* allow;
    uint32_t           allow_count;
    const lcm_key*     keys;
    uint32_t           key_count, sign_with, window_ms;
} lcm_asked;

enum { SETTINGS_MAX = 16 };
static transport_setting settings[SETTINGS_MAX];
static char              numbers[SETTINGS_MAX][16];
static uint32_t          given;

static void give(const char* name, const char* text)
{
    assert_true(given < SETTINGS_MAX);
    settings[given++] = (transport_setting){ name, text };
}

static void give_number(const char* name, uint32_t value)
{
    snprintf(numbers[given], sizeof numbers[0], "%u", value);
    give(name, numbers[given]);
}

/// Valid until it is called again.
static transport_options options_of(const lcm_asked* asked)
{
    given = 0;
    for (uint32_t i = 0; asked != NULL && i < asked->allow_count; ++i) {
        give("lcm.allow", asked->allow[i]);
    }
    for (uint32_t i = 0; asked != NULL && i < asked->key_count; ++i) {
        give_number("lcm.keys.id", asked->keys[i].id);
        give("lcm.keys.file", asked->keys[i].file);
    }
    if (asked != NULL && asked->sign_with != 0) {
        give_number("lcm.sign_with", asked->sign_with);
    }
    if (asked != NULL && asked->window_ms != 0) {
        give_number("lcm.window_ms", asked->window_ms);
    }
    return (transport_options){ .settings = settings, .setting_count = given };
}

static void auth_or_fail(lcm_auth* auth, const lcm_asked* asked)
{
    char error[256] = "";
    const transport_options options = options_of(asked);
    if (!lcm_auth_init(auth, &options, error, sizeof error)) {
        fail_msg("%s", error);
    }
}

/// An event of this text, signed at utime; returns its size.
static size_t sign(lcm_auth* auth, int64_t utime, const char* text, uint8_t event[ROOM])
{
    const size_t       size = strlen(text);
    const struct iovec parts[] = { { event, size } };
    memcpy(event, text, size);
    lcm_auth_sign(auth, utime, parts, 1, event + size);
    return size + LCM_AUTH_TRAILER_SIZE;
}

static void test_any_byte_changed_is_forged_or_no_signature_at_all(void** state)
{
    (void)state;
    need_openssl();
    static lcm_auth           sender, receiver;
    const lcm_key   keys[] = { { 1, key_one }, { 2, key_two } };
    const lcm_asked  asked = { .keys = keys, .key_count = 2, .sign_with = 2 };
    uint8_t                   event[ROOM];
    auth_or_fail(&sender, &asked);
    auth_or_fail(&receiver, &asked);
    const size_t size = sign(&sender, now, "VERGE_STATE and a payload", event);

    for (size_t i = 0; i < size; ++i) {
        for (int bit = 0; bit < 8; ++bit) {
            event[i] ^= (uint8_t)(1 << bit);
            const transport_refusal refusal = lcm_auth_verify(&receiver, now, event, size);
            event[i] ^= (uint8_t)(1 << bit);
            const size_t at = i - (size - LCM_AUTH_TRAILER_SIZE); // wraps before the trailer
            if (at < 4) {
                assert_int_equal(refusal, TRANSPORT_UNSIGNED);
            } else if (at < 8 && !(at == 7 && bit < 2)) {
                assert_int_equal(refusal, TRANSPORT_UNKNOWN_KEY);
            } else if (at < 8) { // key 2 becomes 3 or 0
                assert_true(refusal == TRANSPORT_UNKNOWN_KEY || refusal == TRANSPORT_FORGED);
            } else {
                assert_int_equal(refusal, TRANSPORT_FORGED);
            }
        }
    }
    for (size_t cut = 0; cut < size; ++cut) {
        assert_int_not_equal(lcm_auth_verify(&receiver, now, event, cut), TRANSPORT_ADMITTED);
    }
    assert_int_equal(lcm_auth_verify(&receiver, now, event, size), TRANSPORT_ADMITTED);
}

static void test_a_message_counts_once_and_within_the_window(void** state)
{
    (void)state;
    need_openssl();
    static lcm_auth          sender, receiver;
    const lcm_key  key = { 7, key_one };
    const lcm_asked asked = { .keys = &key, .key_count = 1, .sign_with = 7,
                                       .window_ms = 500 };
    uint8_t first[ROOM], second[ROOM], early[ROOM];
    auth_or_fail(&sender, &asked);
    auth_or_fail(&receiver, &asked);

    const size_t size = sign(&sender, now, "one", first);
    sign(&sender, now - 1000, "two", second); // its clock stepped back: the stamp goes on
    assert_int_equal(lcm_auth_verify(&receiver, now, second, size), TRANSPORT_ADMITTED);
    assert_int_equal(lcm_auth_verify(&receiver, now, second, size), TRANSPORT_REPLAYED);
    assert_int_equal(lcm_auth_verify(&receiver, now, first, size), TRANSPORT_REPLAYED);

    // The window's edges, by a receiver that has heard nothing yet each time.
    static const struct { int64_t behind; transport_refusal refusal; } edges[] = {
        { 500000, TRANSPORT_ADMITTED },  { 500001, TRANSPORT_UNTIMELY },
        { -500000, TRANSPORT_ADMITTED }, { -500001, TRANSPORT_UNTIMELY },
    };
    for (size_t i = 0; i < 4; ++i) {
        auth_or_fail(&receiver, &asked);
        assert_int_equal(lcm_auth_verify(&receiver, now + edges[i].behind, first, size),
                         edges[i].refusal);
    }
    // A message from the future keeps out what the same sender says until then, not others.
    auth_or_fail(&receiver, &asked);
    sign(&sender, now + 400000, "now", early);
    assert_int_equal(lcm_auth_verify(&receiver, now, early, size), TRANSPORT_ADMITTED);
    assert_int_equal(lcm_auth_verify(&receiver, now, second, size), TRANSPORT_REPLAYED);
    lcm_auth_wipe(&sender);
    auth_or_fail(&sender, &asked); // started again: another sender
    sign(&sender, now, "new", first);
    assert_int_equal(lcm_auth_verify(&receiver, now, first, size), TRANSPORT_ADMITTED);
}

static void test_senders_beyond_the_table_wait_until_others_are_silent(void** state)
{
    (void)state;
    need_openssl();
    static lcm_auth          sender, receiver;
    const lcm_key  key = { 1, key_one };
    const lcm_asked asked = { .keys = &key, .key_count = 1, .sign_with = 1 };
    uint8_t event[ROOM], first[ROOM];
    size_t  size = 0;
    auth_or_fail(&sender, &asked);
    auth_or_fail(&receiver, &asked);
    for (uint64_t i = 0; i < LCM_AUTH_SENDERS_MAX; ++i) {
        sender.own_sender = i; // 0 is as good as any
        size = sign(&sender, now, "x", i == 0 ? first : event);
        assert_int_equal(lcm_auth_verify(&receiver, now, i == 0 ? first : event, size),
                         TRANSPORT_ADMITTED);
    }
    sender.own_sender = LCM_AUTH_SENDERS_MAX;
    sign(&sender, now, "x", event);
    assert_int_equal(lcm_auth_verify(&receiver, now, event, size), TRANSPORT_REPLAYED);
    assert_int_equal(lcm_auth_verify(&receiver, now, first, size), TRANSPORT_REPLAYED);

    const int64_t later = now + 1100000;
    sign(&sender, later, "x", event);
    assert_int_equal(lcm_auth_verify(&receiver, later, event, size), TRANSPORT_ADMITTED);
    assert_int_equal(lcm_auth_verify(&receiver, later, first, size), TRANSPORT_UNTIMELY);
}

static void test_random_bytes_are_never_admitted(void** state)
{
    (void)state;
    need_openssl();
    static lcm_auth          receiver;
    const lcm_key  key = { 1, key_one };
    const lcm_asked asked = { .keys = &key, .key_count = 1 };
    uint8_t        event[200];
    test_rng       rng = test_rng_seeded("lcm_auth");
    const uint32_t rounds = test_rounds(20000);
    auth_or_fail(&receiver, &asked);
    for (uint32_t round = 0; round < rounds; ++round) {
        const size_t size = test_rng_below(&rng, sizeof event + 1);
        for (size_t i = 0; i < size; ++i) {
            event[i] = (uint8_t)test_rng_next(&rng);
        }
        if (size >= LCM_AUTH_TRAILER_SIZE) { // half of them look as if they were signed
            uint8_t* trailer = event + size - LCM_AUTH_TRAILER_SIZE;
            codec_put_u32(trailer, round % 2 == 0 ? 0x56474831u : round);
            codec_put_u32(trailer + 4, 1);
            codec_put_u64(trailer + 16, (uint64_t)now);
        }
        assert_int_not_equal(lcm_auth_verify(&receiver, now, event, size), TRANSPORT_ADMITTED);
    }
}

// ---------------------------------------------------------------- what may be asked for

static void check_refused(lcm_asked asked, const char* field, const char* remedy)
{
    char       error[256] = "";
    transport* bus = NULL;
    const transport_options options = options_of(&asked);
    assert_int_equal(transport_open_with(&bus, url, 0, &options, error, sizeof error),
                     TRANSPORT_BAD_URL);
    assert_null(bus);
    if (strncmp(error, field, strlen(field)) != 0 || strstr(error, remedy) == NULL) {
        fail_msg("told as: %s; expected %s... %s", error, field, remedy);
    }
}

static void test_keys_that_cannot_work_are_refused_with_the_remedy(void** state)
{
    (void)state;
    const lcm_key good = { 1, key_one };
    const lcm_key twice[] = { { 1, key_one }, { 1, key_two } };
    const lcm_key zero = { 0, key_one };
    const lcm_key absent = { 1, "/nowhere/at/all.key" };
    const lcm_key folder = { 1, "/tmp" };
    const lcm_key bad = { 1, key_bad };
    if (!hmac_available()) {
        check_refused((lcm_asked){ .keys = &good, .key_count = 1 }, "lcm.keys: ",
                      "VERGE_OPENSSL");
        return;
    }
    check_refused((lcm_asked){ .keys = twice, .key_count = 2 }, "lcm.keys[1].id: ",
                  "an id of its own");
    check_refused((lcm_asked){ .keys = &zero, .key_count = 1 }, "lcm.keys.id: ",
                  "expected 1 to");
    check_refused((lcm_asked){ .keys = &absent, .key_count = 1 },
                  "lcm.keys[0].file: /nowhere/at/all.key: ", "No such file");
    check_refused((lcm_asked){ .keys = &folder, .key_count = 1 },
                  "lcm.keys[0].file: /tmp: ", "a directory");
    check_refused((lcm_asked){ .keys = &good, .key_count = 1, .sign_with = 2 },
                  "lcm.sign_with: ", "one of lcm.keys");
    check_refused((lcm_asked){ .keys = &good, .key_count = 1, .window_ms = 9 },
                  "lcm.window_ms: ", "10 to 60000");

    static const mode_t modes[] = { 0640, 0604, 0620, 0666, 0644 };
    for (size_t i = 0; i < sizeof modes / sizeof modes[0]; ++i) {
        chmod(key_bad, modes[i]);
        check_refused((lcm_asked){ .keys = &bad, .key_count = 1 },
                      "lcm.keys[0].file: ", "chmod 600");
    }
    static const char digits[] =
        "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f"
        "202122232425262728292a2b2c2d2e2f303132333435363738393a3b3c3d3e3f40";
    static const size_t lengths[] = { 0, 1, 62, 63, 65, 130 };
    char                text[140];
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; ++i) {
        snprintf(text, sizeof text, "%.*s\n", (int)lengths[i], digits);
        write_key(key_bad, text, 0600);
        check_refused((lcm_asked){ .keys = &bad, .key_count = 1 },
                      "lcm.keys[0].file: ", "openssl rand -hex 32");
    }
    snprintf(text, sizeof text, "%.63s\x10\n", digits); // a control character is no digit
    write_key(key_bad, text, 0600);
    check_refused((lcm_asked){ .keys = &bad, .key_count = 1 }, "lcm.keys[0].file: ",
                  "openssl rand -hex 32");
}

static void test_networks_are_read_as_written_or_refused(void** state)
{
    (void)state;
    static const char* const wrong[] = { "", "10.1", "10.1.0.0/33", "10.1.0.0/", "10.1.0.1/16",
                                         "10.1.0.0/16 ", "10.1.0.0/-1", "256.0.0.0", "::1",
                                         "10.1.0.0/1x", "1234567890123456789" };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i) {
        check_refused((lcm_asked){ .allow = &wrong[i], .allow_count = 1 },
                      "lcm.allow[0]: ", "such as 10.1.0.0/16");
    }
    static lcm_auth          auth;
    static const char* const right[] = { "10.1.0.0/16", "127.0.0.2", "192.168.7.128/25" };
    auth_or_fail(&auth, &(lcm_asked){ .allow = right, .allow_count = 3 });
    static const struct { const char* address; bool allowed; } cases[] = {
        { "10.1.0.0", true },       { "10.1.255.255", true },   { "10.2.0.0", false },
        { "10.0.255.255", false },  { "127.0.0.2", true },      { "127.0.0.1", false },
        { "127.0.0.3", false },     { "192.168.7.128", true },  { "192.168.7.127", false },
        { "0.0.0.0", false },       { "255.255.255.255", false },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        assert_int_equal(lcm_auth_allows(&auth, ntohl(inet_addr(cases[i].address))),
                         cases[i].allowed);
    }
    static const char* const here[] = { "127.0.0.1" };
    auth_or_fail(&auth, &(lcm_asked){ .allow = here, .allow_count = 1 });
    assert_true(lcm_auth_allows(&auth, 0)); // loopback without a source address
    static const char* const everyone[] = { "0.0.0.0/0" };
    auth_or_fail(&auth, &(lcm_asked){ .allow = everyone, .allow_count = 1 });
    assert_true(lcm_auth_allows(&auth, ntohl(inet_addr("203.0.113.9"))));
    auth_or_fail(&auth, NULL);
    assert_true(lcm_auth_allows(&auth, 0));
}

// ---------------------------------------------------------------- on the wire

static char said[8][256];
static int  said_count;

static void hear(void* context, const char* line)
{
    (void)context;
    snprintf(said[said_count % 8], sizeof said[0], "%s", line);
    ++said_count;
}

static transport* open_signed(unsigned receive, const lcm_asked* asked)
{
    char       error[256] = "";
    transport* bus = NULL;
    transport_options options = options_of(asked);
    options.log = hear;
    if (transport_open_with(&bus, url, receive, &options, error, sizeof error) != TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    said_count = 0;
    return bus;
}

/// A socket that sends to the group from this address of this machine.
static int stranger(const char* address)
{
    const int                fd = socket(AF_INET, SOCK_DGRAM, 0);
    const struct sockaddr_in from = { .sin_family = AF_INET, .sin_addr.s_addr = inet_addr(address) };
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = inet_addr(GROUP),
    };
    assert_int_equal(bind(fd, (const struct sockaddr*)&from, sizeof from), 0);
    assert_int_equal(connect(fd, (const struct sockaddr*)&to, sizeof to), 0);
    return fd;
}

/// A socket that sees every datagram of the group.
static int wire_tap(void)
{
    const int                fd = socket(AF_INET, SOCK_DGRAM, 0);
    const int                on = 1;
    const struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = inet_addr(GROUP),
    };
    const struct ip_mreq group = { .imr_multiaddr.s_addr = inet_addr(GROUP) };
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    assert_int_equal(bind(fd, (const struct sockaddr*)&at, sizeof at), 0);
    assert_int_equal(setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), 0);
    return fd;
}

/// One state of this vehicle as the sender puts it on the wire.
static size_t caught(transport* sender, int tap, int32_t id, uint8_t datagram[ROOM])
{
    const verge_vehicle_state_t state = { .utime = now + id, .vehicle_id = id, .yaw_rate = NAN };
    assert_int_equal(transport_publish_state(sender, &state), 0);
    const ssize_t size = recv(tap, datagram, ROOM, 0);
    assert_true(size > 0);
    return (size_t)size;
}

/// How many messages wait; the last one is in *message.
static uint32_t drained(transport* bus, transport_message* message)
{
    struct pollfd end = { .fd = transport_fd(bus), .events = POLLIN };
    uint32_t      count = 0;
    while (poll(&end, 1, 0) > 0) {
        count += transport_drain(bus, message, 1);
    }
    return count;
}

static void check_refusals(const transport* bus, transport_refusal refusal, uint64_t count)
{
    const transport_stats stats = transport_statistics(bus);
    if (stats.refused[refusal] != count) {
        fail_msg("%s: %" PRIu64 ", expected %" PRIu64, transport_refusal_name(refusal),
                 stats.refused[refusal], count);
    }
}

static void test_messages_without_a_valid_signature_are_refused_and_counted_by_cause(void** state)
{
    (void)state;
    need_openssl();
    const lcm_key  keys[] = { { 1, key_one }, { 2, key_two } };
    const lcm_key  foreign_keys[] = { { 1, key_two } };
    const lcm_key  unknown_keys[] = { { 9, key_one } };
    const lcm_asked asked = { .keys = keys, .key_count = 2, .sign_with = 1 };
    const lcm_asked foreign = { .keys = foreign_keys, .key_count = 1, .sign_with = 1 };
    const lcm_asked unknown = { .keys = unknown_keys, .key_count = 1, .sign_with = 9 };
    transport*        receiver = open_signed(TRANSPORT_STATES, &asked);
    transport*        good = open_signed(0, &asked);
    const int         tap = wire_tap();
    const int         elsewhere = stranger("127.0.0.2");
    uint8_t           datagram[ROOM];
    transport_message message;

    // A good one, once; the same from its own place and from elsewhere: replays.
    const size_t size = caught(good, tap, 5, datagram);
    assert_int_equal(drained(receiver, &message), 1);
    assert_int_equal(message.as.state.vehicle_id, 5);
    for (int i = 0; i < 100; ++i) {
        assert_int_equal(send(elsewhere, datagram, size, 0), size);
        assert_int_equal(drained(receiver, &message), 0);
    }
    check_refusals(receiver, TRANSPORT_REPLAYED, 100);
    CHECK_BETWEEN(said_count, 1, 4); // one in ten seconds, and this is quick
    assert_int_equal(strncmp(said[0], "lcm: a message from 127.0.0.2:", 30), 0);
    assert_non_null(strstr(said[0], " was refused as replayed: "));

    // Changed on the way: forged. LCM's own header is not covered, and repeats change nothing.
    datagram[HEADER + 30] ^= 1;
    send(elsewhere, datagram, size, 0);
    assert_int_equal(drained(receiver, &message), 0);
    check_refusals(receiver, TRANSPORT_FORGED, 1);

    // Without its signature, by other keys, under another id.
    send(elsewhere, datagram, size - LCM_AUTH_TRAILER_SIZE, 0);
    transport* const others[] = { open_signed(0, NULL), open_signed(0, &foreign),
                                  open_signed(0, &unknown) };
    for (int i = 0; i < 3; ++i) {
        const verge_vehicle_state_t car = { .utime = now, .vehicle_id = 6, .yaw_rate = NAN };
        transport_publish_state(others[i], &car);
        transport_close(others[i]);
    }
    assert_int_equal(drained(receiver, &message), 0);
    check_refusals(receiver, TRANSPORT_UNSIGNED, 2);
    check_refusals(receiver, TRANSPORT_FORGED, 2);
    check_refusals(receiver, TRANSPORT_UNKNOWN_KEY, 1);

    // After all that the good sender is heard as before.
    caught(good, tap, 7, datagram);
    transport_message ours;
    assert_int_equal(drained(receiver, &ours), 1);
    assert_int_equal(ours.as.state.vehicle_id, 7);
    const transport_stats stats = transport_statistics(receiver);
    assert_int_equal(stats.received, 2);
    assert_int_equal(transport_refused(&stats), 105);
    assert_int_equal(stats.malformed + stats.foreign + stats.errors, 0);
    transport_close(receiver);
    transport_close(good);
    close(tap);
    close(elsewhere);
}

static void test_a_receiver_without_keys_accepts_signed_messages(void** state)
{
    (void)state;
    need_openssl();
    const lcm_key  key = { 1, key_one };
    const lcm_asked asked = { .keys = &key, .key_count = 1, .sign_with = 1 };
    transport*        receiver = open_signed(TRANSPORT_STATES | TRANSPORT_PLANS, NULL);
    transport*        sender = open_signed(0, &asked);
    const int         tap = wire_tap();
    transport_message message;
    uint8_t           datagram[ROOM];

    const verge_vehicle_plan_t plan = { .vehicle_id = 3, .points[30].x = 12.5 };
    assert_int_equal(transport_publish_plan(sender, &plan), 0);
    const ssize_t size = recv(tap, datagram, sizeof datagram, 0);
    assert_int_equal(size, HEADER + 11 + CODEC_PLAN_SIZE + LCM_AUTH_TRAILER_SIZE);
    CHECK_AT_MOST(size, 1472); // one datagram still
    assert_int_equal(drained(receiver, &message), 1);
    CHECK_NEAR(message.as.plan.points[30].x, 12.5, 0.0);

    // The decoder lcm-gen made, as any program would call it.
    verge_vehicle_plan_t decoded;
    const int used = verge_vehicle_plan_t_decode(datagram, HEADER + 11, (int)size - HEADER - 11,
                                                 &decoded);
    assert_int_equal(used, CODEC_PLAN_SIZE);
    CHECK_NEAR(decoded.points[30].x, 12.5, 0.0);

    // Anything else behind a message is still refused.
    datagram[size - LCM_AUTH_TRAILER_SIZE] ^= 1;
    const int elsewhere = stranger("127.0.0.1");
    send(elsewhere, datagram, (size_t)size, 0);
    assert_int_equal(drained(receiver, &message), 0);
    assert_int_equal(transport_statistics(receiver).malformed, 1);
    transport_close(receiver);
    transport_close(sender);
    close(elsewhere);
    close(tap);
}

static void test_only_messages_from_allowed_addresses_are_accepted(void** state)
{
    (void)state;
    static const char* const allow[] = { "127.0.0.64/26", "127.0.0.9" };
    const lcm_asked asked = { .allow = allow, .allow_count = 2 };
    transport*        receiver = open_signed(TRANSPORT_STATES, &asked);
    transport*        sender = open_signed(0, NULL);
    const int         tap = wire_tap();
    uint8_t           datagram[ROOM];
    transport_message message;
    const size_t      size = caught(sender, tap, 1, datagram); // from 127.0.0.1

    static const struct { const char* address; uint32_t heard; } cases[] = {
        { "127.0.0.9", 1 }, { "127.0.0.63", 0 }, { "127.0.0.64", 1 }, { "127.0.0.127", 1 },
        { "127.0.0.128", 0 },
    };
    assert_int_equal(drained(receiver, &message), 0);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i) {
        const int fd = stranger(cases[i].address);
        send(fd, datagram, size, 0);
        close(fd);
        assert_int_equal(drained(receiver, &message), cases[i].heard);
    }
    check_refusals(receiver, TRANSPORT_NOT_ALLOWED, 3);
    if (strstr(said[0], " was refused as not_allowed: its address is not in lcm.allow") == NULL) {
        fail_msg("told as: %s", said[0]);
    }

    // Messages of channels that were not requested, such as own plans, are ignored from any
    // address.
    const verge_vehicle_plan_t plan = { .vehicle_id = 3 };
    transport_publish_plan(sender, &plan);
    assert_int_equal(drained(receiver, &message), 0);
    check_refusals(receiver, TRANSPORT_NOT_ALLOWED, 3);
    assert_int_equal(transport_statistics(receiver).foreign, 1);
    transport_close(receiver);
    transport_close(sender);
    close(tap);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_code_is_that_of_rfc_4231),
        cmocka_unit_test(test_any_byte_changed_is_forged_or_no_signature_at_all),
        cmocka_unit_test(test_a_message_counts_once_and_within_the_window),
        cmocka_unit_test(test_senders_beyond_the_table_wait_until_others_are_silent),
        cmocka_unit_test(test_random_bytes_are_never_admitted),
        cmocka_unit_test(test_keys_that_cannot_work_are_refused_with_the_remedy),
        cmocka_unit_test(test_networks_are_read_as_written_or_refused),
        cmocka_unit_test(test_messages_without_a_valid_signature_are_refused_and_counted_by_cause),
        cmocka_unit_test(test_a_receiver_without_keys_accepts_signed_messages),
        cmocka_unit_test(test_only_messages_from_allowed_addresses_are_accepted),
    };
    return cmocka_run_group_tests(tests, make_keys, remove_keys);
}
