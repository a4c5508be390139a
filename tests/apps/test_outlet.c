/// Goal: putting a record never waits for the writer. Written records are complete and in order,
/// dropped ones are counted. Closing waits up to the given time.
/// Method: a writer that the test blocks and releases.
#define _GNU_SOURCE
#include "check.h"

#include "daemon/outlet.h"

#include <pthread.h>
#include <stdio.h>
#include <unistd.h>

enum { QUEUE = 256, RECORD_MAX = 64, WRITTEN_MAX = 1 << 20, PATIENCE_US = 20000000 };

/// Writes to memory while it is open.
typedef struct tap {
    pthread_mutex_t lock;
    pthread_cond_t  turned;
    bool            open;
    bool            lossy;   // takes nothing: each record is lost
    char            written[WRITTEN_MAX];
    size_t          size;
} tap;

static tap water;

static bool on_write(void* context, const void* record, size_t size)
{
    tap* self = context;
    pthread_mutex_lock(&self->lock);
    while (!self->open) {
        pthread_cond_wait(&self->turned, &self->lock);
    }
    const bool taken = !self->lossy;
    if (taken) {
        assert_true(self->size + size <= WRITTEN_MAX);
        memcpy(self->written + self->size, record, size);
        self->size += size;
    }
    pthread_mutex_unlock(&self->lock);
    return taken;
}

static void turn(bool open, bool lossy)
{
    pthread_mutex_lock(&water.lock);
    water.open = open;
    water.lossy = lossy;
    pthread_cond_signal(&water.turned);
    pthread_mutex_unlock(&water.lock);
}

static outlet* open_outlet(bool open)
{
    const outlet_def def = { .name = "test-outlet", .queue_size = QUEUE, .record_max = RECORD_MAX,
                             .write = on_write, .context = &water };
    water.size = 0;
    turn(open, false);
    outlet* self = outlet_create(&def);
    assert_non_null(self);
    return self;
}

static void wait_until_idle(outlet* self)
{
    for (int tries = 0; !outlet_idle(self); ++tries) {
        assert_true(tries < 20000);
        usleep(1000);
    }
}

/// Record number i: its number and as many letters as its size asks for.
static size_t record_of(int i, char record[RECORD_MAX + 1])
{
    const int letters = i * 7 % (RECORD_MAX - 12);
    return (size_t)snprintf(record, RECORD_MAX + 1, "%d:%.*s\n", i, letters,
                            "abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz");
}

static void test_records_are_written_complete_and_in_order(void** state)
{
    (void)state;
    outlet* self = open_outlet(true);
    static char expected[WRITTEN_MAX];
    size_t size = 0;
    for (int i = 0; i < 5000; ++i) {
        char record[RECORD_MAX + 1];
        const size_t length = record_of(i, record);
        while (!outlet_put(self, record, length)) { // the ring goes round some hundred times
            wait_until_idle(self);
        }
        memcpy(expected + size, record, length);
        size += length;
    }
    assert_true(outlet_close(self, PATIENCE_US));
    assert_int_equal(water.size, size);
    assert_memory_equal(water.written, expected, size);
}

static void test_putting_drops_and_counts_while_the_writer_waits(void** state)
{
    (void)state;
    outlet* self = open_outlet(false);
    uint64_t refused = 0, put = 0;
    for (int i = 0; i < 1000; ++i) {
        refused += outlet_put(self, "0123456789", 10) ? 0 : 1;
    }
    put = 1000 - refused;
    assert_true(put >= QUEUE / 14 && put <= QUEUE / 14 + 1); // one may be with the writer
    assert_int_equal(outlet_dropped(self), refused);
    assert_false(outlet_idle(self));

    turn(true, false);
    wait_until_idle(self);
    assert_true(outlet_put(self, "again", 5)); // it works again
    assert_int_equal(outlet_dropped(self), refused);
    assert_true(outlet_close(self, PATIENCE_US));
    assert_int_equal(water.size, put * 10 + 5);
    assert_memory_equal(water.written + put * 10, "again", 5);
}

static void test_events_that_the_writer_loses_are_counted(void** state)
{
    (void)state;
    outlet* self = open_outlet(true);
    turn(true, true);
    for (int i = 0; i < 3; ++i) {
        assert_true(outlet_put(self, "lost", 4));
    }
    wait_until_idle(self);
    assert_int_equal(outlet_dropped(self), 3);
    turn(true, false);
    assert_true(outlet_put(self, "kept", 4));
    assert_true(outlet_close(self, PATIENCE_US));
    assert_int_equal(water.size, 4);
}

static void test_closing_writes_waiting_records_or_ends_at_its_time_limit(void** state)
{
    (void)state;
    outlet* self = open_outlet(false);
    assert_true(outlet_put(self, "first", 5));
    assert_true(outlet_put(self, "second", 6));
    assert_false(outlet_close(self, 1000)); // the thread is left behind, and may still write
    turn(true, false);
    for (int tries = 0; tries < 20000; ++tries) {
        pthread_mutex_lock(&water.lock);
        const size_t size = water.size;
        pthread_mutex_unlock(&water.lock);
        if (size == 11) {
            break;
        }
        usleep(1000);
    }
    self = open_outlet(true);
    assert_true(outlet_put(self, "whole", 5));
    assert_true(outlet_close(self, PATIENCE_US));
    assert_int_equal(water.size, 5);
    assert_true(outlet_close(NULL, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_records_are_written_complete_and_in_order),
        cmocka_unit_test(test_putting_drops_and_counts_while_the_writer_waits),
        cmocka_unit_test(test_events_that_the_writer_loses_are_counted),
        cmocka_unit_test(test_closing_writes_waiting_records_or_ends_at_its_time_limit),
    };
    pthread_mutex_init(&water.lock, NULL);
    pthread_cond_init(&water.turned, NULL);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
