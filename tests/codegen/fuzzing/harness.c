/* What libFuzzer, or random.c, calls with bytes: they become numbers for a law's functions, for its
 * controller, for the vehicle under its supervisor, or for a pool day. The sanitizers look for
 * undefined behaviour, `must` for broken promises. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "swb_vehicle.h"
#ifdef POOL
#include "swb_pool_day.h"
#endif

static const uint8_t *at, *end;

static void must(bool holds, const char *promise)
{
    if (!holds) {
        fprintf(stderr, "broken: %s\n", promise);
        abort();
    }
}

static uint8_t byte(void)
{
    return at < end ? *at++ : 0u;
}

static float from_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static bool known(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (bits & 0x7f800000u) != 0x7f800000u;
}

/* Return a number: any bits, an odd one, or an ordinary one from low to high. */
static float number(float low, float high)
{
    static const uint32_t odd[] = {0x7fc00000u, 0x7f800000u, 0xff800000u, 0u, 0x80000000u, 1u,
        0x007fffffu, 0x7f7fffffu, 0xff7fffffu, 0x3f800000u, 0xbf800000u, 0x4b800000u};
    const uint8_t kind = byte();
    if (kind < 16u) {
        uint32_t bits = 0u;
        for (int n = 0; n < 4; ++n) {
            bits = bits << 8 | byte();
        }
        return from_bits(bits);
    }
    if (kind < 40u) {
        return from_bits(odd[kind % (sizeof odd / sizeof odd[0])]);
    }
    const uint32_t part = (uint32_t)byte() << 8 | byte();
    return low + (high - low) * ((float)part / 65535.0f);
}

static void numbers(void *place, size_t size, const void *near)
{
    for (size_t n = 0; n < size; n += sizeof(float)) {
        float x;
        memcpy(&x, (const char *)near + n, sizeof x);
        x = number(0.5f * x, 1.5f * x);
        memcpy((char *)place + n, &x, sizeof x);
    }
}

/* The law alone, whatever its parameters and its state are. */
static void call_law(void)
{
    PARAMETERS p;
    STATE state;
    float next_s = 0.0f;
    numbers(&p, sizeof p, &swb_parameters);
    const swb_measurement first = {.time = 0.0f, .depth = 1.5f, .volume = 0.0f};
    INITIAL(&swb_parameters, &first, 2.0f, &state);
    const STATE ordinary = state;
    numbers(&state, sizeof state, &ordinary);
    for (int n = 0; n < 64 && at < end; ++n) {
        const swb_measurement m = {.time = number(0.0f, 3600.0f), .depth = number(-1.0f, 6.0f),
            .volume = number(-4e-4f, 4e-4f)};
        const float reference = number(0.0f, 6.0f);
        if (byte() == 0u) {
            INITIAL(&p, &m, reference, &state);
        }
        (void)STEP(&p, &state, &m, reference, &next_s);
        const uint32_t ticks = swb_wait_in_ticks(next_s);
        must(ticks >= 1u && ticks <= 1000000u, "the next call is a tick away, or more");
    }
}

static void check_command(float command)
{
    must(known(command), "the command is finite");
    must(command >= SWB_COMMAND_LEAST && command <= SWB_COMMAND_MOST,
        "the command is within its limits");
}

/* The controller, under any measurements, awake or asleep. */
static void call_controller(void)
{
    swb_controller c;
    swb_controller_begin(&c, SWB_COMMAND_MOST);
    while (at < end) {
        const float depth = number(-1.0f, 6.0f);
        const float volume = number(-4e-4f, 4e-4f);
        const float reference = number(0.0f, 6.0f);
        const uint32_t before = c.ticks;
        check_command(swb_controller_tick(&c, depth, volume, reference));
        must(c.ticks == before + 1u, "a tick is counted");
        must(c.waiting < 1000000u, "the law is called again");
        const uint32_t wanted = (uint32_t)byte() << 4;
        const uint32_t waiting = c.waiting;
        const uint32_t slept = swb_controller_sleep(&c, wanted);
        must(slept <= wanted && slept <= waiting && c.waiting == waiting - slept,
            "it sleeps no longer than it may");
    }
}

static swb_seen seen(void)
{
    swb_seen s;
    s.depth = number(-1.0f, 6.0f);
    s.depth_age = number(0.0f, 2.0f);
    s.volume = number(-4e-4f, 4e-4f);
    s.battery = number(8.0f, 13.0f);
    const uint8_t rest = byte();
    s.leak = rest > 250u;
    s.lost_ticks = rest > 240u ? (uint32_t)byte() * 0x01010101u : rest > 220u ? 1u : 0u;
    return s;
}

static void check_supervisor(const swb_vehicle *v, uint8_t reason, uint32_t reasons, bool release)
{
    must(reason == 0u || v->reason == reason, "the first reason stays");
    must((v->reasons & reasons) == reasons, "reasons only grow");
    must((v->reason == 0u) == (v->reasons == 0u), "a reason is among the reasons");
    must(v->reason < SWB_REASONS, "a reason is one of the list");
    must(v->reason == 0u || (v->reasons >> (v->reason - 1u) & 1u) == 1u, "the first has its bit");
    must(!release || v->release, "a weight that is gone is gone");
    must(!v->release || v->reason != 0u, "no weight goes without a reason");
    must(strcmp(swb_reason(v->reason), "unknown") != 0, "a reason has words");
}

/* The vehicle under its supervisor; what is seen may stay the same for a while. */
static void call_vehicle(void)
{
    swb_vehicle v;
    swb_vehicle_begin(&v, byte() > 250u);
    while (at < end) {
        swb_seen s = seen();
        const float reference = number(0.0f, 6.0f);
        const float drift = number(-0.02f, 0.02f);
        const int again = byte();
        for (int n = 0; n <= again; ++n) {
            const uint8_t reason = v.reason;
            const uint32_t reasons = v.reasons;
            const bool release = v.release;
            check_command(swb_vehicle_tick(&v, &s, reference));
            check_supervisor(&v, reason, reasons, release);
            s.depth += drift;
        }
    }
}

#ifdef POOL
/* The procedure alone, whatever its numbers and its state are. */
static void call_procedure(void)
{
    swb_pool_parameters p;
    swb_pool_state state;
    float next_s;
    numbers(&p, sizeof p, &swb_pool_numbers);
    const swb_measurement first = {.time = 0.0f, .depth = 3.75f, .volume = 1.5e-5f};
    swb_pool_initial(&swb_pool_numbers, &first, 1.0f, &state);
    const swb_pool_state ordinary = state;
    numbers(&state, sizeof state, &ordinary);
    state.phase = (float)(byte() % 11u) - 1.0f;
    for (int n = 0; n < 64 && at < end; ++n) {
        const swb_measurement m = {.time = 0.0f, .depth = number(-1.0f, 6.0f),
            .volume = number(-4e-4f, 4e-4f)};
        const float before = state.phase;
        const float command = swb_pool_step(&p, &state, &m, number(-1.0f, 2.0f), &next_s);
        if (known(p.limit) && p.limit >= 0.0f) {
            must(command >= -p.limit && command <= p.limit, "a voltage is within the limit");
        }
        must(state.phase >= -1.0f && state.phase <= 9.0f, "a phase is one of the list");
        must(before < 8.0f || state.phase == before, "what is over stays over");
    }
}

static void check_pool(swb_pool_day *d, const swb_seen *s, bool may_begin, float *command)
{
    const uint8_t reason = d->vehicle.reason;
    const uint32_t reasons = d->vehicle.reasons;
    const bool release = d->vehicle.release;
    const int8_t before = swb_pool_phase(d);
    *command = swb_pool_day_tick(d, s, may_begin);
    check_command(*command);
    check_supervisor(&d->vehicle, reason, reasons, release);
    const int8_t now = swb_pool_phase(d);
    must(before < SWB_POOL_DONE || now == before, "a day that is over stays over");
    must(reason == 0u || now >= SWB_POOL_DONE, "with a reason the day is over");
    must(now == before || now == before + 1 || now == SWB_POOL_GAVE_UP
            || (before == SWB_POOL_D_GLIDE && now == SWB_POOL_A_HOLD),
        "phases come in order");
    must(now >= SWB_POOL_WAITS && strcmp(swb_pool_words(now), "unknown") != 0,
        "a phase has words");
    must(swb_pool_gave_up_in(d) < SWB_POOL_DONE, "what is over does not give up");
    must(now == SWB_POOL_GAVE_UP || swb_pool_gave_up_in(d) == SWB_POOL_WAITS,
        "who has not given up did so in no phase");
    must(d->procedure.completed <= (float)SWB_POOL_ROUNDS, "there are no more rounds");
}

/* A pool day; what is seen may stay the same, or go up and down, for a while. */
static void call_pool(void)
{
    swb_pool_day d;
    float command;
    swb_pool_day_begin(&d, byte() > 250u);
    while (at < end) {
        swb_seen s = seen();
        const bool may_begin = byte() > 40u;
        const float drift = number(-0.2f, 0.2f);
        const int again = byte();
        for (int n = 0; n <= again; ++n) {
            check_pool(&d, &s, may_begin, &command);
            s.depth += drift;
        }
    }
}

/* A pool day over something that moves as the paper's vehicle does, eqs (11)-(13) without the motor's
 * lag; for spells the sensors say something else. So all phases are reached. */
static void swim(void)
{
    const swb_pool_parameters *p = &swb_pool_numbers;
    const float a_b = 7936.0f / 36.1f, d_l = 1.0f / 36.1f, psi = 4.04e-6f, end_stop = 3.5e-4f;
    swb_pool_day d;
    float z = 0.0f, w = 0.0f, V = 3e-4f, command = 0.0f;
    int left = 9000;
    swb_pool_day_begin(&d, false);
    while (left > 0) {
        const bool spoilt = byte() > 200u && at < end;
        const int spell = spoilt ? byte() >> 3 : byte() << 6;
        const swb_seen said = seen();
        for (int n = 0; n <= spell && left > 0; ++n, --left) {
            swb_seen s = {.depth = z, .depth_age = NAN, .volume = V, .battery = NAN};
            s.depth += 1e-3f * (float)(left % 3 - 1); /* a sensor that lives */
            check_pool(&d, spoilt ? &said : &s, true, &command);
            V += p->rate_per_volt * (command - p->load_voltage * z) * p->loop.S_p;
            V = V > end_stop ? end_stop : V < -end_stop ? -end_stop : V;
            w += p->loop.S_p * (a_b * (psi * z - V) - d_l * w);
            z += p->loop.S_p * w;
            if (z <= 0.0f || z >= 4.5f) {
                z = z <= 0.0f ? 0.0f : 4.5f;
                w = 0.0f;
            }
        }
    }
}
#endif

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    at = bytes;
    end = bytes + count;
    switch (byte() % 6u) {
    case 0:
        call_law();
        break;
    case 1:
        call_controller();
        break;
#ifdef POOL
    case 2:
        call_procedure();
        break;
    case 3:
        call_pool();
        break;
    case 4:
        swim();
        break;
#endif
    default:
        call_vehicle();
        break;
    }
    return 0;
}
