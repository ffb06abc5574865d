/* A client of the controller in plain C, over UDP: it answers each sample with delta = -0.1 q. See ../PROTOCOL.md. */
#include <arpa/inet.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#pragma pack(push, 1)
struct message { /* of a little endian machine, as x86 and arm are */
    uint16_t magic;
    uint8_t kind, count;
    uint32_t sequence;
    int64_t time;
    union { double values[255]; char text[16384]; } u;
};
#pragma pack(pop)
enum { HEADER = 16, SUBMIT = 1, OBTAIN = 2, DECLARE = 5, BYE = 6, MAGIC = 0x5447 };

/* Where a published quantity stands: the sizes of those declared before it. */
static int place_of(const char *text, const char *wanted) {
    int place = 0, size;
    char role[32], name[128], unit[64];
    for (; text && *text; text = strchr(text, '\n') ? strchr(text, '\n') + 1 : NULL) {
        if (sscanf(text, "%31[^\t]\t%127[^\t]\t%63[^\t]\t%d", role, name, unit, &size) < 4 || strcmp(role, "sends")) continue;
        if (!strcmp(name, wanted)) return place;
        place += size;
    }
    return -1;
}

int main(int argc, char **argv) {
    struct sockaddr_in there = {.sin_family = AF_INET, .sin_port = htons(argc > 1 ? atoi(argv[1]) : 5000)};
    struct timeval patience = {.tv_sec = 1};
    static struct message in, out, hello = {.magic = MAGIC, .kind = DECLARE};
    int own = socket(AF_INET, SOCK_DGRAM, 0), q = -1, answers = 0;
    inet_pton(AF_INET, "127.0.0.1", &there.sin_addr);
    setsockopt(own, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (connect(own, (struct sockaddr *)&there, sizeof there)) return perror("connect"), 1;
    strcpy(hello.u.text, "name\tstream\ntoken\t\nsends\tdelta\tm\t1\t-1.0\t1.0\n");
    send(own, &hello, HEADER + strlen(hello.u.text), 0);
    for (int silent = 0; silent < 10; silent++) {
        ssize_t length = recv(own, &in, sizeof in - 1, 0);
        if (length < HEADER || in.magic != MAGIC) { /* the controller is not there yet, or idle */
            sleep(1), send(own, &hello, HEADER + strlen(hello.u.text), 0);
            continue;
        }
        silent = -1, ((char *)&in)[length] = 0; /* the end of a text */
        if (in.kind == BYE) return printf("%d answers; %s\n", answers, in.u.text), 0;
        if (in.kind == DECLARE) q = place_of(in.u.text, "q");
        if (in.kind != SUBMIT || q < 0 || q >= in.count) continue;
        double measured = in.u.values[q];
        out.magic = MAGIC, out.kind = OBTAIN, out.count = 1, out.sequence = in.sequence, out.time = in.time;
        out.u.values[0] = -0.1 * measured;
        answers += send(own, &out, HEADER + 8, 0) > 0;
    }
    return fprintf(stderr, "the controller is silent\n"), 1;
}
