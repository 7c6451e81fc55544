/* On an emulated Cortex-M: where the processor begins, and its floating point switched on. */
#include <stdint.h>

void _start(void);

static void reset(void)
{
#ifdef __ARM_FP
    *(volatile uint32_t *)0xe000ed88u |= 0xf00000u; /* CPACR */
    __asm volatile("dsb\n isb");
#endif
    _start();
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    (const void *)0x00400000u, (const void *)reset};
