/* On the chip: reads what is seen and the depth asked for, calls the vehicle, writes its command and
 * the bits of its reasons. */
#include "swb_vehicle.h"
#include "uart.h"

static swb_vehicle vehicle;

int main(void)
{
    uart_begin();
    swb_vehicle_begin(&vehicle, false);
    for (;;) {
        float in[7];
        float out[2];
        uart_read(in, sizeof in);
        const swb_seen seen = {.depth = in[0], .depth_age = in[1], .volume = in[2],
            .battery = in[3], .leak = in[4] > 0.0f, .lost_ticks = (uint32_t)in[5]};
        GPIOR0 = 1;
        out[0] = swb_vehicle_tick(&vehicle, &seen, in[6]);
        GPIOR0 = 0;
        out[1] = (float)vehicle.reasons;
        uart_write(out, sizeof out);
    }
}
