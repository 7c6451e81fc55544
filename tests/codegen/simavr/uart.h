/* UART 0 of an ATmega at 2 Mbaud, polled, and the mark that the host takes the time by. */
#include <avr/io.h>
#include <stdint.h>

static void uart_begin(void)
{
    UCSR0A = (uint8_t)(1 << U2X0);
    UBRR0 = 0;
    UCSR0B = (uint8_t)((1 << RXEN0) | (1 << TXEN0));
}

static void uart_read(void *place, uint8_t size)
{
    uint8_t *at = place;
    while (size-- > 0) {
        while (!(UCSR0A & (1 << RXC0))) {
        }
        *at++ = UDR0;
    }
}

static void uart_write(const void *place, uint8_t size)
{
    const uint8_t *at = place;
    while (size-- > 0) {
        while (!(UCSR0A & (1 << UDRE0))) {
        }
        UDR0 = *at++;
    }
}
