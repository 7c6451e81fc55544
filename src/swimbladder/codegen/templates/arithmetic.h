#if defined(__FAST_MATH__)
#error "the law is to be compiled without -ffast-math or -Ofast: NaN has to stay NaN"
#endif
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16
#error "float has to be calculated in float: on x86 with -msse2 -mfpmath=sse"
#endif
/* a * b + c stays two roundings, also where the processor could do it in one. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && !defined(__AVR__)
#pragma GCC optimize("fp-contract=off")
#endif

/* On an AVR copies of a function take more flash, and more stack, than calls of it. */
#if defined(__AVR__)
#define SWB_CALLED __attribute__((noinline))
#else
#define SWB_CALLED
#endif

static uint32_t swb_bits(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static float swb_from_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static bool swb_isfinite(float x)
{
    return (swb_bits(x) & 0x7f800000u) != 0x7f800000u;
}

static float swb_abs(float x)
{
    return swb_from_bits(swb_bits(x) & 0x7fffffffu);
}

static float swb_copysign(float x, float sign)
{
    return swb_from_bits((swb_bits(x) & 0x7fffffffu) | (swb_bits(sign) & 0x80000000u));
}

static float swb_min(float a, float b)
{
    return b < a ? b : a;
}

static float swb_max(float a, float b)
{
    return b > a ? b : a;
}

static uint16_t swb_more(uint16_t n, uint16_t by)
{
    const uint16_t sum = (uint16_t)(n + by);
    return sum < n ? 65535u : sum;
}

static uint16_t swb_less(uint16_t n, uint16_t by)
{
    return n > by ? (uint16_t)(n - by) : 0u;
}

static uint16_t swb_lesser(uint16_t a, uint16_t b)
{
    return b < a ? b : a;
}

static uint16_t swb_greater(uint16_t a, uint16_t b)
{
    return b > a ? b : a;
}
