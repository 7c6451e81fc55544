/* On the chip: reads what is seen and whether it may begin, calls the pool day, writes its command, the
 * bits of the supervisor's reasons and the phase. */
#include "swb_pool_day.h"
#include "uart.h"

static swb_pool_day day;

int main(void)
{
    uart_begin();
    swb_pool_day_begin(&day, false);
    for (;;) {
        float in[7];
        float out[3];
        uart_read(in, sizeof in);
        const swb_seen seen = {.depth = in[0], .depth_age = in[1], .volume = in[2],
            .battery = in[3], .leak = in[4] > 0.0f, .lost_ticks = (uint32_t)in[5]};
        GPIOR0 = 1;
        out[0] = swb_pool_day_tick(&day, &seen, in[6] > 0.0f);
        GPIOR0 = 0;
        out[1] = (float)day.vehicle.reasons;
        out[2] = (float)swb_pool_phase(&day);
        uart_write(out, sizeof out);
    }
}
