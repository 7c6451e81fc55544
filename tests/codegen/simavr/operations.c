/* On the chip: reads two numbers, and writes what one operation makes of them. */
#include <math.h>

#include "uart.h"

static union {
    float numbers[2];
    uint32_t bits[2];
} in;

int main(void)
{
    uart_begin();
    for (;;) {
        float out;
        uart_read(&in, sizeof in);
        GPIOR0 = 1;
        out = OPERATION;
        GPIOR0 = 0;
        uart_write(&out, sizeof out);
    }
}
