/* Runs a program on an emulated AVR and talks to it over its UART 0, frame by frame.
 *
 *   host ELF MCU INPUT OUTPUT STATIC
 *
 * Each INPUT bytes of stdin are sent to the chip; it answers with OUTPUT bytes, which go to stdout
 * with the number of cycles (4 bytes, little end first) between its setting and clearing GPIOR0.
 * STATIC: bytes of RAM at its beginning that belong to variables; at the end stderr is told the
 * most that the stack took, in bytes. */
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { GPIOR0 = 0x3e, PAINT = 0xc5, MOST = 4096 };
static const uint64_t PATIENCE = 400000000u; /* cycles that an answer may take */

static avr_t *avr;
static avr_irq_t *uart;
static uint8_t input[MOST], answer[MOST];
static size_t inputs, answers, sent, received;
static int may_send;
static uint64_t began, took;

static void send_some(void)
{
    while (may_send && sent < inputs) {
        avr_raise_irq(uart + UART_IRQ_INPUT, input[sent++]);
    }
}

static void on_xon(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)value, (void)param;
    may_send = 1;
    send_some();
}

static void on_xoff(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)value, (void)param;
    may_send = 0;
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)param;
    if (received < MOST) {
        answer[received++] = (uint8_t)value;
    }
}

static void on_mark(struct avr_t *chip, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    chip->data[address] = value;
    if (value) {
        began = chip->cycle;
    } else {
        took = chip->cycle - began;
    }
}

/* simavr talks on stdout, which is not for talk. */
static void on_talk(avr_t *chip, const int level, const char *format, va_list words)
{
    (void)chip;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, words);
    }
}

static void start(const char *elf, const char *mcu)
{
    elf_firmware_t firmware;
    avr_global_logger_set(on_talk);
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(elf, &firmware) != 0 || (avr = avr_make_mcu_by_name(mcu)) == NULL) {
        fprintf(stderr, "cannot run %s on %s\n", elf, mcu);
        exit(1);
    }
    avr_init(avr);
    strcpy(firmware.mmcu, mcu);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    memset(avr->data + avr->ioend + 1, PAINT, avr->ramend - avr->ioend);
    uint32_t flags = 0; /* neither echoes lines nor sleeps */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    uart = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
    avr_irq_register_notify(uart + UART_IRQ_OUTPUT, on_byte, NULL);
    avr_irq_register_notify(uart + UART_IRQ_OUT_XON, on_xon, NULL);
    avr_irq_register_notify(uart + UART_IRQ_OUT_XOFF, on_xoff, NULL);
    avr_register_io_write(avr, GPIOR0, on_mark, NULL);
}

static int answered(void)
{
    const uint64_t last = avr->cycle + PATIENCE;
    while (received < answers) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed || avr->cycle > last) {
            fprintf(stderr, "the chip stopped at cycle %llu\n", (unsigned long long)avr->cycle);
            return 0;
        }
    }
    return 1;
}

int main(int count, char **words)
{
    if (count != 6) {
        fprintf(stderr, "host ELF MCU INPUT OUTPUT STATIC\n");
        return 2;
    }
    inputs = strtoul(words[3], NULL, 10);
    answers = strtoul(words[4], NULL, 10);
    if (inputs > MOST || answers > MOST) {
        return 2;
    }
    start(words[1], words[2]);
    while (fread(input, inputs, 1, stdin) == 1) {
        sent = received = 0;
        send_some();
        if (!answered()) {
            return 1;
        }
        const uint32_t cycles = (uint32_t)took;
        fwrite(answer, answers, 1, stdout);
        fwrite(&cycles, sizeof cycles, 1, stdout);
        fflush(stdout);
    }
    uint32_t at = avr->ioend + 1 + (uint32_t)strtoul(words[5], NULL, 10);
    while (at <= avr->ramend && avr->data[at] == PAINT) {
        ++at;
    }
    fprintf(stderr, "%u\n", avr->ramend + 1 - at);
    return 0;
}
