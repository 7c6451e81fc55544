/* On the chip: reads all that goes into a law's functions, and writes all that comes out. */
#include "uart.h"
#include LAW_HEADER

static struct {
    PARAMETERS p;
    STATE state;
    swb_measurement m;
    float reference;
} in;

static struct {
    STATE first;
    float command;
    STATE state;
    float next_s;
} out;

int main(void)
{
    uart_begin();
    for (;;) {
        uart_read(&in, sizeof in);
        GPIOR0 = 1;
        INITIAL(&in.p, &in.m, in.reference, &out.first);
        out.state = in.state;
        out.command = STEP(&in.p, &out.state, &in.m, in.reference, &out.next_s);
        GPIOR0 = 0;
        uart_write(&out, sizeof out);
    }
}
