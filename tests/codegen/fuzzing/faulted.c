/* faulted MISSIONS SEED: so many missions with random faults, two at a time, over something that moves
 * as the vehicle's own numbers say, eqs (13) and (16) with linear drag and a motor without a lag; a
 * float's drag is quadratic, its pump and valve have a rate each, and it dives ten times as deep. What
 * harness.c asks of the command, of the reasons and of the black box is asked at every tick. */
#define LLVMFuzzerTestOneInput harness
#include "harness.c"
#include "swb_vehicle.c"

#undef LLVMFuzzerTestOneInput

enum {
    NOTHING, DEPTH_NAN, DEPTH_FAR, DEPTH_LATE, DEPTH_FROZEN, DEPTH_LIVES_ON, DEPTH_BURSTS, DEPTH_OFF,
    VOLUME_NAN, VOLUME_FAR, VOLUME_FROZEN, VOLUME_OFF, STUCK, BLOCKED, SWAPPED, SWAPPED_AT_TIMES, WEAK,
    BATTERY, LEAK, FLOODED, LOST_SOME, LOST_MANY, RESETS, BATTERY_RESETS, ASKED_NAN, ASKED_DEEP, FAULTS
};

static uint32_t state_of_chance = 1u;

static uint32_t chance(uint32_t below) /* Marsaglia, Xorshift RNGs, J. Stat. Software 8, 2003, 14 */
{
    state_of_chance ^= state_of_chance << 13;
    state_of_chance ^= state_of_chance >> 17;
    state_of_chance ^= state_of_chance << 5;
    return (state_of_chance >> 4) % below;
}

static float between(float low, float high)
{
    return low + (high - low) * (float)chance(10001u) / 10000.0f;
}

typedef struct {
    float z, w, V, heavier; /* m, m/s, m3, m3 that it took on */
    float seen_depth, seen_volume;
    bool set;
} world;

static bool acts(uint32_t kind, const uint32_t *kinds, const int *from, int tick)
{
    return (kinds[0] == kind && tick >= from[0]) || (kinds[1] == kind && tick >= from[1]);
}

#ifdef PUMPS
#define MOST 3e-4f /* m3, to either side */
#define SCALE 10.0f
#else
#define MOST swb_limits.deep.largest
#define SCALE 1.0f
#endif

/* Return the volume that the drag of a speed takes [m3]. */
static float drag(float speed)
{
#ifdef PUMPS
    return 1.1e-3f * speed * (speed < 0.0f ? -speed : speed);
#else
    return swb_limits.motion.drag_linear * speed;
#endif
}

static void move(world *p, float command, bool stuck, bool blocked, float share)
{
    const swb_supervisor_parameters *l = &swb_limits;
    const float most = MOST;
#ifdef PUMPS /* of the tick's seconds it pumps at the one, and lets in at the other */
    float rate = l->per_tick * command * (command > 0.0f ? 1e-6f : 3e-6f);
#else
    float rate = l->rate.rate * (command - l->rate.load_drive * p->z);
#endif
    if (l->rate.positioner > 0.0f) {
        rate = (command - p->V) * l->per_tick;
        rate = rate > l->rate.rate ? l->rate.rate : rate < -l->rate.rate ? -l->rate.rate : rate;
    }
    if (stuck || (blocked && rate > 0.0f)) {
        rate = 0.0f;
    }
    p->V += share * rate * l->S_p;
    p->V = p->V > most ? most : p->V < -most ? -most : p->V;
    for (int n = 0; n < 8; ++n) {
        const float dt = 0.125f * l->S_p;
        const float beyond = l->neutral.psi * p->z + p->heavier - p->V;
        p->w += dt * l->deep.force * (beyond - drag(p->w));
        p->w = p->w > 2.0f ? 2.0f : p->w < -2.0f ? -2.0f : p->w;
        p->z += dt * p->w;
        if (p->z < 0.0f || p->z > l->deep.deepest) {
            p->z = p->z < 0.0f ? 0.0f : l->deep.deepest;
            p->w = 0.0f;
        }
    }
}

static swb_seen sensed(world *p, const uint32_t *kinds, const int *from, int tick)
{
#define ACTS(kind) acts(kind, kinds, from, tick)
    const float noise = 0.002f * (between(-1.0f, 1.0f) + between(-1.0f, 1.0f));
    const float size = MOST;
    swb_seen s = {.depth = 0.005f * (float)(int)((p->z + noise) * 200.0f), .depth_age = 0.1f,
        .volume = p->V, .battery = chance(2u) ? 14.0f : NAN, .leak = ACTS(LEAK)};
    if (!ACTS(DEPTH_FROZEN) && !ACTS(DEPTH_LIVES_ON)) {
        p->seen_depth = s.depth;
    }
    if (!ACTS(VOLUME_FROZEN)) {
        p->seen_volume = s.volume;
    }
    s.depth = ACTS(DEPTH_LIVES_ON) ? p->seen_depth + noise : p->seen_depth;
    s.depth = ACTS(DEPTH_OFF) ? s.depth + 0.02f * (float)(tick % 4000) : s.depth;
    s.depth = ACTS(DEPTH_FAR) || (ACTS(DEPTH_BURSTS) && chance(3u) == 0u) ? 1e4f : s.depth;
    s.depth = ACTS(DEPTH_NAN) ? NAN : s.depth;
    s.depth_age = ACTS(DEPTH_LATE) ? 9.0f : s.depth_age;
    s.volume = ACTS(VOLUME_OFF) ? p->seen_volume + 0.4f * size : p->seen_volume;
    s.volume = ACTS(VOLUME_FAR) ? 9.0f : s.volume;
    s.volume = ACTS(VOLUME_NAN) ? NAN : s.volume;
    s.battery = ACTS(BATTERY) ? 0.5f : s.battery;
    s.lost_ticks = ACTS(LOST_SOME) ? chance(2u) : ACTS(LOST_MANY) && chance(50u) == 0u ? 4500u : 0u;
    return s;
}

static void fly(board *o, bool healthy)
{
    const uint32_t kinds[2] = {healthy ? NOTHING : chance(FAULTS), healthy ? NOTHING : chance(FAULTS)};
    const int from[2] = {(int)chance(1500u), (int)chance(1500u)};
    const int until = chance(3u) == 0u ? 1000 + (int)chance(1500u) : 100000;
    const float rate = between(0.2f, 1.0f);
    const int last = healthy ? 14000 : 4000;
    world p = {.z = between(0.0f, 3.0f), .heavier = between(-0.05f, 0.05f) * MOST};
    float asked = SCALE * between(0.0f, 6.0f);
    float command = 0.0f;
    p.V = swb_limits.neutral.psi * p.z + p.heavier;
    start(o, false, false);
    if (p.z < 1.5f || chance(3u) > 0u) { /* else the water arms it, and it comes up */
        swb_vehicle_arm(&o->v);
    }
    for (int tick = 0; tick < last; ++tick) {
        const uint32_t none[2] = {NOTHING, NOTHING};
        const uint32_t *now = tick < until ? kinds : none;
        const bool flickers = (tick / 40) % 3 == 0;
        const bool swapped = acts(SWAPPED, now, from, tick)
            || (acts(SWAPPED_AT_TIMES, now, from, tick) && flickers);
        swb_seen s = sensed(&p, now, from, tick);
        if (chance(300u) == 0u) {
            asked = acts(ASKED_DEEP, now, from, tick) ? SCALE * 500.0f : SCALE * between(-0.5f, 12.0f);
            asked = acts(ASKED_NAN, now, from, tick) ? NAN : asked;
        }
        if ((acts(RESETS, now, from, tick) && chance(200u) == 0u)
            || (acts(BATTERY_RESETS, now, from, tick) && command > 0.0f && chance(3u) > 0u)) {
            start(o, true, false);
        }
        command = board_tick(o, &s, asked, 1u);
        if (acts(FLOODED, now, from, tick)) {
            p.heavier += 0.001f * MOST;
        }
        move(&p, swapped ? -command : command, acts(STUCK, now, from, tick),
            acts(BLOCKED, now, from, tick), acts(WEAK, now, from, tick) ? 0.2f * rate : 1.0f);
    }
}

int main(int count, char **words)
{
    const long missions = count == 3 ? strtol(words[1], NULL, 10) : 0;
    static board flown;
    for (long n = 0; n < missions; ++n) {
        state_of_chance = ((uint32_t)strtoul(words[2], NULL, 10) + (uint32_t)n) * 2654435761u | 1u;
        (void)chance(2u);
        fly(&flown, n % 20 == 0);
    }
    for (int reason = 0; reason < 256; ++reason) {
        must((strcmp(swb_reason((uint8_t)reason), "unknown") == 0) == (reason >= (int)SWB_REASONS),
            "the reasons have words, and nothing else has");
    }
    printf("%ld missions\n", missions);
    return missions == 0;
}
