/* A board on this machine: HardwareInTheLoop's frames at a pseudo-terminal, and what can go wrong with
 * them.
 *
 *   host WHAT N
 *
 * The first line of stdout names the terminal. WHAT: well; silent; mute: each Nth answer is not sent;
 * garbles: a bit of each Nth answer is turned; deaf: each Nth byte is not received; stops, dies: after
 * N answers; baud: the line's rate is N percent of the board's. */
#define _GNU_SOURCE
#include "hil.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static uint32_t hil_micros(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u);
}

static uint32_t hil_stack_left(void)
{
    return HIL_UNKNOWN;
}

/* The level of a line on which bytes follow each other, at a time in bits: start bit, eight, stop bit. */
static int level(const uint8_t *bytes, size_t count, double at)
{
    const size_t bit = (size_t)at;
    if (bit / 10u >= count) {
        return 1;
    }
    const size_t place = bit % 10u;
    return place == 0u ? 0 : place == 9u ? 1 : bytes[bit / 10u] >> (place - 1u) & 1;
}

/* Return how many bytes a receiver makes of some that are sent at `rate` times its own rate. */
static size_t received(const uint8_t *bytes, size_t count, double rate, uint8_t *into, size_t most)
{
    size_t found = 0;
    for (double at = 0.0; at < 10.0 * (double)count && found < most; at += 0.05 * rate) {
        if (level(bytes, count, at) == 0) {
            into[found] = 0;
            for (int n = 0; n < 8; ++n) {
                into[found] |= (uint8_t)(level(bytes, count, at + (n + 1.5) * rate) << n);
            }
            ++found;
            at += 9.5 * rate;
        }
    }
    return found;
}

int main(int count, char **words)
{
    if (count != 3) {
        return 2;
    }
    const char *what = words[1];
    const long n = atol(words[2]);
    const int other_rate = strcmp(what, "baud") == 0;
    const int line = posix_openpt(O_RDWR | O_NOCTTY);
    if (line < 0 || grantpt(line) != 0 || unlockpt(line) != 0) {
        return 1;
    }
    const int kept = open(ptsname(line), O_RDWR | O_NOCTTY); /* the line stays up with nobody at it */
    struct termios raw;
    tcgetattr(kept, &raw);
    cfmakeraw(&raw);
    tcsetattr(kept, TCSANOW, &raw);
    printf("%s\n", ptsname(line));
    fflush(stdout);
    static hil wire;
    static uint8_t in[4096], seen[4096], out[4096];
    hil_begin(&wire);
    long bytes = 0, answers = 0;
    for (;;) {
        const ssize_t got = read(line, in, other_rate ? 64 : sizeof in);
        if (got <= 0) {
            return 1;
        }
        size_t have = (size_t)got;
        memcpy(seen, in, have);
        if (other_rate) {
            have = received(in, have, (double)n / 100.0, seen, sizeof seen);
        }
        for (size_t k = 0; k < have && strcmp(what, "silent") != 0; ++k) {
            if (strcmp(what, "deaf") == 0 && ++bytes % n == 0) {
                continue;
            }
            size_t send = hil_take(&wire, seen[k], hil_micros());
            if (send == 0u) {
                continue;
            }
            ++answers;
            if (strcmp(what, "dies") == 0 && answers > n) {
                return 0;
            }
            if (strcmp(what, "stops") == 0 && answers > n) {
                continue;
            }
            memcpy(out, wire.send, send);
            if (strcmp(what, "mute") == 0 && answers % n == 0) {
                continue;
            }
            if (strcmp(what, "garbles") == 0 && answers % n == 0) {
                out[answers % (long)send] ^= 0x10u;
            }
            if (other_rate) {
                send = received(wire.send, send, 100.0 / (double)n, out, sizeof out);
            }
            if (write(line, out, send) < 0) {
                return 1;
            }
        }
    }
}
