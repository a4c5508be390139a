/// Goal: any traffic on the bus leaves the good messages intact; all other messages are counted,
///       and only finite values in range reach the planner.
/// Method: many random, mutated, truncated, oversized and foreign datagrams between good ones,
///         with counts that must add up; then forged messages with a correct checksum.
/// This test is run under valgrind as well: there a read of one byte too many is an error.
#include "check.h"
#include "codec.h"
#include "rng.h"
#include "verge/inbox.h"
#include "verge/message.h"

#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/// Another port than LCM's own, so that a bus in use on this machine is left in peace.
#define GROUP "239.255.76.67"
enum { PORT = 17667, HEADER = 8, ROOM = 60000 };
static const char url[] = "lcm:udpm://239.255.76.67:17667?ttl=0";

static const int64_t start = 1700000000000000;

static verge_vehicle_state_t car(int32_t id)
{
    return (verge_vehicle_state_t){
        .utime = start + id, .vehicle_id = id, .x = 1.0, .speed = 10.0f, .yaw_rate = NAN,
        .length = 5.0f, .width = 2.0f, .target_lane = -1, .cooperation = NAN,
    };
}

/// A whole LC02 datagram with this payload.
static size_t frame(uint8_t* datagram, const char* channel, const uint8_t* payload, size_t size)
{
    codec_put_u32(datagram, 0x4c433032u);
    codec_put_u32(datagram + 4, 1);
    const size_t name = strlen(channel) + 1;
    memcpy(datagram + HEADER, channel, name);
    memcpy(datagram + HEADER + name, payload, size);
    return HEADER + name + size;
}

static size_t good_frame(uint8_t* datagram, int32_t id)
{
    uint8_t                     bytes[CODEC_SIZE_MAX];
    verge_vehicle_state_t state = car(id);
    state.crc32 = (int32_t)message_crc32(TRANSPORT_STATE, &state);
    return frame(datagram, "VERGE_STATE", bytes, codec_encode(TRANSPORT_STATE, &state, bytes));
}

static void fill(test_rng* rng, uint8_t* bytes, size_t size)
{
    for (size_t i = 0; i < size; ++i) {
        bytes[i] = (uint8_t)test_rng_next(rng);
    }
}

/// "LC03": sequence, message size, fragment offset, fragment number, fragment count. This one's
/// offset wraps around 32 bits; it ends LCM's own library.
static size_t wrapping_fragment(test_rng* rng, uint8_t* datagram)
{
    codec_put_u32(datagram, 0x4c433033u);
    codec_put_u32(datagram + 4, 7);
    codec_put_u32(datagram + 8, 0x7fffffffu);
    codec_put_u32(datagram + 12, 0xffffff00u);
    codec_put_u32(datagram + 16, 0x00010002u);
    fill(rng, datagram + 20, 1000);
    return 1020;
}

/// One hostile datagram; returns its size.
static size_t bad_frame(test_rng* rng, uint8_t* datagram)
{
    static uint8_t payload[ROOM];
    size_t         size = good_frame(datagram, 1000000);
    switch (test_rng_below(rng, 9)) {
    case 0: // noise
        size = test_rng_below(rng, 1600);
        fill(rng, datagram, size);
        return size;
    case 1: // a good one cut short
        return test_rng_below(rng, (uint32_t)size);
    case 2: // a good one with a byte changed anywhere
        datagram[test_rng_below(rng, (uint32_t)size)] ^= (uint8_t)(1 + test_rng_below(rng, 255));
        return size;
    case 3: // with something behind it
        fill(rng, datagram + size, 40);
        return size + 1 + test_rng_below(rng, 40);
    case 4: // far too long
        return frame(datagram, "VERGE_STATE", payload, 2000 + test_rng_below(rng, 50000));
    case 5: return wrapping_fragment(rng, datagram);
    case 6: // another type on our channel
        fill(rng, payload, CODEC_STATE_SIZE);
        return frame(datagram, "VERGE_STATE", payload, CODEC_STATE_SIZE);
    case 7: // a name without an end
        memset(datagram + HEADER, 'A', 500);
        return HEADER + test_rng_below(rng, 500);
    default: // another protocol
        return frame(datagram, "LIDAR_FRONT", payload, test_rng_below(rng, 3000));
    }
}

/// A socket that sends to the group.
static int group_socket(void)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(PORT), .sin_addr.s_addr = inet_addr(GROUP),
    };
    const int     fd = socket(AF_INET, SOCK_DGRAM, 0);
    const uint8_t ttl = 0;
    setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    assert_int_equal(connect(fd, (const struct sockaddr*)&to, sizeof to), 0);
    return fd;
}

static void send_datagram(int fd, const uint8_t* datagram, size_t size)
{
    assert_int_equal(send(fd, datagram, size, 0), size);
}

static void check_flood(transport* bus, int fd)
{
    static uint8_t           datagram[ROOM + 200];
    static transport_message messages[64];
    test_rng       rng = test_rng_seeded("hostile");
    const uint32_t rounds = test_rounds(20000);
    uint64_t       sent = 0;
    uint32_t       good_sent = 0, good_received = 0;

    for (uint32_t round = 0; round < rounds; ++round) {
        send_datagram(fd, datagram, bad_frame(&rng, datagram));
        ++sent;
        if (round % 5 == 0) { // a Unix socket holds ten
            send_datagram(fd, datagram, good_frame(datagram, (int32_t)good_sent));
            ++sent;
            ++good_sent;
            uint32_t got;
            while ((got = transport_drain(bus, messages, 64)) > 0) {
                for (uint32_t i = 0; i < got; ++i) {
                    const verge_vehicle_state_t* s = &messages[i].as.state;
                    assert_null(wire_state_check(s));
                    if (s->vehicle_id != 1000000) { // a mutation of the sequence number changes
                        assert_int_equal(s->vehicle_id, good_received); // nothing: that is 1000000
                        ++good_received;
                    }
                }
            }
        }
    }
    struct pollfd waiting = { .fd = transport_fd(bus), .events = POLLIN };
    while (poll(&waiting, 1, 100) > 0) {
        (void)transport_drain(bus, messages, 64);
    }
    const transport_stats stats = transport_statistics(bus);
    assert_int_equal(good_received, good_sent);
    assert_int_equal(stats.received + stats.malformed + stats.foreign + stats.dropped, sent);
    assert_int_equal(stats.dropped, 0);
    assert_int_equal(stats.errors, 0);
    assert_true(stats.malformed > rounds / 2);
    close(fd);
    transport_close(bus);
}

static void test_a_flood_of_hostile_datagrams_costs_no_good_message(void** state)
{
    (void)state;
    char       error[256];
    transport* bus;
    if (transport_open(&bus, url, TRANSPORT_STATES, error, sizeof error) != TRANSPORT_OK) {
        printf("             SKIPPED: %s\n", error);
        skip();
    }
    check_flood(bus, group_socket());
}

static void test_a_flood_on_a_unix_socket_costs_no_good_message(void** state)
{
    (void)state;
    char               error[256], socket_url[128];
    transport*         bus;
    struct sockaddr_un to = { .sun_family = AF_UNIX };
    snprintf(to.sun_path, sizeof to.sun_path, "/tmp/verge_test_hostile_%d", (int)getpid());
    snprintf(socket_url, sizeof socket_url, "unix:%s", to.sun_path);
    assert_int_equal(transport_open(&bus, socket_url, TRANSPORT_STATES, error, sizeof error),
                     TRANSPORT_OK);
    const int fd = socket(AF_UNIX, SOCK_DGRAM, 0);
    assert_int_equal(connect(fd, (const struct sockaddr*)&to, sizeof to), 0);
    check_flood(bus, fd);
}

static void test_datagrams_lost_in_the_kernel_are_counted(void** state)
{
    (void)state;
    static uint8_t           datagram[2000];
    static transport_message messages[64];
    char                     error[256];
    transport*               bus;
    if (transport_open(&bus, "lcm:udpm://239.255.76.67:17667?ttl=0&recv_buf_size=4096",
                       TRANSPORT_STATES, error, sizeof error) != TRANSPORT_OK) {
        printf("             SKIPPED: %s\n", error);
        skip();
    }
    const int fd = group_socket();
    uint64_t  received = 0;
    for (int32_t id = 0; id < 200; ++id) {
        send_datagram(fd, datagram, good_frame(datagram, id));
    }
    for (uint32_t got; (got = transport_drain(bus, messages, 64)) > 0;) {
        received += got;
    }
    send_datagram(fd, datagram, good_frame(datagram, 200)); // brings the kernel's count with it
    received += transport_drain(bus, messages, 64);
    assert_true(received < 201);
    assert_int_equal(transport_statistics(bus).dropped, 201 - received);
    close(fd);
    transport_close(bus);
}

static void test_an_attacker_with_the_checksum_still_meets_the_ranges(void** state)
{
    (void)state;
    static inbox       box;
    static inbox_view  view;
    const inbox_limits limits = inbox_default_limits();
    inbox_init(&box, &limits, VERGE_VEHICLES_MAX, VERGE_CONTROLLED_MAX);
    test_rng rng = test_rng_seeded("forged states");
    int64_t  now = start;

    for (uint32_t round = 0; round < test_rounds(50000); ++round) {
        uint8_t                     bytes[CODEC_SIZE_MAX];
        transport_message           message;
        const verge_vehicle_state_t good = car((int32_t)test_rng_below(&rng, 100));
        codec_encode(TRANSPORT_STATE, &good, bytes);
        codec_put_u64(bytes + 8, (uint64_t)now);
        const size_t at = 16 + test_rng_below(&rng, CODEC_STATE_SIZE - 4 - 16 - 8);
        fill(&rng, bytes + at, 1 + test_rng_below(&rng, 8)); // any bits in one or two fields
        codec_put_u32(bytes + CODEC_STATE_SIZE - 4,
                      transport_crc32(bytes + 8, CODEC_STATE_SIZE - 12));

        assert_true(codec_decode(TRANSPORT_STATE, bytes, CODEC_STATE_SIZE, &message));
        (void)inbox_offer(&box, &message.as.state, now, NULL);
        now += 5000;
        if (round % 64 == 0) {
            inbox_snapshot(&box, now, &view);
            for (uint32_t i = 0; i < view.count; ++i) {
                const verge_vehicle* v = &view.vehicles[i];
                CHECK_BETWEEN(v->x, -1e7, 1e7);
                CHECK_BETWEEN(v->y, -1e7, 1e7);
                CHECK_BETWEEN(v->heading, -3.1415927, 3.1415927);
                CHECK_BETWEEN(v->speed, -15.0, 70.0);
                CHECK_BETWEEN(v->acceleration, -30.0, 30.0);
                CHECK_BETWEEN(v->length, 0.5, 30.0);
                CHECK_BETWEEN(v->habit.cooperation, 0.0, 1.0);
                assert_true(i == 0 || v[-1].id < v->id);
            }
        }
    }
    assert_true(box.counters.rx_accepted > 0 && box.counters.rx_out_of_range > 0);
}

static void test_a_forged_plan_that_is_accepted_has_finite_values(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("forged plans");
    uint32_t passed = 0;
    for (uint32_t round = 0; round < test_rounds(20000); ++round) {
        uint8_t              bytes[CODEC_SIZE_MAX];
        transport_message    message;
        verge_point          points[VERGE_POINTS_MAX];
        verge_vehicle_plan_t plan = {
            .utime = start, .valid_until_utime = start + 1, .point_count = 31, .dt_ms = 100,
            .action_count = 7, .protocol_version = WIRE_PROTOCOL_VERSION,
        };
        codec_encode(TRANSPORT_PLAN, &plan, bytes);
        const size_t at = 24 + test_rng_below(&rng, CODEC_PLAN_SIZE - 4 - 24 - 8);
        fill(&rng, bytes + at, 1 + test_rng_below(&rng, 8));
        codec_put_u32(bytes + CODEC_PLAN_SIZE - 4,
                      transport_crc32(bytes + 8, CODEC_PLAN_SIZE - 12));
        assert_true(codec_decode(TRANSPORT_PLAN, bytes, CODEC_PLAN_SIZE, &message));
        if (wire_plan_check(&message.as.plan) == NULL) {
            ++passed;
            const uint32_t count = wire_points_from_plan(&message.as.plan, points);
            for (uint32_t i = 0; i < count; ++i) {
                CHECK_BETWEEN(points[i].x, -1e7, 1e7);
                CHECK_BETWEEN(points[i].speed, -15.0, 70.0);
                CHECK_BETWEEN(points[i].jerk, -60000.0, 60000.0);
            }
        }
    }
    assert_true(passed > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_flood_of_hostile_datagrams_costs_no_good_message),
        cmocka_unit_test(test_a_flood_on_a_unix_socket_costs_no_good_message),
        cmocka_unit_test(test_datagrams_lost_in_the_kernel_are_counted),
        cmocka_unit_test(test_an_attacker_with_the_checksum_still_meets_the_ranges),
        cmocka_unit_test(test_a_forged_plan_that_is_accepted_has_finite_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
