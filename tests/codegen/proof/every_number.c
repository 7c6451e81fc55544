/* For each of the 2^32 float32: whether swb_known says what the C library does, whether a wait is 1 to
 * 1000000 ticks, and whether a row of the black box has the nearest count, without a conversion that C
 * leaves undefined (compiled to stop at one). */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "swb_controller.c"
#include "swb_box.c"

/* Return whether a count is the nearest, or the largest that fits; -32768 stands for NaN. */
static bool is_count(float x, int16_t count, float most)
{
    if (isnan(x)) {
        return count == -32768;
    }
    const float within = x > most ? most : x < -most ? -most : x;
    return fabsf((float)count - within) <= 0.5f;
}

int main(void)
{
    uint32_t bits = 0u;
    unsigned long wrong = 0ul;
    do {
        float x;
        memcpy(&x, &bits, sizeof x);
        const uint32_t ticks = swb_wait_in_ticks(x);
        wrong += swb_known(x) != (isfinite(x) != 0) || ticks < 1u || ticks > 1000000u;
        wrong += !is_count(x, swb_box_number(x, 1.0f, 32767.0f), 32767.0f);
        wrong += !is_count(x, swb_box_number(x, 1.0f, 127.0f), 127.0f);
    } while (++bits != 0u);
    printf("%lu wrong\n", wrong);
    return 0;
}
