/* An emulated AVR as a board on a serial port: runs a program, its UART 0 at a pseudo-terminal.
 *
 *   board ELF MCU SPEED
 *
 * The first line of stdout names the terminal. SPEED: of the chip's clock times real time, 0 as fast as
 * it goes. It ends with its stdin. */
#include <parts/uart_pty.h>
#include <poll.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { CLOCK = 16000000, TURN = 8000 }; /* Hz; cycles between looks at the time, half a millisecond */

/* simavr talks on stdout, which is not for talk. */
static void on_talk(avr_t *chip, const int level, const char *format, va_list words)
{
    (void)chip;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, words);
    }
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int ended(void)
{
    struct pollfd in = {.fd = 0, .events = POLLIN};
    char byte;
    return poll(&in, 1, 0) > 0 && read(0, &byte, 1) <= 0;
}

int main(int count, char **words)
{
    elf_firmware_t firmware;
    uart_pty_t line;
    if (count != 4) {
        fprintf(stderr, "board ELF MCU SPEED\n");
        return 2;
    }
    const double speed = atof(words[3]);
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(on_talk);
    avr_t *avr = avr_make_mcu_by_name(words[2]);
    if (avr == NULL || elf_read_firmware(words[1], &firmware) != 0) {
        fprintf(stderr, "cannot run %s on %s\n", words[1], words[2]);
        return 1;
    }
    avr_init(avr);
    strcpy(firmware.mmcu, words[2]);
    firmware.frequency = CLOCK;
    avr_load_firmware(avr, &firmware);
    uart_pty_init(avr, &line);
    uart_pty_connect(&line, '0');
    printf("%s\n", line.pty.slavename);
    fflush(stdout);
    const double began_s = now_s();
    for (avr_cycle_count_t next = TURN;; next += TURN) {
        while (avr->cycle < next) {
            const int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed) {
                fprintf(stderr, "the chip stopped at cycle %llu\n", (unsigned long long)avr->cycle);
                return 1;
            }
        }
        const double ahead_s = speed > 0.0
            ? (double)avr->cycle / CLOCK / speed - (now_s() - began_s) : 0.0;
        if (ahead_s > 0.0) {
            usleep((useconds_t)(1e6 * ahead_s));
        }
        if (ended()) {
            return 0;
        }
    }
}
