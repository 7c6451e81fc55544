/* On the chip: reads what is seen and the depth asked for, calls the vehicle, writes its command and
 * its reasons. */
#include "swb_vehicle.h"
#include "uart.h"

static swb_vehicle vehicle;

static struct {
    swb_seen seen;
    float reference;
} in;

static struct {
    float command;
    uint16_t reasons;
} out;

int main(void)
{
    uart_begin();
#ifdef DISARMED
    swb_vehicle_switch_on(&vehicle, false, false);
#else
    swb_vehicle_begin(&vehicle, false);
#endif
    for (;;) {
        uart_read(&in, sizeof in);
#ifdef BEGINS /* a frame that begins anew, after a reset where it says there is a leak */
        if (in.seen.lost_ticks == 0xfffffffful) {
            swb_vehicle_begin(&vehicle, in.seen.leak);
            in.seen.lost_ticks = 0;
            in.seen.leak = false;
        }
#endif
        GPIOR0 = 1;
        out.command = swb_vehicle_tick(&vehicle, &in.seen, in.reference);
        GPIOR0 = 0;
        out.reasons = vehicle.reasons;
        uart_write(&out, sizeof out);
    }
}
