// The same functions on a computer, so that the firmware runs there as well, with the same plans.
#include "board.h"

#include <stdio.h>
#include <stdlib.h>

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
