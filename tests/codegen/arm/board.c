/* A board for extras/board.c whose clock goes on by 2 ms at each call: prints its log, and beside it how
 * long pump, valves and two of them at once were on. Its depth is 0.5 m, and none after ten minutes. After
 * eleven it is switched off and on, then reset by a watchdog, which it calls 8, and then its box is cleared. */
#include "swb_box.h"
#include "swb_drive.h"
#include "swb_vehicle.h"

#include <math.h>
#include <stdio.h>

void board_begin(void);
void board_turn(void);
void board_log_box(void);
void board_clear_box(void);

static uint32_t us = 0xfff00000u; /* goes over its end soon */
static uint32_t since_us;
static uint32_t on_us[3];
static uint32_t both_us;
static uint8_t on;
static uint8_t cause;
static uint8_t eeprom[SWB_BOX_BYTES];

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
    seen->depth = since_us < 600000000u ? 0.5f : NAN;
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

uint8_t board_cause(void)
{
    return cause;
}

uint8_t board_kept(uint16_t at)
{
    return eeprom[at];
}

void board_keep(uint16_t at, uint8_t byte)
{
    eeprom[at] = byte;
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
    for (uint16_t at = 0u; at < SWB_BOX_BYTES; ++at) {
        eeprom[at] = 0xffu;
    }
    board_begin();
    while (since_us < 700000000u) {
        board_turn();
    }
    printf("# on: %lu %lu %lu %lu ms\n", (unsigned long)(on_us[0] / 1000u),
        (unsigned long)(on_us[1] / 1000u), (unsigned long)(on_us[2] / 1000u),
        (unsigned long)(both_us / 1000u));
    board_begin();
    cause = 8u;
    board_begin();
    board_clear_box();
    board_log_box();
    return 0;
}
