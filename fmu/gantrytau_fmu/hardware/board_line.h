/* Framed serial protocol of a board: a controller step for each frame, no heap. From gantrytau.
 *
 * Frame: 0xA5, sequence number, bytes of payload, payload, CRC-16 (polynomial 0x1021, start 0xFFFF, low byte first) of all
 * between the first byte and the CRC. Payload: controller_real in the processor's order of bytes, little-endian.
 * An empty frame starts the controller anew. The same sequence number again: the answer was lost and is repeated. */
#ifndef BOARD_LINE_H
#define BOARD_LINE_H
#include "controller.h"

#define LINE_SYNC 0xA5u
#define LINE_IN (CONTROLLER_GIVEN * sizeof(controller_real))
#define LINE_OUT (CONTROLLER_FOUND * sizeof(controller_real))

typedef struct {
    controller_state controller;
    unsigned char in[LINE_IN + 5], out[LINE_OUT + 5];
    unsigned got, answer;               /* bytes in `in`, and of the last answer in `out` */
    int last;                           /* sequence number of the last answer, -1: none */
    unsigned long wrong_crc, skipped;   /* frames, bytes */
} board_line;

static void line_init(board_line *line)
{
    controller_init(&line->controller);
    line->got = line->answer = 0;
    line->last = -1;
    line->wrong_crc = line->skipped = 0;
}

static unsigned line_crc(const unsigned char *bytes, unsigned count)
{
    unsigned crc = 0xFFFFu;
    for (unsigned i = 0; i < count; i++) {
        crc ^= (unsigned)bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000u ? (crc << 1) ^ 0x1021u : crc << 1) & 0xFFFFu;
    }
    return crc;
}

static void line_copy(void *to, const void *from, unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        ((unsigned char *)to)[i] = ((const unsigned char *)from)[i];
}

static void line_skip(board_line *line, unsigned count)
{
    line->got -= count;
    for (unsigned i = 0; i < line->got; i++)
        line->in[i] = line->in[i + count];
}

static void line_work(board_line *line)
{
    controller_real given[CONTROLLER_GIVEN], found[CONTROLLER_FOUND];
    const unsigned size = line->in[2] ? (unsigned)LINE_OUT : 0u;
    if (line->last == line->in[1] && line->in[2])
        return;
    if (line->in[2]) {
        line_copy(given, line->in + 3, LINE_IN);
        controller_step(&line->controller, given, found);
        line_copy(line->out + 3, found, LINE_OUT);
    } else
        controller_init(&line->controller);
    line->last = line->in[1];
    line->out[0] = LINE_SYNC;
    line->out[1] = line->in[1];
    line->out[2] = (unsigned char)size;
    const unsigned crc = line_crc(line->out + 1, size + 2);
    line->out[size + 3] = (unsigned char)(crc & 0xFFu);
    line->out[size + 4] = (unsigned char)(crc >> 8);
    line->answer = size + 5;
}

/* Takes a byte; the number of bytes in line->out to be sent, 0 unless a frame is complete. */
static unsigned line_take(board_line *line, unsigned char byte)
{
    line->in[line->got++] = byte;
    while (line->got) {
        const unsigned size = line->got > 2 ? line->in[2] : 0u;
        if (line->in[0] != LINE_SYNC || (size != 0 && size != LINE_IN)) {
            line->skipped++;
            line_skip(line, 1);
        } else if (line->got < 3 || line->got < size + 5)
            return 0;
        else if (line_crc(line->in + 1, size + 2) != (line->in[size + 3] | (unsigned)line->in[size + 4] << 8)) {
            line->wrong_crc++;
            line_skip(line, 1);
        } else {
            line_work(line);
            line_skip(line, size + 5);
            return line->answer;
        }
    }
    return 0;
}
#endif
