/* On the chip: reads depth, volume and reference, calls the controller, writes its command. */
#include "swb_controller.h"
#include "uart.h"

#ifndef FIRST
#define FIRST 0.0f
#endif

static swb_controller controller;

int main(void)
{
    uart_begin();
    swb_controller_begin(&controller, FIRST);
    for (;;) {
        float seen[3];
        uart_read(seen, sizeof seen);
        GPIOR0 = 1;
        const float command = swb_controller_tick(&controller, seen[0], seen[1], seen[2]);
        GPIOR0 = 0;
        uart_write(&command, sizeof command);
    }
}
