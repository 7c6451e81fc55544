// As much of Arduino as the examples use, on a desk: Serial is stdout, time passes when it is asked.
#ifndef ARDUINO_H
#define ARDUINO_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define F(text) text
#ifdef __AVR__
#include <avr/pgmspace.h>
#else
#define PROGMEM
#define memcpy_P memcpy
#endif

#define LED_BUILTIN 13
#define OUTPUT 1
#define INPUT_PULLUP 2
#define HEX 16
#define HIGH 1
#define LOW 0
inline void pinMode(int, int) {}
inline void digitalWrite(int, int) {}
inline void analogWrite(int, int) {}
extern uint32_t stub_closes_ms; // when every contact to ground closes
inline int digitalRead(int);

extern uint64_t stub_us;
inline uint32_t micros() { return static_cast<uint32_t>(stub_us += 4u); }
inline uint32_t millis() { return static_cast<uint32_t>(stub_us / 1000u); }
inline int digitalRead(int) { return stub_us - 0xfff00000u >= stub_closes_ms * 1000u ? LOW : HIGH; }
extern const char *stub_words; // that somebody types

struct StubSerial {
    void begin(unsigned long) {}
    explicit operator bool() const { return false; }
    int available() const { return *stub_words != '\0'; }
    int read() { return *stub_words++; }
    void print(const char *text) { printf("%s", text); }
    void print(char c) { printf("%c", c); }
    void print(int n) { printf("%d", n); }
    void print(unsigned n) { printf("%u", n); }
    void print(unsigned n, int) { printf("%X", n); }
    void print(unsigned long n) { printf("%lu", n); }
    void print(float x, int digits) { printf("%.*f", digits, static_cast<double>(x)); }
    template <class T> void println(T x) { print(x), printf("\n"); }
    void println(unsigned n, int base) { print(n, base), printf("\n"); }
    void println(float x, int digits) { print(x, digits), printf("\n"); }
};
extern StubSerial Serial;

void setup();
void loop();

#endif
