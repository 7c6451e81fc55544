// As much of Arduino as HardwareInTheLoop uses, on an ATmega: Serial is UART 0, polled; micros() counts
// timer 1, which turns at 2 MHz.
#ifndef ARDUINO_H
#define ARDUINO_H

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>
#include <stdint.h>

uint32_t micros();

struct Uart {
    void begin(unsigned long baud)
    {
        UCSR0A = (uint8_t)(1u << U2X0);
        UBRR0 = (uint16_t)(F_CPU / 8u / baud - 1u);
        UCSR0B = (uint8_t)((1u << RXEN0) | (1u << TXEN0));
    }
    int available() { return (UCSR0A & (1u << RXC0)) != 0u ? 1 : 0; }
    int read() { return UDR0; }
    size_t write(const uint8_t *bytes, size_t count)
    {
        for (size_t n = 0; n < count; ++n) {
            while ((UCSR0A & (1u << UDRE0)) == 0u) {
            }
            UDR0 = bytes[n];
        }
        return count;
    }
};
extern Uart Serial;

void setup();
void loop();

#endif
