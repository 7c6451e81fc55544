/* For each of the 2^32 float32: whether swb_known says what the C library does, and whether a wait is 1
 * to 1000000 ticks, without a conversion that C leaves undefined (compiled to stop at one). */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "swb_controller.c"

int main(void)
{
    uint32_t bits = 0u;
    unsigned long wrong = 0ul;
    do {
        float x;
        memcpy(&x, &bits, sizeof x);
        const uint32_t ticks = swb_wait_in_ticks(x);
        wrong += swb_known(x) != (isfinite(x) != 0) || ticks < 1u || ticks > 1000000u;
    } while (++bits != 0u);
    printf("%lu wrong\n", wrong);
    return 0;
}
