/* Runs a sketch on an emulated AVR and prints what it says on Serial.
 *
 *   sketch ELF MCU MILLISECONDS [MILLISECONDS WORD]...
 *
 * At each of the later times a WORD and a line's end are typed. The clock is the chip's own. */
#include <simavr/avr_eeprom.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq, (void)param;
    putchar((int)value);
}

/* simavr talks on stdout, which is not for talk. */
static void on_talk(avr_t *chip, const int level, const char *format, va_list words)
{
    (void)chip;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, words);
    }
}

int main(int count, char **words)
{
    elf_firmware_t firmware;
    avr_t *avr;
    avr_global_logger_set(on_talk);
    memset(&firmware, 0, sizeof firmware);
    if (count < 4 || elf_read_firmware(words[1], &firmware) != 0
        || (avr = avr_make_mcu_by_name(words[2])) == NULL) {
        fprintf(stderr, "sketch ELF MCU MILLISECONDS [MILLISECONDS WORD]...\n");
        return 2;
    }
    avr_init(avr);
    strcpy(firmware.mmcu, words[2]);
    firmware.frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    uint32_t flags = 0; /* neither echoes lines nor sleeps */
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_t *uart = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
    avr_irq_register_notify(uart + UART_IRQ_OUTPUT, on_byte, NULL);
    const uint64_t ms = 16000u;
    const uint64_t last = strtoull(words[3], NULL, 10) * ms;
    int next = 4;
    const char *text = NULL;
    uint64_t ready = 0;
    while (avr->cycle < last) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the chip stopped at cycle %llu\n", (unsigned long long)avr->cycle);
            return 1;
        }
        if (text == NULL && next + 1 < count && avr->cycle >= strtoull(words[next], NULL, 10) * ms) {
            text = words[next + 1];
            next += 2;
        }
        if (text != NULL && avr->cycle >= ready) {
            avr_raise_irq(uart + UART_IRQ_INPUT, *text != '\0' ? (uint8_t)*text : '\n');
            ready = avr->cycle + 2u * ms;
            text = *text != '\0' ? text + 1 : NULL;
        }
    }
    return 0;
}
