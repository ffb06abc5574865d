/* The board on this computer: its serial line is standard input and output. */
#include <unistd.h>
#include "board_line.h"

int main(void)
{
    static board_line line;
    unsigned char byte;
    line_init(&line);
    while (read(0, &byte, 1) == 1) {
        const unsigned count = line_take(&line, byte);
        if (count && write(1, line.out, count) != (ssize_t)count)
            return 1;
    }
    return 0;
}
