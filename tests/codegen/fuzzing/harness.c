/* What libFuzzer, or random.c, calls with bytes: they become numbers for a law's functions, for its
 * controller, for the vehicle under its supervisor, for a board that is switched on, reset and armed,
 * with its black box, or for a pool day. The sanitizers look for undefined behaviour, `must` for broken
 * promises. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "swb_box.h"
#include "swb_vehicle.h"
#ifdef PUMPS
#include "swb_drive.h"
#endif
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

/* Return a count: the largest, or any. */
static uint16_t word(void)
{
    const uint8_t high = byte();
    return high > 250u ? 65535u : (uint16_t)(high << 8 | byte());
}

static bool same(float x, float y)
{
    return memcmp(&x, &y, sizeof x) == 0;
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
        must(c.waiting < SWB_MOST_WAIT, "the law is called again, in time");
        const uint32_t wanted = (uint32_t)byte() << 4;
        if (wanted == 0xff0u) {
            c.waiting |= 0x80000000u; /* a bit flips: the law is called at the next tick */
        }
        const uint32_t waiting = c.waiting;
        const uint32_t slept = swb_controller_sleep(&c, wanted);
        must(slept <= wanted && slept <= waiting && c.waiting == waiting - slept,
            "it sleeps no longer than it may");
        must(slept < SWB_MOST_WAIT, "nor for ever");
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

/* The arming alone, whatever its parameters and its state are. */
static void call_arming(void)
{
    const swb_arming_parameters p = {.S_p = number(0.0f, 1.0f), .positioner = number(-1.0f, 1.0f),
        .volume_least = number(-4e-4f, 0.0f), .volume_most = number(0.0f, 4e-4f),
        .depth_least = number(-2.0f, 0.0f), .depth_most = number(2.0f, 9.0f),
        .submerged = number(0.0f, 2.0f), .under = word(), .blind = word()};
    const swb_arming_seen nothing = {.depth = NAN, .volume = NAN};
    swb_arming_state s;
    float next_s;
    swb_arming_initial(&p, &nothing, (float)(byte() % 2u), &s);
    const uint16_t disarmed = s.deck;
    s.deck = byte() > 200u ? word() : disarmed;
    s.under = word();
    s.above = word();
    s.blind = word();
    for (int n = 0; n < 64 && at < end; ++n) {
        const swb_arming_seen m = {.depth = number(-1.0f, 6.0f), .volume = number(-4e-4f, 4e-4f)};
        const swb_arming_state before = s;
        const float wanted = number(-12.0f, 12.0f);
        const float command = swb_arming_step(&p, &s, &m, wanted, &next_s);
        if (s.deck != disarmed) {
            must(same(command, wanted), "an armed one's command is given on");
            must(before.deck == disarmed || s.deck == before.deck, "who is armed stays so");
        } else {
            must(command == 0.0f || same(command, s.held), "who is not is held");
            must(!known(before.held) || same(s.held, before.held), "where it was first seen");
        }
        must(!before.surfaced || s.surfaced, "a surface is not forgotten");
    }
}

/* A board: a vehicle and its black box, in memory that a reset leaves as it is. */
typedef struct {
    swb_vehicle v;
    swb_box b;
    float hold;   /* the command that held a positioner; NAN: none yet */
    bool anew;    /* begun anew while armed; no tick since */
} board;

static uint8_t store[SWB_BOX_BYTES]; /* what it keeps without power */

static uint8_t kept(uint16_t place)
{
    must(place < SWB_BOX_BYTES, "nothing else is read");
    return store[place];
}

static void start(board *o, bool after_reset, bool keeps)
{
    const bool armed = after_reset && swb_vehicle_armed(&o->v);
    const bool was_armed = swb_box_begin(&o->b, after_reset, keeps ? kept : NULL, byte());
    swb_vehicle_switch_on(&o->v, after_reset, was_armed);
    must(swb_vehicle_armed(&o->v) == armed, "a power-off disarms, and nothing else does");
    must(!swb_vehicle_surfaced(&o->v), "a surface is not known at the start");
    must(o->b.count <= SWB_BOX_ROWS && o->b.next < SWB_BOX_ROWS, "a box has its rows");
    o->hold = NAN;
    o->anew = armed;
}

/* A reset that leaves the memory: the box stays as it was. */
static void reset(board *o)
{
    const swb_box before = o->b;
    start(o, true, byte() > 100u);
    must(o->b.reason == before.reason && o->b.reasons == before.reasons
            && o->b.armed == before.armed && o->b.count == before.count
            && memcmp(o->b.row, before.row, sizeof before.row) == 0,
        "a reset changes nothing in the box");
    must(before.armed == 0u || o->b.resets > before.resets || before.resets == 255u,
        "a start while armed is counted");
}

static void lose_memory(board *o)
{
    memset(&o->v, byte(), sizeof o->v);
    memset(&o->b, byte(), sizeof o->b);
}

static void save(board *o, uint32_t bytes)
{
    uint16_t place;
    uint8_t value;
    for (uint32_t n = 0; n < bytes && swb_box_save(&o->b, &place, &value); ++n) {
        must(place < SWB_BOX_BYTES, "nothing else is written");
        store[place] = value;
    }
}

/* The power goes, and what was saved is there again. */
static void lose_power(board *o)
{
    save(o, 3u * SWB_BOX_BYTES);
    const swb_box before = o->b;
    lose_memory(o);
    start(o, false, true);
    must(o->b.reason == before.reason && o->b.reasons == before.reasons
            && o->b.armed == before.armed && o->b.earlier == before.earlier
            && o->b.earlier_reasons == before.earlier_reasons,
        "the box outlives a loss of power");
}

/* Give the box numbers that none has, and a sum that fits them: it is begun anew. */
static void forge(board *o)
{
    swb_box *b = &o->b;
    uint32_t low = 1u, high = 0u;
    if (byte() % 2u == 0u) {
        b->next = (uint8_t)(SWB_BOX_ROWS + byte() % (256u - SWB_BOX_ROWS));
    } else {
        b->count = (uint8_t)(SWB_BOX_ROWS + 1u + byte() % (255u - SWB_BOX_ROWS));
    }
    for (size_t n = 0; n < offsetof(swb_box, sum); ++n) {
        low = (low + ((const uint8_t *)b)[n]) % 251u;
        high = (high + low) % 251u;
    }
    b->sum = (uint16_t)(high << 8 | low);
    start(o, true, false);
    must(b->count == 0u && b->next == 0u && b->reason == 0u, "a sum alone makes no box");
}

static void check_hold(board *o, float command)
{
#ifdef POSITIONER
    must(!known(o->hold) || command == o->hold, "a positioner that is disarmed is held");
    must(isnan(command) || (command >= SWB_COMMAND_LEAST && command <= SWB_COMMAND_MOST),
        "it is held within its limits");
    o->hold = command;
#else
    must(command == 0.0f, "a motor that is disarmed is held");
    o->hold = command;
#endif
}

static void check_box(const board *o, const swb_box *before)
{
    const swb_box *b = &o->b;
    const bool armed = swb_vehicle_armed(&o->v);
    const bool dives = armed && before->armed == 0u;
    must(dives || before->reason == 0u || b->reason == before->reason,
        "the first reason in the box stays");
    must(dives || (b->reasons & before->reasons) == before->reasons,
        "the reasons in the box only grow");
    must(!dives || b->earlier == (before->earlier != 0u ? before->earlier : before->reason),
        "the first reason that was not cleared stays");
    must(dives || b->earlier == before->earlier, "it changes with a new dive only");
    must(!armed || (b->armed == 1u && (b->reasons & o->v.reasons) == o->v.reasons),
        "what the vehicle has is in the box");
    must(armed || b->armed == before->armed || swb_vehicle_surfaced(&o->v),
        "the box keeps what was armed until it is at the surface");
    must((b->reason == 0u) == (b->reasons == 0u), "a reason is among the box's reasons");
    must(b->count <= SWB_BOX_ROWS && b->next < SWB_BOX_ROWS, "a box has its rows");
    must(b->after <= SWB_BOX_ROWS / 2u, "half of the rows are from before the reason");
    if (b->next != before->next && b->count > 0u) {
        const swb_box_row newest = swb_box_at(b, (uint8_t)(b->count - 1u));
        must(newest.reason == o->v.reason, "the newest row is the last one");
    }
}

/* A tick of vehicle and box; return the command. */
static float board_tick(board *o, const swb_seen *s, float reference, uint32_t bytes)
{
    swb_vehicle *v = &o->v;
    const bool armed = swb_vehicle_armed(v);
    const bool surfaced = swb_vehicle_surfaced(v);
    const uint8_t reason = v->reason;
    const uint32_t reasons = v->reasons;
    const bool release = v->release;
    const swb_box before = o->b;
    const uint32_t restarted = 1u << (SWB_REASON_RESTARTED - 1u);
    const float command = swb_vehicle_tick(v, s, reference);
    if (!swb_vehicle_armed(v)) {
        must(!armed, "no tick disarms");
        must(v->reason == 0u && v->reasons == 0u && !v->release, "disarmed nothing is a reason");
        check_hold(o, command);
    } else {
        check_command(command);
        check_supervisor(v, reason, reasons, release);
        must(armed || ((v->reasons & restarted) != 0u) == !surfaced,
            "power that came under water brings it up, and a first dive does not");
        must(!o->anew || (v->reasons & restarted) != 0u, "so does a reset while armed");
        o->anew = false;
    }
    swb_box_tick(&o->b, v, s, command);
    check_box(o, &before);
    save(o, bytes);
    return command;
}

/* A board that is switched on, reset, armed; in between what is seen may stay the same for a while. */
static void call_board(void)
{
    board o;
    lose_memory(&o);
    memset(store, byte(), sizeof store);
    start(&o, byte() > 200u, byte() > 60u);
    while (at < end) {
        const uint8_t what = byte();
        const uint32_t bytes = byte() % 8u * 7u;
        switch (what % 16u) {
        case 0:
            lose_memory(&o);
            start(&o, what > 128u, byte() > 60u);
            break;
        case 1:
            for (int again = byte(); again >= 0; --again) {
                reset(&o);
            }
            break;
        case 2:
            lose_power(&o);
            break;
        case 3:
            swb_box_clear(&o.b);
            break;
        case 4:
        case 5:
            swb_vehicle_arm(&o.v);
            must(swb_vehicle_armed(&o.v), "who is armed is");
            break;
        case 6:
            forge(&o);
            break;
        default:
            break;
        }
        swb_seen s = seen();
        const float reference = number(0.0f, 6.0f);
        const float drift = number(-0.02f, 0.02f);
        for (int again = byte(); again >= 0; --again) {
            (void)board_tick(&o, &s, reference, bytes);
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
    must(swb_vehicle_armed(&d->vehicle) || (*command == 0.0f && d->ticks == 0u),
        "a day that is disarmed is held");
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
    const uint8_t how = byte();
    if (how > 200u && how <= 250u) {
        swb_pool_day_switch_on(&d, false, how > 225u);
    } else {
        swb_pool_day_begin(&d, how > 250u);
    }
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

#ifdef PUMPS
/* Pump and valves on their pins, at any times and commands. */
static void call_drive(void)
{
    swb_drive d;
    uint32_t now = (uint32_t)byte() << 24;
    uint32_t silent = 0u; /* us since the last command, or since it was switched on */
    uint32_t off = 0u;    /* us since anything was on */
    uint8_t last = 0u;
    uint8_t before = 0u;
    swb_drive_begin(&d, now);
    while (at < end) {
        const uint8_t kind = byte();
        const uint32_t step = kind < 3u ? 0x50000000u : (uint32_t)kind << (kind % 13u);
        now += step;
        silent += step; /* what is on is off after the longest step */
        off = off > 0xffffffffu - step ? 0xffffffffu : off + step;
        if (byte() > 120u) {
            swb_drive_command(&d, number(-1.5f * SWB_TICK_S, 1.5f * SWB_TICK_S), byte() > 127u, now);
            silent = 0u;
        }
        const uint8_t on = swb_drive_outputs(&d, now);
        must(on == 0u || on == SWB_PUMP || on == SWB_VALVE || on == SWB_BYPASS,
            "one of them is on at a time");
        must(on == 0u || on == last || last == 0u || off >= SWB_HOLD_OFF_US,
            "another one is on after the hold-off only");
        silent = on == before ? silent : 0u;
        before = on;
        must(on == 0u || silent <= SWB_TICK_US + SWB_GRACE_US + SWB_HOLD_OFF_US,
            "what is on goes off where no command comes");
        if (on != 0u) {
            last = on;
            off = 0u;
        }
    }
}
#endif

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count)
{
    at = bytes;
    end = bytes + count;
    switch (byte() % 8u) {
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
#ifdef PUMPS
    case 5:
        call_drive();
        break;
#endif
    case 6:
        call_board();
        break;
    case 7:
        call_arming();
        break;
    default:
        call_vehicle();
        break;
    }
    return 0;
}
