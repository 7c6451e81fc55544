/* What Frama-C Eva runs, never a processor: a vehicle in memory that held anything, its tick for ever,
 * and any bits as what its sensors say: NaN, infinities and subnormals among them. At any tick the
 * program may begin anew. Eva shows that nothing in it is undefined, and the two assertions. */
#include <stdint.h>
#include <string.h>

#ifdef POOL
#include "swb_pool_day.h"
#else
#include "swb_vehicle.h"
#endif
#ifdef DRIVE
#include "swb_drive.h"
#endif

static volatile uint32_t any_bits;
static volatile uint8_t any_byte;

static float any_number(void)
{
    const uint32_t bits = any_bits;
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static void any_memory(void *place, size_t size)
{
    for (size_t at = 0; at < size; ++at) {
        ((uint8_t *)place)[at] = any_byte;
    }
}

static swb_seen any_seen(void)
{
    const swb_seen seen = {.depth = any_number(), .depth_age = any_number(),
        .volume = any_number(), .battery = any_number(), .leak = any_byte != 0u,
        .lost_ticks = any_bits};
    return seen;
}

#ifdef POOL
static swb_pool_day day;
#else
static swb_vehicle vehicle;
#endif

static void begin(void)
{
#ifdef POOL
    swb_pool_day_begin(&day, any_byte != 0u);
#else
    swb_vehicle_begin(&vehicle, any_byte != 0u);
#endif
}

static float tick(void)
{
    const swb_seen seen = any_seen();
#ifdef POOL
    return swb_pool_day_tick(&day, &seen, any_byte != 0u);
#else
    return swb_vehicle_tick(&vehicle, &seen, any_number());
#endif
}

int main(void)
{
#ifdef POOL
    any_memory(&day, sizeof day);
#else
    any_memory(&vehicle, sizeof vehicle);
#endif
#ifdef DRIVE
    swb_drive drive;
    swb_drive_begin(&drive, any_bits);
#endif
    begin();
    for (;;) {
        if (any_byte == 0u) {
            begin();
        }
        const float command = tick();
        /*@ assert finite: \is_finite(command); */
        /*@ assert within: SWB_COMMAND_LEAST <= command <= SWB_COMMAND_MOST; */
#ifdef DRIVE
        swb_drive_command(&drive, command, any_byte != 0u, any_bits);
        (void)swb_drive_outputs(&drive, any_bits);
#endif
    }
}
