/// What the firmware needs of its board, in four functions. board.c has them for the mps2-an500
/// (Cortex-M7), desktop.c for a computer. For another board: write this file's functions and a
/// linker script for it; main.c stays as it is.
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

/// Waits for the start of the next cycle. False: the program ends. Here it does not wait, and
/// returns true 150 times; a board of your own has a timer for it.
bool board_wait(void);

/// Writes a text to the first UART; returns when the last byte is on its way.
void board_write(const char* text);

/// Ticks of a clock of 25 MHz since the start; 0 where there is none. Wraps after 171 s.
uint32_t board_ticks(void);

/// Ends the program. Does not return.
void board_exit(int status) __attribute__((noreturn));

#endif
