#include "Arduino.h"

Uart Serial;
static volatile uint32_t turns; // of timer 1

ISR(TIMER1_OVF_vect)
{
    turns += 1u;
}

uint32_t micros()
{
    cli();
    uint32_t high = turns;
    const uint16_t low = TCNT1;
    if ((TIFR1 & (1u << TOV1)) != 0u && low < 0x8000u) {
        high += 1u;
    }
    sei();
    return high << 15 | low >> 1;
}

int main()
{
    TCCR1A = 0;
    TCCR1B = 1u << CS11;
    TIMSK1 = 1u << TOIE1;
    sei();
    setup();
    for (;;) {
        loop();
    }
}
