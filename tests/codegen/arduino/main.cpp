// Runs a sketch for a number of turns of its loop.
#include "Arduino.h"

#ifndef TURNS
#define TURNS 1500000L
#endif

#ifndef WORDS
#define WORDS ""
#endif
#ifndef CLOSES_MS
#define CLOSES_MS 4000000u
#endif

const char *stub_words = WORDS;
uint32_t stub_closes_ms = CLOSES_MS;
uint64_t stub_us = 0xfff00000u; // the clock goes over its end soon
StubSerial Serial;

int main()
{
    setup();
    for (long n = 0; n < TURNS; ++n) {
        loop();
    }
    return 0;
}
