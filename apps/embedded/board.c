// The mps2-an500 board: start-up, UART, clock and exit. Everything else is the C compiler's.
#include "board.h"

#include <string.h>

int main(int argc, char** argv);
void reset(void) __attribute__((noreturn));

// From the linker script.
extern uint32_t arena_start[], arena_end[], bss_start[], bss_end[], data_start[], data_end[];
extern uint32_t stack_top[];
extern const uint32_t data_image[];

// CMSDK peripherals of the board.
#define UART_DATA (*(volatile uint32_t*)0x40004000)
#define UART_STATE (*(volatile uint32_t*)0x40004004) // bit 0: the transmitter is full
#define UART_CONTROL (*(volatile uint32_t*)0x40004008)
#define UART_DIVIDER (*(volatile uint32_t*)0x40004010)
#define TIMER_CONTROL (*(volatile uint32_t*)0x40000000)
#define TIMER_VALUE (*(volatile uint32_t*)0x40000004) // counts down
#define TIMER_RELOAD (*(volatile uint32_t*)0x40000008)
// Coprocessor access of the Cortex-M7.
#define CPACR (*(volatile uint32_t*)0xE000ED88)

static void start_devices(void)
{
    UART_DIVIDER = 25000000 / 115200;
    UART_CONTROL = 1; // transmit
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE = UINT32_MAX;
    TIMER_CONTROL = 1;
}

void reset(void)
{
    CPACR |= 0xFu << 20; // full access to the floating point unit
    __asm__ volatile("dsb\n isb");
    memcpy(data_start, data_image, (size_t)((char*)data_end - (char*)data_start));
    memset(arena_start, 0, (size_t)((char*)arena_end - (char*)arena_start));
    memset(bss_start, 0, (size_t)((char*)bss_end - (char*)bss_start));
    start_devices();
    board_exit(main(0, NULL));
}

bool board_wait(void)
{
    static uint32_t cycles;
    return cycles++ < 150;
}

void board_write(const char* text)
{
    for (; *text != '\0'; ++text) {
        while (UART_STATE & 1u) {
        }
        UART_DATA = (uint8_t)*text;
    }
}

uint32_t board_ticks(void)
{
    return UINT32_MAX - TIMER_VALUE;
}

/// By semihosting, which an emulator or a debugger serves: SYS_EXIT_EXTENDED.
void board_exit(int status)
{
    const uint32_t block[2] = { 0x20026 /* the application ended */, (uint32_t)status };
    register uint32_t        operation __asm__("r0") = 0x20;
    register const uint32_t* argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : "+r"(operation) : "r"(argument) : "memory");
    for (;;) {
    }
}

static void fault(void)
{
    board_write("fault\n");
    board_exit(99);
}

__attribute__((section(".vectors"), used)) static const void* const vectors[16] = {
    stack_top, (const void*)reset, (const void*)fault, (const void*)fault, (const void*)fault,
    (const void*)fault, (const void*)fault, 0, 0, 0, 0, (const void*)fault, (const void*)fault, 0,
    (const void*)fault, (const void*)fault,
};
