/* HardwareInTheLoop on an emulated Cortex-M of Arm's MPS2: frames at UART 0, microseconds of timer 0. */
#include "hil.h"

#define REGISTER(at) (*(volatile uint32_t *)(at))
#define UART(offset) REGISTER(0x40004000u + (offset)) /* data, state, control, -, baud rate */
#define TIMER(offset) REGISTER(0x40000000u + (offset)) /* control, value, reload: counts down at 25 MHz */

static uint32_t us;
static uint32_t counted;

/* Call it once a minute at least: the timer goes round every 171 s. */
static uint32_t hil_micros(void)
{
    const uint32_t now = 0xffffffffu - TIMER(4u);
    const uint32_t passed = (now - counted) / 25u;
    us += passed;
    counted += 25u * passed;
    return us;
}

static uint32_t hil_stack_left(void)
{
    return HIL_UNKNOWN;
}

int main(void)
{
    static hil line;
    TIMER(8u) = 0xffffffffu;
    TIMER(4u) = 0xffffffffu;
    TIMER(0u) = 1u;
    UART(16u) = 25000000u / HIL_BAUD;
    UART(8u) = 3u;
    hil_begin(&line);
    for (;;) {
        (void)hil_micros();
        if ((UART(4u) & 2u) == 0u) {
            continue;
        }
        const uint8_t bytes = hil_take(&line, (uint8_t)UART(0u), hil_micros());
        for (uint8_t n = 0u; n < bytes; ++n) {
            while ((UART(4u) & 1u) != 0u) {
            }
            UART(0u) = line.send[n];
        }
    }
}
