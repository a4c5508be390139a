// The same functions on a computer, so that the firmware runs there as well, with the same plans.
#include "board.h"

#include <stdio.h>
#include <stdlib.h>

/// VERGE_CYCLES in the environment: another number of cycles, for tools/machines.
bool board_wait(void)
{
    static int cycles;
    const char* given = getenv("VERGE_CYCLES");
    return cycles++ < (given == NULL ? 150 : atoi(given));
}

void board_write(const char* text)
{
    fputs(text, stdout);
}

uint32_t board_ticks(void)
{
    return 0;
}

void board_exit(int status)
{
    exit(status);
}
