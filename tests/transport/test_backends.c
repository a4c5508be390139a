/// Goal: all buses behave alike, and a bus that is missing or goes away gives a documented error.
/// Method: the same cases run on loop:, lcm:, dds:, unix: and log:; then the properties of each
///         bus, in private networks (a child process in a network namespace of its own).
#include "check.h"
#include "codec.h"
#include "rng.h"
#include "verge/message.h"
#include "verge/transport.h"

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <net/if.h>
#include <net/route.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

int unshare(int flags); // sched.h declares it for _GNU_SOURCE only
#ifndef CLONE_NEWUSER
#define CLONE_NEWUSER 0x10000000
#define CLONE_NEWNET 0x40000000
#endif

static const char* lcm_url(void)
{
    const char* given = getenv("VERGE_TEST_LCM_URL");
    return given != NULL ? given : "lcm:udpm://239.255.76.67:7667?ttl=0";
}

static char log_path[64];
static char log_url[80];
static char unix_url[80];

static transport* open_or_fail(const char* url, unsigned receive)
{
    char       error[256] = "";
    transport* bus = NULL;
    if (transport_open(&bus, url, receive, error, sizeof error) != TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    return bus;
}

static verge_vehicle_state_t car(int32_t id)
{
    return (verge_vehicle_state_t){
        .utime = 1700000000000000 + id, .vehicle_id = id, .x = 1.5 * id, .speed = 10.0f,
        .yaw_rate = NAN, .length = 5.0f, .width = 2.0f,
    };
}

// ---------------------------------------------------------------- one body of cases

/// A bus with a sending and a receiving end. On log: the receiver opens what the sender closed.
typedef struct fixture {
    const char* url;
    bool        is_log;
    bool        is_dds;
    bool        is_unix; ///< ten messages can wait
    transport * sender, *receiver;
    transport_stats before; ///< the receiver's, when the case began
} fixture;

enum { SENDS_ALL = TRANSPORT_SENDS_STATES | TRANSPORT_SENDS_PLANS | TRANSPORT_SENDS_STATUSES };

/// Sends a message of each kind repeatedly until the receiver has got all requested kinds, because
/// on DDS the ends have to discover each other.
static void fixture_meet(fixture* f, transport* sender, unsigned receive)
{
    static transport_message messages[16];
    unsigned heard = 0;
    for (int tries = 0; tries < 2000 && heard != receive; ++tries) {
        const verge_vehicle_state_t state = car(9999);
        const verge_vehicle_plan_t  plan = { .vehicle_id = 9999 };
        const verge_rsu_status_t    status = { .rsu_id = 9999 };
        transport_publish_state(sender, &state);
        transport_publish_plan(sender, &plan);
        transport_publish_status(sender, &status);
        struct pollfd fd = { .fd = transport_fd(f->receiver), .events = POLLIN };
        poll(&fd, 1, 10);
        const uint32_t got = transport_drain(f->receiver, messages, 16);
        for (uint32_t i = 0; i < got; ++i) {
            heard |= 1u << messages[i].kind;
        }
    }
    assert_int_equal(heard, receive);
    struct pollfd fd = { .fd = transport_fd(f->receiver), .events = POLLIN };
    do {
        (void)transport_drain(f->receiver, messages, 16);
    } while (poll(&fd, 1, 300) > 0);
    f->before = transport_statistics(f->receiver);
}

static void fixture_open(fixture* f, unsigned receive)
{
    f->receiver = f->is_log ? NULL : open_or_fail(f->url, receive);
    f->sender = open_or_fail(f->url, f->is_log ? TRANSPORT_RECORD : SENDS_ALL);
    if (f->is_dds) {
        fixture_meet(f, f->sender, receive);
    }
}

static void fixture_turn(fixture* f, unsigned receive)
{
    if (f->is_log) {
        transport_close(f->sender);
        f->sender = NULL;
        f->receiver = open_or_fail(f->url, receive);
    }
}

static void fixture_close(fixture* f)
{
    transport_close(f->sender);
    transport_close(f->receiver);
}

/// Drains until count messages came, the log ended or nothing came for two seconds.
static uint32_t collect(fixture* f, transport_message* messages, uint32_t count)
{
    uint32_t got = 0;
    while (got < count) {
        const uint32_t more = transport_drain(f->receiver, messages + got, count - got);
        got += more;
        if (more > 0) {
            continue;
        }
        struct pollfd fd = { .fd = transport_fd(f->receiver), .events = POLLIN };
        if (transport_ended(f->receiver) || (fd.fd >= 0 && poll(&fd, 1, 2000) == 0)) {
            break;
        }
    }
    return got;
}

static int32_t id_of(const transport_message* message)
{
    return message->kind == TRANSPORT_STATE  ? message->as.state.vehicle_id
           : message->kind == TRANSPORT_PLAN ? message->as.plan.vehicle_id
                                             : message->as.status.rsu_id;
}

static int by_id_and_kind(const void* one, const void* other)
{
    const transport_message *a = one, *b = other;
    const int32_t            ids = id_of(a) - id_of(b);
    return ids != 0 ? ids : (int)a->kind - (int)b->kind;
}

static void check_delivery(fixture f)
{
    static transport_message messages[160];
    const unsigned wanted = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_STATUSES;
    uint32_t got = 0;
    fixture_open(&f, wanted);

    for (int32_t id = 0; id < 50; ++id) {
        const verge_vehicle_state_t state = car(id);
        const verge_vehicle_plan_t  plan = { .vehicle_id = id, .points[30].x = 0.5 * id };
        const verge_rsu_status_t    status = { .rsu_id = id, .cycle = id, .nodes_peak = 7 };
        assert_int_equal(transport_publish_state(f.sender, &state), 0);
        assert_int_equal(transport_publish_plan(f.sender, &plan), 0);
        assert_int_equal(transport_publish_status(f.sender, &status), 0);
        got += f.is_unix ? collect(&f, messages + got, 3) : 0;
    }
    fixture_turn(&f, wanted);

    assert_int_equal(got + collect(&f, messages + got, 150 - got), 150);
    if (f.is_dds) { // different vehicles and kinds come in any order
        qsort(messages, 150, sizeof messages[0], by_id_and_kind);
    }
    for (int32_t id = 0; id < 50; ++id) { // each kind once, in the order sent
        const transport_message* m = &messages[3 * id];
        assert_int_equal(m[0].kind, TRANSPORT_STATE);
        assert_int_equal(m[0].as.state.vehicle_id, id);
        CHECK_SAME_BITS(m[0].as.state.x, 1.5 * id);
        assert_true(isnan(m[0].as.state.yaw_rate));
        assert_int_equal(m[1].kind, TRANSPORT_PLAN);
        CHECK_SAME_BITS(m[1].as.plan.points[30].x, 0.5 * id);
        assert_int_equal(m[2].kind, TRANSPORT_STATUS);
        assert_int_equal(m[2].as.status.cycle, id);
        assert_true(m[0].arrival_utime > 1600000000000000);
    }
    assert_int_equal(transport_drain(f.receiver, messages, 160), 0);
    assert_int_equal(transport_statistics(f.receiver).received - f.before.received, 150);
    assert_int_equal(transport_statistics(f.receiver).malformed, 0);
    assert_int_equal(transport_statistics(f.receiver).errors, 0);
    if (f.sender != NULL && !f.is_dds) {
        assert_int_equal(transport_statistics(f.sender).published, 150);
    }
    fixture_close(&f);
}

/// Every field, whatever is in it, arrives as it was: messages of random bits, compared in LCM's
/// encoding, on DDS as on LCM.
static void check_round_trip(fixture f)
{
    static transport_message sent, message;
    test_rng                 rng = test_rng_seeded("round trip");
    const unsigned           wanted = TRANSPORT_STATES | TRANSPORT_PLANS | TRANSPORT_STATUSES;
    fixture_open(&f, wanted);
    for (uint32_t round = 0; round < (f.is_log ? 1u : test_rounds(60)); ++round) {
        uint8_t  before[CODEC_SIZE_MAX], after[CODEC_SIZE_MAX];
        uint8_t* bytes = (uint8_t*)&sent.as;
        for (size_t i = 0; i < sizeof sent.as; ++i) {
            bytes[i] = (uint8_t)test_rng_next(&rng);
        }
        const transport_kind kind = TRANSPORT_STATE + round % 3;
        static transport_message sealed;
        message_seal(kind, &sent.as, &sealed.as);
        const size_t size = codec_encode(kind, &sealed.as, before);
        switch (kind) {
        case TRANSPORT_STATE: transport_publish_state(f.sender, &sent.as.state); break;
        case TRANSPORT_PLAN: transport_publish_plan(f.sender, &sent.as.plan); break;
        default: transport_publish_status(f.sender, &sent.as.status); break;
        }
        fixture_turn(&f, wanted);
        assert_int_equal(collect(&f, &message, 1), 1);
        assert_int_equal(message.kind, kind);
        codec_encode(kind, &message.as, after);
        assert_memory_equal(before, after, size);
    }
    fixture_close(&f);
}

static void check_filter(fixture f)
{
    static transport_message messages[4];
    fixture_open(&f, TRANSPORT_PLANS);

    const verge_vehicle_state_t state = car(1);
    const verge_vehicle_plan_t  plan = { .vehicle_id = 9 };
    transport_publish_state(f.sender, &state);
    transport_publish_state(f.sender, &state);
    transport_publish_plan(f.sender, &plan);
    fixture_turn(&f, TRANSPORT_PLANS);

    assert_int_equal(collect(&f, messages, 1), 1);
    assert_int_equal(messages[0].kind, TRANSPORT_PLAN);
    assert_int_equal(messages[0].as.plan.vehicle_id, 9);
    // On DDS messages that were not requested do not arrive.
    assert_int_equal(transport_statistics(f.receiver).foreign, f.is_dds ? 0 : 2);
    fixture_close(&f);
}

static void check_portions(fixture f)
{
    static transport_message messages[8];
    const int32_t sent = f.is_unix ? 10 : 20;
    fixture_open(&f, TRANSPORT_STATES);
    for (int32_t id = 0; id < sent; ++id) {
        const verge_vehicle_state_t state = car(id);
        transport_publish_state(f.sender, &state);
    }
    fixture_turn(&f, TRANSPORT_STATES);

    int32_t count = 0;
    bool    seen[20] = { false };
    for (uint32_t got = 1; got > 0 && count < sent;) { // never more than asked for, none lost
        got = collect(&f, messages, 5);
        assert_true(got <= 5);
        for (uint32_t i = 0; i < got; ++i, ++count) {
            const int32_t id = messages[i].as.state.vehicle_id;
            assert_true(id >= 0 && id < sent && !seen[id]);
            assert_true(f.is_dds || id == count);
            seen[id] = true;
        }
    }
    assert_int_equal(count, sent);
    fixture_close(&f);
}

/// Each again until it is sent, for at most a second: the queue of a unix: bus may be full.
static void* publish_two_hundred(void* sender)
{
    for (int32_t id = 0; id < 200; ++id) {
        const verge_vehicle_state_t state = car(id);
        for (int tries = 0; tries < 1000 && transport_publish_state(sender, &state) != 0; ++tries) {
            nanosleep(&(struct timespec){ .tv_nsec = 1000000 }, NULL);
        }
    }
    return NULL;
}

static void check_threads(fixture f)
{
    static transport_message messages[200];
    pthread_t                publisher;
    fixture_open(&f, TRANSPORT_STATES);
    assert_int_equal(pthread_create(&publisher, NULL, publish_two_hundred, f.sender), 0);
    const uint32_t got = collect(&f, messages, 200);
    pthread_join(publisher, NULL);
    assert_int_equal(got, 200);
    if (f.is_dds) {
        qsort(messages, 200, sizeof messages[0], by_id_and_kind);
    }
    for (int32_t id = 0; id < 200; ++id) {
        assert_int_equal(messages[id].as.state.vehicle_id, id);
    }
    fixture_close(&f);
}

/// Two senders are distinguished, and each keeps its name.
static void check_senders(fixture f)
{
    static transport_message messages[4];
    fixture_open(&f, TRANSPORT_STATES);
    transport* second = open_or_fail(f.url, SENDS_ALL);
    if (f.is_dds) {
        fixture_meet(&f, second, TRANSPORT_STATES);
    }
    uint64_t names[3] = { 0 };
    for (int32_t round = 0; round < 2; ++round) {
        const verge_vehicle_state_t one = car(1), two = car(2);
        transport_publish_state(f.sender, &one);
        transport_publish_state(second, &two);
        assert_int_equal(collect(&f, messages, 2), 2);
        for (uint32_t i = 0; i < 2; ++i) {
            uint64_t* name = &names[messages[i].as.state.vehicle_id];
            assert_true(messages[i].sender != 0);
            assert_true(*name == 0 || *name == messages[i].sender);
            *name = messages[i].sender;
        }
    }
    assert_true(names[1] != names[2]);
    transport_close(second);
    fixture_close(&f);
}

static void check_all(fixture f)
{
    check_delivery(f);
    check_round_trip(f);
    check_filter(f);
    check_portions(f);
    if (!f.is_log) { // a log is read after it was written
        check_threads(f);
    }
    if (!f.is_log && !f.is_unix) { // on unix: a sender is a process, see test_unix.c
        check_senders(f);
    }
}

static void test_loop_delivers_filters_and_portions(void** state)
{
    (void)state;
    check_all((fixture){ .url = "loop:cases" });
}

static void test_unix_delivers_filters_and_portions(void** state)
{
    (void)state;
    check_all((fixture){ .url = unix_url, .is_unix = true });
}

static void test_log_delivers_filters_and_portions(void** state)
{
    (void)state;
    check_all((fixture){ .url = log_url, .is_log = true });
}

static void test_lcm_delivers_filters_and_portions(void** state)
{
    (void)state;
    char       error[256];
    transport* bus = NULL;
    if (transport_open(&bus, lcm_url(), 0, error, sizeof error) == TRANSPORT_UNAVAILABLE) {
        printf("             SKIPPED: %s\n", error);
        skip();
    }
    transport_close(bus);
    check_all((fixture){ .url = lcm_url() });
}

static bool dds_is_built_in(void)
{
    const bool built_in = transport_url_fault("dds:0") == NULL;
    if (!built_in) {
        printf("             SKIPPED: built without DDS\n");
    }
    return built_in;
}

static void test_dds_delivers_filters_and_portions(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    check_all((fixture){ .url = "dds:0", .is_dds = true });
}

// ---------------------------------------------------------------- dds

static transport* dds_open(const char* url, unsigned receive, const transport_options* options)
{
    char       error[512] = "";
    transport* bus = NULL;
    if (transport_open_with(&bus, url, receive, options, error, sizeof error) != TRANSPORT_OK) {
        fail_msg("%s", error);
    }
    return bus;
}

static void test_dds_keeps_the_newest_state_of_each_vehicle(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    static transport_message messages[40];
    fixture f = { .url = "dds:0", .is_dds = true };
    fixture_open(&f, TRANSPORT_STATES);
    for (int32_t sequence = 1; sequence <= 5; ++sequence) {
        for (int32_t id = 0; id < 4; ++id) {
            verge_vehicle_state_t now = car(id);
            now.sequence = sequence;
            assert_int_equal(transport_publish_state(f.sender, &now), 0);
        }
    }
    nanosleep(&(struct timespec){ .tv_nsec = 500000000 }, NULL); // all arrived, none was taken
    const uint32_t got = collect(&f, messages, 40);
    assert_true(got >= 4);
    for (uint32_t i = got - 4; i < got; ++i) {
        assert_int_equal(messages[i].as.state.sequence, 5);
    }
    assert_true(got < 20); // a machine that lags lets us see some older ones, never all
    struct pollfd fd = { .fd = transport_fd(f.receiver), .events = POLLIN };
    assert_int_equal(poll(&fd, 1, 0), 0); // empty again, and says so
    fixture_close(&f);
}

static void test_dds_gives_the_last_status_to_later_readers(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    transport_message        message;
    const verge_rsu_status_t status = { .rsu_id = 3, .cycle = 17 };
    fixture f = { .url = "dds:0", .is_dds = true, .sender = dds_open("dds:0", SENDS_ALL, NULL) };
    transport_publish_status(f.sender, &status);
    const verge_vehicle_plan_t plan = { .vehicle_id = 3 };
    transport_publish_plan(f.sender, &plan); // for readers that exist now
    f.receiver = dds_open("dds:0", TRANSPORT_STATUSES | TRANSPORT_PLANS, NULL);
    assert_int_equal(collect(&f, &message, 1), 1);
    assert_int_equal(message.kind, TRANSPORT_STATUS);
    assert_int_equal(message.as.status.cycle, 17);
    fixture_close(&f);
}

static void test_dds_domains_are_apart_and_can_be_opened_again(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    transport_message message;
    transport*        elsewhere = dds_open("dds:230", TRANSPORT_STATES, NULL);
    for (int again = 0; again < 3; ++again) {
        fixture f = { .url = "dds:0", .is_dds = true };
        fixture_open(&f, TRANSPORT_STATES);
        fixture_close(&f);
    }
    assert_int_equal(transport_drain(elsewhere, &message, 1), 0);
    assert_int_equal(transport_statistics(elsewhere).received, 0);
    transport_close(elsewhere);
}

static void test_an_interface_that_is_not_there_is_named_with_those_that_are(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    static const transport_setting names[] = { { "dds.interfaces", "lo" },
                                               { "dds.interfaces", "verge9" } };
    const transport_options        options = { .settings = names, .setting_count = 2 };
    char       error[512] = "";
    transport* bus = NULL;
    assert_int_equal(transport_open_with(&bus, "dds:0", TRANSPORT_STATES, &options, error,
                                         sizeof error), TRANSPORT_UNAVAILABLE);
    assert_null(bus);
    assert_non_null(strstr(error, "\"verge9\""));
    assert_non_null(strstr(error, "lo (127.0.0.1)"));

    // By address as well as by name.
    static const transport_setting address = { "dds.interfaces", "127.0.0.1" };
    const transport_options        by_address = { .settings = &address, .setting_count = 1 };
    transport_close(dds_open("dds:0", TRANSPORT_STATES, &by_address));
}

static void test_dds_recovers_from_more_vehicles_than_a_reader_has_room_for(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    static transport_message messages[64];
    fixture f = { .url = "dds:0", .is_dds = true };
    fixture_open(&f, TRANSPORT_STATES);
    for (int32_t id = 0; id < 6000; ++id) { // a sender that stays and remembers all of them
        const verge_vehicle_state_t made_up = car(10000 + id);
        transport_publish_state(f.sender, &made_up);
        (void)transport_drain(f.receiver, messages, 64);
    }
    bool heard = false;
    for (int tries = 0; tries < 1000 && !heard; ++tries) { // honest and new
        const verge_vehicle_state_t honest = car(7);
        transport_publish_state(f.sender, &honest);
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
        const uint32_t got = transport_drain(f.receiver, messages, 64);
        for (uint32_t i = 0; i < got; ++i) {
            heard = heard || messages[i].as.state.vehicle_id == 7;
        }
    }
    assert_true(heard);
    fixture_close(&f);
}

static void test_dds_delivers_plans_after_any_number_of_vehicles(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    static transport_message messages[64];
    fixture f = { .url = "dds:0", .is_dds = true };
    fixture_open(&f, TRANSPORT_PLANS);
    for (int32_t id = 0; id < 6000; ++id) { // come and gone, but the first 2000 forever there
        verge_vehicle_plan_t plan = { .vehicle_id = 10000 + id };
        transport_publish_plan(f.sender, &plan);
        plan.status = 3; // cancelled
        if (id >= 2000) {
            transport_publish_plan(f.sender, &plan);
        }
        (void)transport_drain(f.receiver, messages, 64);
    }
    bool heard = false;
    for (int tries = 0; tries < 1000 && !heard; ++tries) {
        const verge_vehicle_plan_t plan = { .vehicle_id = 7 };
        transport_publish_plan(f.sender, &plan);
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
        const uint32_t got = transport_drain(f.receiver, messages, 64);
        for (uint32_t i = 0; i < got; ++i) {
            heard = heard || messages[i].as.plan.vehicle_id == 7;
        }
    }
    assert_true(heard);
    assert_int_equal(transport_statistics(f.receiver).errors, 0);
    fixture_close(&f);
}

/// What a bus complained of, line after line.
static char complaints[8192];

static void keep_complaint(void* context, const char* line)
{
    (void)context;
    const size_t used = strlen(complaints);
    snprintf(complaints + used, sizeof complaints - used, "%s\n", line);
}

/// Drains until the words were logged, for at most ten seconds; publishes meanwhile if requested.
static bool is_told(transport* bus, const char* words, transport* talker)
{
    static transport_message messages[16];
    for (int tries = 0; tries < 1000; ++tries) {
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
        (void)transport_drain(bus, messages, 16);
        if (strstr(complaints, words) != NULL) {
            return true;
        }
        if (talker != NULL) {
            const verge_vehicle_state_t now = car(1);
            transport_publish_state(talker, &now);
        }
    }
    return false;
}

static void test_dds_reports_senders_that_leave_and_missed_deadlines(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    complaints[0] = '\0';
    transport_setting deadline = { "dds.deadline_ms", "700" };
    transport_options options = { .log = keep_complaint, .settings = &deadline,
                                  .setting_count = 1 };
    fixture f = { .url = "dds:0", .is_dds = true,
                  .receiver = dds_open("dds:0", TRANSPORT_STATES, &options),
                  .sender = dds_open("dds:0", SENDS_ALL, NULL) };
    fixture_meet(&f, f.sender, TRANSPORT_STATES);
    assert_true(is_told(f.receiver, "no state for 700 ms", NULL)); // it is silent now
    assert_true(transport_statistics(f.receiver).lost > 0);
    transport_close(f.sender);
    f.sender = NULL;
    assert_true(is_told(f.receiver, "left or fell silent, 0 are there", NULL));
    fixture_close(&f);

    // Our senders offer half a second. A reader that requires less gets no messages, and logs that.
    deadline.value = "100";
    f.receiver = dds_open("dds:0", TRANSPORT_STATES, &options);
    f.sender = dds_open("dds:0", SENDS_ALL, NULL);
    assert_true(is_told(f.receiver, "promises no deadline as short", f.sender));
    assert_int_equal(transport_statistics(f.receiver).received, 0);
    fixture_close(&f);
}

// ---------------------------------------------------------------- URLs

static void test_malformed_urls_are_refused_with_what_was_expected(void** state)
{
    (void)state;
    static const char* const bad[] = {
        "", "lcm", "lcm:", "tcp:1", "dds", "dds:", "dds:231", "dds:-1", "dds:0x1", "lcm:udpm",
        "lcm:udpm://1.2.3.4:7667", "lcm:udpm://a.b:7",
        "lcm:udpm://239.255.76.67:0", "lcm:udpm://239.255.76.67:65536",
        "lcm:udpm://239.255.76.67:7667?ttl=256", "lcm:udpm://239.255.76.67:7667?ttl=",
        "lcm:udpm://239.255.76.67:7667?ttl=0&", "lcm:udpm://239.255.76.67:7667?tll=0",
        "lcm:udpm://239.255.76.67:76x7", "lcm:udpm://239.255.76.67.239.255.76.67:7667", "log:",
        "unix:",
        "loop:a-name-of-more-than-sixty-three-characters-is-longer-than-any-name-needs-to-be",
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i) {
        char       error[256] = "";
        transport* bus = (transport*)&error;
        assert_int_equal(transport_open(&bus, bad[i], TRANSPORT_STATES, error, sizeof error),
                         TRANSPORT_BAD_URL);
        assert_null(bus);
        assert_true(strlen(error) > 20);
        assert_null(strchr(error, '\n'));
    }
    assert_null(transport_url_fault("lcm:udpm://239.255.76.67:7667?ttl=0"));
    assert_non_null(strstr(transport_url_fault("tcp:1"), "unknown bus"));
    transport_close(NULL);
}

static void test_a_missing_log_is_unavailable(void** state)
{
    (void)state;
    char       error[256];
    transport* bus;
    assert_int_equal(transport_open(&bus, "log:/nowhere/at/all", TRANSPORT_STATES, error, 256),
                     TRANSPORT_UNAVAILABLE);
    assert_non_null(strstr(error, "/nowhere/at/all"));
    assert_int_equal(transport_open(&bus, "log:/tmp", TRANSPORT_STATES, error, 256),
                     TRANSPORT_UNAVAILABLE);
}

// ---------------------------------------------------------------- loop

static void test_loop_keeps_the_newest_messages_and_counts_those_dropped(void** state)
{
    (void)state;
    static transport_message messages[400];
    fixture f = { .url = "loop:full" };
    fixture_open(&f, TRANSPORT_STATES);
    transport* other = open_or_fail("loop:elsewhere", TRANSPORT_STATES);
    for (int32_t id = 0; id < 300; ++id) {
        const verge_vehicle_state_t car_state = car(id);
        transport_publish_state(f.sender, &car_state);
    }
    const uint32_t got = transport_drain(f.receiver, messages, 400);
    assert_int_equal(got + transport_statistics(f.receiver).dropped, 300);
    assert_true(transport_statistics(f.receiver).dropped > 0);
    assert_int_equal(messages[got - 1].as.state.vehicle_id, 299);
    assert_int_equal(transport_drain(other, messages, 400), 0);
    assert_int_equal(transport_drain(f.sender, messages, 400), 0); // not its own

    struct pollfd fd = { .fd = transport_fd(f.receiver), .events = POLLIN };
    assert_int_equal(poll(&fd, 1, 0), 0); // empty again, and says so
    transport_close(other);
    fixture_close(&f);
}

// ---------------------------------------------------------------- log

static void record_ten(void)
{
    transport* log = open_or_fail(log_url, TRANSPORT_RECORD);
    for (int32_t id = 0; id < 10; ++id) {
        transport_message m = { .kind = TRANSPORT_STATE, .as.state = car(id) };
        assert_int_equal(transport_record(log, 1000 + id, &m), 0);
        m = (transport_message){ .kind = TRANSPORT_MARK, .as.mark = { 1000 + id, id, id % 2 } };
        assert_int_equal(transport_record(log, 1000 + id, &m), 0);
    }
    assert_int_equal(transport_drain(log, &(transport_message){ 0 }, 1), 0);
    assert_true(transport_ended(log));
    transport_close(log);
}

static size_t file_read(uint8_t* bytes, size_t room)
{
    FILE* file = fopen(log_path, "rb");
    assert_non_null(file);
    const size_t size = fread(bytes, 1, room, file);
    fclose(file);
    return size;
}

static void file_write(const uint8_t* bytes, size_t size)
{
    FILE* file = fopen(log_path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
}

/// Reads the whole log; the states must be a run of car(0), car(1), ... with some left out.
static uint32_t log_states(transport_stats* stats)
{
    transport*        log = open_or_fail(log_url, TRANSPORT_STATES);
    transport_message m;
    uint32_t          count = 0;
    int32_t           last = -1;
    while (!transport_ended(log)) {
        if (transport_drain(log, &m, 1) == 1) {
            assert_true(m.as.state.vehicle_id > last);
            last = m.as.state.vehicle_id;
            assert_int_equal(m.arrival_utime, 1000 + last);
            ++count;
        }
    }
    *stats = transport_statistics(log);
    transport_close(log);
    return count;
}

static void test_a_log_gives_back_events_with_their_own_time_and_marks(void** state)
{
    (void)state;
    record_ten();
    transport*        log = open_or_fail(log_url, TRANSPORT_STATES | TRANSPORT_MARKS);
    transport_message m[20];
    assert_int_equal(transport_fd(log), -1);
    assert_int_equal(transport_drain(log, m, 20), 20);
    for (int i = 0; i < 10; ++i) {
        assert_int_equal(m[2 * i].kind, TRANSPORT_STATE);
        assert_int_equal(m[2 * i].arrival_utime, 1000 + i);
        assert_int_equal(m[2 * i + 1].kind, TRANSPORT_MARK);
        assert_int_equal(m[2 * i + 1].as.mark.cycle, i);
        assert_int_equal(m[2 * i + 1].as.mark.overrun, i % 2);
    }
    assert_int_equal(transport_drain(log, m, 20), 0);
    assert_true(transport_ended(log));
    const verge_vehicle_state_t car_state = car(1);
    assert_int_equal(transport_publish_state(log, &car_state), -1); // open for reading
    assert_int_equal(transport_statistics(log).errors, 1);
    transport_close(log);
}

static void test_a_log_is_lcms_event_format(void** state)
{
    (void)state;
    uint8_t bytes[4096];
    record_ten();
    const size_t size = file_read(bytes, sizeof bytes);
    const size_t state_event = 28 + 11 + CODEC_STATE_SIZE;
    const size_t mark_event = 28 + 11 + CODEC_MARK_SIZE;
    assert_int_equal(size, 10 * (state_event + mark_event));
    for (uint32_t i = 0; i < 10; ++i) {
        const uint8_t* event = bytes + i * (state_event + mark_event);
        assert_int_equal(codec_get_u32(event), 0xEDA1DA01);
        assert_int_equal(codec_get_u64(event + 4), 2 * i); // number
        assert_int_equal(codec_get_u64(event + 12), 1000 + i); // time
        assert_int_equal(codec_get_u32(event + 20), 11);
        assert_int_equal(codec_get_u32(event + 24), CODEC_STATE_SIZE);
        assert_memory_equal(event + 28, "VERGE_STATE", 11);
    }
}

static void test_a_log_cut_anywhere_gives_every_whole_event(void** state)
{
    (void)state;
    static uint8_t bytes[4096];
    transport_stats stats;
    record_ten();
    const size_t size = file_read(bytes, sizeof bytes);
    const size_t state_event = 28 + 11 + CODEC_STATE_SIZE;
    const size_t pair = state_event + 28 + 11 + CODEC_MARK_SIZE;
    for (size_t cut = 0; cut <= size; cut += 7) {
        file_write(bytes, cut);
        const size_t whole = cut / pair + (cut % pair >= state_event ? 1 : 0);
        assert_int_equal(log_states(&stats), whole);
        assert_true(stats.malformed <= 1);
    }
}

static void test_garbage_in_a_log_costs_only_the_events_it_hits(void** state)
{
    (void)state;
    static uint8_t  bytes[4096], spoilt[8192];
    transport_stats stats;
    test_rng        rng = test_rng_seeded("log garbage");
    record_ten();
    const size_t size = file_read(bytes, sizeof bytes);
    for (uint32_t round = 0; round < test_rounds(300); ++round) {
        // Garbage, a false sync word among it, put between the fifth pair and the sixth ...
        const size_t at = size / 2;
        const size_t junk = 1 + test_rng_below(&rng, 500);
        memcpy(spoilt, bytes, at);
        for (size_t i = 0; i < junk; ++i) {
            spoilt[at + i] = (uint8_t)test_rng_next(&rng);
        }
        if (junk > 40) {
            codec_put_u32(spoilt + at + 10, 0xEDA1DA01u);
        }
        memcpy(spoilt + at + junk, bytes + at, size - at);
        file_write(spoilt, size + junk);
        assert_int_equal(log_states(&stats), 10);
        assert_int_equal(stats.malformed, 1);

        // ... and one byte changed anywhere.
        memcpy(spoilt, bytes, size);
        spoilt[test_rng_below(&rng, (uint32_t)size)] ^= (uint8_t)(1 + test_rng_below(&rng, 255));
        file_write(spoilt, size);
        transport* log = open_or_fail(log_url, TRANSPORT_STATES);
        transport_message m[20];
        uint32_t got = 0;
        while (!transport_ended(log)) {
            got += transport_drain(log, m, 20);
        }
        assert_true(got >= 9);
        transport_close(log);
    }
}

static void test_a_damaged_length_in_a_log_costs_one_event(void** state)
{
    (void)state;
    static uint8_t  bytes[4096];
    transport_stats stats;
    record_ten();
    const size_t size = file_read(bytes, sizeof bytes);
    for (size_t event = 0; event < size;) {
        const size_t next = event + 28 + codec_get_u32(bytes + event + 20) +
                            codec_get_u32(bytes + event + 24);
        for (uint32_t bit = 0; bit < 64; ++bit) { // of both lengths
            uint8_t* byte = bytes + event + 20 + bit / 8;
            *byte ^= (uint8_t)(1u << bit % 8);
            file_write(bytes, size);
            assert_true(log_states(&stats) >= 9);
            *byte ^= (uint8_t)(1u << bit % 8);
        }
        event = next;
    }
}

static void test_a_logs_big_foreign_events_are_skipped(void** state)
{
    (void)state;
    static uint8_t  image[200000 + 64], bytes[4096], joined[250000];
    transport_stats stats;
    record_ten();
    const size_t size = file_read(bytes, sizeof bytes);
    codec_put_u32(image, 0xEDA1DA01u);
    codec_put_u32(image + 20, 6);
    codec_put_u32(image + 24, 200000);
    memcpy(image + 28, "CAMERA", 6);
    memcpy(joined, image, 28 + 6 + 200000);
    memcpy(joined + 28 + 6 + 200000, bytes, size);
    file_write(joined, 28 + 6 + 200000 + size);
    assert_int_equal(log_states(&stats), 10);
    assert_int_equal(stats.malformed, 0);
    assert_int_equal(stats.foreign, 11); // the image and the marks
}

// ---------------------------------------------------------------- programs of LCM

/// Starts one of LCM's own programs, quietly. 127 when it ends: it is not installed.
static pid_t program_start(const char* const arguments[])
{
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        if (freopen("/dev/null", "w", stdout) == NULL ||
            freopen("/dev/null", "w", stderr) == NULL) {
            _exit(126);
        }
        execvp(arguments[0], (char* const*)(uintptr_t)arguments);
        _exit(127);
    }
    return child;
}

static int program_wait(pid_t child)
{
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

static bool lcm_available(void)
{
    char       error[256];
    transport* bus = NULL;
    const int  result = transport_open(&bus, lcm_url(), TRANSPORT_STATES, error, sizeof error);
    transport_close(bus);
    if (result == TRANSPORT_UNAVAILABLE) {
        printf("             SKIPPED: %s\n", error);
    }
    return result != TRANSPORT_UNAVAILABLE;
}

static void test_lcm_logplayer_plays_our_log(void** state)
{
    (void)state;
    if (!lcm_available()) {
        skip();
    }
    static transport_message messages[10];
    record_ten();
    fixture f = { .url = lcm_url(), .receiver = open_or_fail(lcm_url(), TRANSPORT_STATES) };
    const char* const play[] = { "lcm-logplayer", "-l", lcm_url() + 4, log_path, NULL };
    const pid_t player = program_start(play);
    const uint32_t got = collect(&f, messages, 10);
    if (program_wait(player) == 127) {
        printf("             SKIPPED: lcm-logplayer is not installed\n");
        fixture_close(&f);
        skip();
    }
    assert_int_equal(got, 10);
    for (int32_t id = 0; id < 10; ++id) {
        assert_int_equal(messages[id].as.state.vehicle_id, id);
    }
    fixture_close(&f);
}

static void test_a_recording_of_lcm_logger_holds_our_messages(void** state)
{
    (void)state;
    if (!lcm_available()) {
        skip();
    }
    char option[128];
    snprintf(option, sizeof option, "--lcm-url=%s", lcm_url() + 4);
    remove(log_path);
    const char* const listen[] = { "lcm-logger", option, "-f", "-q", log_path, NULL };
    const pid_t logger = program_start(listen);

    transport*  bus = open_or_fail(lcm_url(), 0);
    struct stat written = { 0 };
    int32_t     sent = 0;
    while (sent < 500 && written.st_size == 0) { // until it is up and has written something
        const verge_vehicle_state_t car_state = car(sent++);
        assert_int_equal(transport_publish_state(bus, &car_state), 0);
        nanosleep(&(struct timespec){ .tv_nsec = 20000000 }, NULL);
        (void)stat(log_path, &written);
    }
    kill(logger, SIGINT);
    transport_close(bus);
    if (program_wait(logger) == 127) {
        printf("             SKIPPED: lcm-logger is not installed\n");
        skip();
    }
    transport*        log = open_or_fail(log_url, TRANSPORT_STATES);
    transport_message m;
    int32_t           count = 0;
    while (!transport_ended(log)) {
        if (transport_drain(log, &m, 1) == 1) {
            CHECK_SAME_BITS(m.as.state.x, 1.5 * m.as.state.vehicle_id);
            ++count;
        }
    }
    assert_true(count > 0 && count <= sent);
    assert_int_equal(transport_statistics(log).malformed, 0);
    transport_close(log);
}

// ---------------------------------------------------------------- networks that come and go

static void network_route(bool add)
{
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    struct ifreq lo = { .ifr_name = "lo", .ifr_flags = IFF_UP | IFF_RUNNING | IFF_LOOPBACK };
    ioctl(fd, SIOCSIFFLAGS, &lo);
    struct rtentry route = { .rt_flags = RTF_UP, .rt_dev = (char*)"lo" };
    ((struct sockaddr_in*)&route.rt_dst)->sin_family = AF_INET;
    ((struct sockaddr_in*)&route.rt_dst)->sin_addr.s_addr = inet_addr("224.0.0.0");
    ((struct sockaddr_in*)&route.rt_genmask)->sin_family = AF_INET;
    ((struct sockaddr_in*)&route.rt_genmask)->sin_addr.s_addr = inet_addr("240.0.0.0");
    ioctl(fd, add ? SIOCADDRT : SIOCDELRT, &route);
    close(fd);
}

enum { NO_NETWORKS = 77 };
#define EXPECT(condition) do { if (!(condition)) { return __LINE__ % 64 + 1; } } while (0)

/// Runs in a child. 0: all as it should be; 77: no private networks here; else where it failed.
static int bus_that_comes_and_goes(void)
{
    char              error[256] = "";
    transport*        bus = NULL;
    transport_message m;
    const verge_vehicle_state_t state = car(5);
    if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0 && unshare(CLONE_NEWNET) != 0) {
        return NO_NETWORKS;
    }
    EXPECT(transport_open(&bus, "lcm:udpm://239.255.76.67:7667?ttl=0", TRANSPORT_STATES, error,
                          sizeof error) == TRANSPORT_UNAVAILABLE);
    EXPECT(bus == NULL && strstr(error, "ip route add 224.0.0.0/4 dev lo") != NULL);
    EXPECT(strstr(error, "ip link set lo multicast on") != NULL && strchr(error, '\n') == NULL);

    network_route(true);
    EXPECT(transport_open(&bus, "lcm:udpm://239.255.76.67:7667?ttl=0", TRANSPORT_STATES, error,
                          sizeof error) == TRANSPORT_OK);
    const int fd = transport_fd(bus);
    EXPECT(transport_publish_state(bus, &state) == 0);
    EXPECT(transport_drain(bus, &m, 1) == 1 && m.as.state.vehicle_id == 5);

    network_route(false); // away: counted, nothing blocks, nothing ends
    EXPECT(transport_publish_state(bus, &state) == -1);
    EXPECT(transport_statistics(bus).errors == 1);
    EXPECT(transport_drain(bus, &m, 1) == 0);

    network_route(true); // back
    EXPECT(transport_publish_state(bus, &state) == 0);
    EXPECT(transport_drain(bus, &m, 1) == 1);

    const int other = socket(AF_UNIX, SOCK_STREAM, 0); // a receiving socket broken for good
    EXPECT(dup2(other, fd) == fd);
    const struct timespec a_second = { .tv_sec = 1, .tv_nsec = 100000000 };
    nanosleep(&a_second, NULL);
    EXPECT(transport_drain(bus, &m, 1) == 0);
    EXPECT(transport_fd(bus) == fd && transport_statistics(bus).errors > 1);
    EXPECT(transport_publish_state(bus, &state) == 0);
    EXPECT(transport_drain(bus, &m, 1) == 1);
    close(other);
    transport_close(bus);
    return 0;
}

static void network_up(bool up)
{
    const int    fd = socket(AF_INET, SOCK_DGRAM, 0);
    struct ifreq lo = { .ifr_name = "lo", .ifr_flags = (short)(up ? IFF_UP | IFF_RUNNING : 0) };
    ioctl(fd, SIOCSIFFLAGS, &lo);
    close(fd);
}

/// Publishes until a state comes through, for at most ten seconds.
static bool passes(transport* from, transport* to)
{
    transport_message m;
    for (int tries = 0; tries < 1000; ++tries) {
        const verge_vehicle_state_t state = car(5);
        (void)transport_publish_state(from, &state);
        nanosleep(&(struct timespec){ .tv_nsec = 10000000 }, NULL);
        if (transport_drain(to, &m, 1) == 1) {
            return true;
        }
    }
    return false;
}

/// The same on DDS, on an interface that goes down and up.
static int dds_that_comes_and_goes(void)
{
    char       error[512] = "";
    transport *from = NULL, *to = NULL;
    if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0 && unshare(CLONE_NEWNET) != 0) {
        return NO_NETWORKS;
    }
    transport_options options = { .log = keep_complaint };
    EXPECT(transport_open_with(&to, "dds:0", TRANSPORT_STATES, &options, error, sizeof error) ==
           TRANSPORT_UNAVAILABLE);
    EXPECT(strstr(error, "ip link set lo up") != NULL && strchr(error, '\n') == NULL);
    network_up(true);
    EXPECT(transport_open_with(&to, "dds:0", TRANSPORT_STATES, &options, error, sizeof error) ==
           TRANSPORT_OK);
    EXPECT(transport_open(&from, "dds:0", SENDS_ALL, error, sizeof error) == TRANSPORT_OK);
    EXPECT(passes(from, to) && transport_statistics(to).errors == 0);
    network_up(false);
    EXPECT(is_told(to, "the interface lo is down", from));
    EXPECT(transport_statistics(to).errors > 0);
    transport_message m;
    while (transport_drain(to, &m, 1) > 0) {
    }
    network_up(true);
    EXPECT(passes(from, to));
    EXPECT(is_told(to, "the interface lo is up again", from));
    transport_close(from);
    transport_close(to);
    return 0;
}

static void in_a_child(int (*body)(void))
{
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        _exit(body());
    }
    int status = 0;
    waitpid(child, &status, 0);
    assert_true(WIFEXITED(status));
    if (WEXITSTATUS(status) == NO_NETWORKS) {
        printf("             SKIPPED: this machine refuses private networks\n");
        skip();
    }
    if (WEXITSTATUS(status) != 0) {
        fail_msg("failed at a line that is %d modulo 64", WEXITSTATUS(status) - 1);
    }
}

static void test_a_bus_that_goes_away_comes_back(void** state)
{
    (void)state;
    in_a_child(bus_that_comes_and_goes);
}

static void test_dds_comes_back_with_its_interface(void** state)
{
    (void)state;
    if (!dds_is_built_in()) {
        skip();
    }
    in_a_child(dds_that_comes_and_goes);
}

static int make_log_path(void** state)
{
    (void)state;
    snprintf(log_path, sizeof log_path, "/tmp/verge_test_log_%d", (int)getpid());
    snprintf(log_url, sizeof log_url, "log:%s", log_path);
    snprintf(unix_url, sizeof unix_url, "unix:/tmp/verge_test_unix_%d", (int)getpid());
    return 0;
}

static int remove_log(void** state)
{
    (void)state;
    remove(log_path);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_loop_delivers_filters_and_portions),
        cmocka_unit_test(test_unix_delivers_filters_and_portions),
        cmocka_unit_test(test_log_delivers_filters_and_portions),
        cmocka_unit_test(test_lcm_delivers_filters_and_portions),
        cmocka_unit_test(test_dds_delivers_filters_and_portions),
        cmocka_unit_test(test_dds_keeps_the_newest_state_of_each_vehicle),
        cmocka_unit_test(test_dds_gives_the_last_status_to_later_readers),
        cmocka_unit_test(test_dds_domains_are_apart_and_can_be_opened_again),
        cmocka_unit_test(test_an_interface_that_is_not_there_is_named_with_those_that_are),
        cmocka_unit_test(test_dds_recovers_from_more_vehicles_than_a_reader_has_room_for),
        cmocka_unit_test(test_dds_delivers_plans_after_any_number_of_vehicles),
        cmocka_unit_test(test_dds_reports_senders_that_leave_and_missed_deadlines),
        cmocka_unit_test(test_malformed_urls_are_refused_with_what_was_expected),
        cmocka_unit_test(test_a_missing_log_is_unavailable),
        cmocka_unit_test(test_loop_keeps_the_newest_messages_and_counts_those_dropped),
        cmocka_unit_test(test_a_log_gives_back_events_with_their_own_time_and_marks),
        cmocka_unit_test(test_a_log_is_lcms_event_format),
        cmocka_unit_test(test_a_log_cut_anywhere_gives_every_whole_event),
        cmocka_unit_test(test_garbage_in_a_log_costs_only_the_events_it_hits),
        cmocka_unit_test(test_a_damaged_length_in_a_log_costs_one_event),
        cmocka_unit_test(test_a_logs_big_foreign_events_are_skipped),
        cmocka_unit_test(test_lcm_logplayer_plays_our_log),
        cmocka_unit_test(test_a_recording_of_lcm_logger_holds_our_messages),
        cmocka_unit_test(test_a_bus_that_goes_away_comes_back),
        cmocka_unit_test(test_dds_comes_back_with_its_interface),
    };
    return cmocka_run_group_tests(tests, make_log_path, remove_log);
}
