/* A board for extras/board.c whose clock goes on by 2 ms at each call: prints its log, and beside it how
 * long pump, valves and two of them at once were on. Its depth is 2.5 m, and none after ten minutes. */
#include "swb_drive.h"
#include "swb_vehicle.h"

#include <math.h>
#include <stdio.h>

void board_begin(void);
void board_turn(void);

static uint32_t us = 0xfff00000u; /* goes over its end soon */
static uint32_t since_us;
static uint32_t on_us[3];
static uint32_t both_us;
static uint8_t on;

uint32_t board_us(void)
{
    us += 2000u;
    on_us[0] += (on & SWB_PUMP) != 0u ? 2000u : 0u;
    on_us[1] += (on & SWB_VALVE) != 0u ? 2000u : 0u;
    on_us[2] += (on & SWB_BYPASS) != 0u ? 2000u : 0u;
    both_us += (on & (uint8_t)(on - 1u)) != 0u ? 2000u : 0u;
    since_us += 2000u;
    return us;
}

void board_read(swb_seen *seen)
{
    seen->depth = since_us < 600000000u ? 2.5f : NAN;
}

float board_asked(uint32_t tick)
{
    return tick < 120u ? 0.0f : 30.0f;
}

void board_switch(uint8_t now)
{
    on = now;
}

bool board_arms(void)
{
    return true;
}

bool board_restarted(void)
{
    return false;
}

void board_feed(void)
{
}

void board_log(const char *line)
{
    puts(line);
}

void board_release(void)
{
}

int main(void)
{
    board_begin();
    while (since_us < 700000000u) {
        board_turn();
    }
    printf("# on: %lu %lu %lu %lu ms\n", (unsigned long)(on_us[0] / 1000u),
        (unsigned long)(on_us[1] / 1000u), (unsigned long)(on_us[2] / 1000u),
        (unsigned long)(both_us / 1000u));
    return 0;
}
