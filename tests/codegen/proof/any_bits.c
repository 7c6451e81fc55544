/* What Frama-C Eva runs, never a processor: a vehicle and its black box in memory that held anything,
 * switched on, their tick for ever, and any bits as what the sensors say: NaN, infinities and subnormals
 * among them. At any tick it may be armed by hand, and the program may begin anew, after a reset or a
 * loss of power. Eva shows that nothing in it is undefined, and the assertions. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#ifdef POOL
#include "swb_pool_day.h"
#else
#include "swb_vehicle.h"
#endif
#include "swb_box.h"
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
#define VEHICLE day.vehicle
#else
static swb_vehicle vehicle;
#define VEHICLE vehicle
#endif
static swb_box box;
static uint8_t store[SWB_BOX_BYTES];

static uint8_t kept(uint16_t at)
{
    (void)at;
    return any_byte;
}

static void begin(void)
{
    const bool after_reset = any_byte != 0u;
    const bool keeps = any_byte != 0u;
    const bool was_armed = swb_box_begin(&box, after_reset, keeps ? kept : NULL, any_byte);
#ifdef POOL
    swb_pool_day_switch_on(&day, after_reset, was_armed);
#else
    swb_vehicle_switch_on(&vehicle, after_reset, was_armed);
#endif
}

static float tick(const swb_seen *seen)
{
#ifdef POOL
    return swb_pool_day_tick(&day, seen, any_byte != 0u);
#else
    return swb_vehicle_tick(&vehicle, seen, any_number());
#endif
}

static void tick_box(const swb_seen *seen, float command)
{
    uint16_t at;
    uint8_t byte;
    swb_box_tick(&box, &VEHICLE, seen, command);
    if (swb_box_save(&box, &at, &byte)) {
        store[at] = byte;
    }
    if (any_byte == 0u) {
        swb_box_clear(&box);
    }
    for (uint8_t n = 0; n < box.count; ++n) {
        (void)swb_box_at(&box, n);
    }
}

/* The command that holds a vehicle which is not armed. */
static void hold(const swb_seen *seen)
{
    swb_vehicle copy = VEHICLE;
    float command;
    if (swb_vehicle_held(&copy, seen, &command)) {
#ifdef POSITIONER
        if (isfinite(command)) { /* else it is to stay where it is */
            /*@ assert held: SWB_COMMAND_LEAST <= command <= SWB_COMMAND_MOST; */
        }
#else
        /*@ assert held: command == 0.0f; */
#endif
    }
}

int main(void)
{
    any_memory(&VEHICLE, sizeof VEHICLE);
    any_memory(&box, sizeof box);
#ifdef DRIVE
    swb_drive drive;
    swb_drive_begin(&drive, any_bits);
#endif
    begin();
    for (;;) {
        if (any_byte == 0u) {
            begin();
        }
        if (any_byte == 0u) {
            swb_vehicle_arm(&VEHICLE);
        }
        const swb_seen seen = any_seen();
        hold(&seen);
        float command;
        if (VEHICLE.arming.deck != 0u) {
            command = tick(&seen);
        } else {
            command = tick(&seen);
            /*@ assert finite: \is_finite(command); */
            /*@ assert within: SWB_COMMAND_LEAST <= command <= SWB_COMMAND_MOST; */
            /*@ assert called: VEHICLE.controller.waiting < SWB_MOST_WAIT; */
        }
        tick_box(&seen, command);
#ifdef DRIVE
        swb_drive_command(&drive, command, any_byte != 0u, any_bits);
        (void)swb_drive_outputs(&drive, any_bits);
#endif
    }
}
