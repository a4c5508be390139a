// What printf() of newlib calls on a board without an operating system.
#include "board.h"

int _write(int file, const char* text, int size);

int _write(int file, const char* text, int size)
{
    (void)file;
    for (int i = 0; i < size; ++i) {
        const char one[2] = { text[i], '\0' };
        board_write(one);
    }
    return size;
}
