/// Goal: blocks are aligned, zeroed and disjoint; the measured size is the size that is needed.
#include "base/arena.h"
#include "check.h"
#include "rng.h"

static _Alignas(64) uint8_t memory[4096];

static void test_blocks_are_aligned_zeroed_and_disjoint(void** state)
{
    (void)state;
    vg_arena arena;
    memset(memory, 0xa5, sizeof memory);
    vg_arena_init(&arena, memory, sizeof memory);

    uint8_t* a = vg_arena_take(&arena, 100);
    uint8_t* b = vg_arena_take(&arena, 1);

    assert_non_null(a);
    assert_non_null(b);
    assert_int_equal((uintptr_t)a % VG_ARENA_ALIGN, 0);
    assert_int_equal((uintptr_t)b % VG_ARENA_ALIGN, 0);
    assert_true(b >= a + 100);
    for (int i = 0; i < 100; ++i) {
        assert_int_equal(a[i], 0);
    }
    assert_int_equal(b[0], 0);
}

static void test_the_measured_memory_size_is_exactly_enough(void** state)
{
    (void)state;
    test_rng rng = test_rng_seeded("arena");
    for (uint32_t round = 0; round < test_rounds(200); ++round) {
        size_t sizes[12];
        vg_arena measure, arena;
        vg_arena_init(&measure, NULL, 0);
        for (int i = 0; i < 12; ++i) {
            sizes[i] = test_rng_below(&rng, 300);
            assert_null(vg_arena_take(&measure, sizes[i]));
        }
        assert_false(measure.failed);
        assert_true(measure.used <= sizeof memory);

        vg_arena_init(&arena, memory, measure.used);
        for (int i = 0; i < 12; ++i) {
            assert_non_null(vg_arena_take(&arena, sizes[i]));
        }
        assert_false(arena.failed);
        assert_int_equal(arena.used, measure.used);
        assert_null(vg_arena_take(&arena, 1));
        assert_true(arena.failed);
    }
}

static void test_a_size_that_wraps_is_refused(void** state)
{
    (void)state;
    vg_arena arena;
    vg_arena_init(&arena, memory, sizeof memory);
    assert_null(vg_arena_take(&arena, SIZE_MAX - 10));
    assert_true(arena.failed);
}

static void test_emptied_memory_is_handed_out_again_and_the_peak_stays(void** state)
{
    (void)state;
    vg_arena arena;
    vg_arena_init(&arena, memory, sizeof memory);
    uint8_t* first = vg_arena_take(&arena, 1000);
    memset(first, 7, 1000);
    vg_arena_empty(&arena);
    uint8_t* again = vg_arena_take(&arena, 10);
    assert_ptr_equal(first, again);
    assert_int_equal(again[9], 0);
    assert_int_equal(arena.peak, 1024);
    assert_int_equal(arena.used, 64);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blocks_are_aligned_zeroed_and_disjoint),
        cmocka_unit_test(test_the_measured_memory_size_is_exactly_enough),
        cmocka_unit_test(test_a_size_that_wraps_is_refused),
        cmocka_unit_test(test_emptied_memory_is_handed_out_again_and_the_peak_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
