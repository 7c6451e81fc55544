"""The C between a mission and the generated code: the same two calls for either controller."""

from __future__ import annotations

UNSUPERVISED, SUPERVISED, IDEAL = "unsupervised", "supervised", "ideal"


def c_interface(first: str) -> str:
    """Return the C; first: the controller's command until there is one, as C.

    seen: depth, its age, volume, battery, leak, lost ticks, depth asked for. said: the reason of
    the supervisor, whether a weight is to be released, whether the law was called. That of
    ideal detection is supervised until there is a reason, which it ignores: its law goes on.
    """
    return f"""\
#include "swb_vehicle.h"

int unsupervised_size(void)
{{
    return (int)sizeof(swb_controller);
}}

void unsupervised_begin(void *memory, int after_reset)
{{
    (void)after_reset;
    swb_controller_begin(memory, {first});
}}

float unsupervised_tick(void *memory, const float *seen, float *said)
{{
    const swb_controller *c = memory;
    said[0] = said[1] = 0.0f;
    said[2] = c->waiting == 0u ? 1.0f : 0.0f;
    return swb_controller_tick(memory, seen[0], seen[2], seen[6]);
}}

int supervised_size(void)
{{
    return (int)sizeof(swb_vehicle);
}}

void supervised_begin(void *memory, int after_reset)
{{
    swb_vehicle_begin(memory, after_reset != 0);
}}

float supervised_tick(void *memory, const float *seen, float *said)
{{
    swb_vehicle *v = memory;
    const bool due = v->controller.waiting == 0u;
    const uint32_t ticks = v->controller.ticks;
    const swb_seen s = {{.depth = seen[0], .depth_age = seen[1], .volume = seen[2],
        .battery = seen[3], .leak = seen[4] > 0.5f, .lost_ticks = (uint32_t)seen[5]}};
    const float command = swb_vehicle_tick(v, &s, seen[6]);
    said[0] = (float)v->reason;
    said[1] = v->release ? 1.0f : 0.0f;
    said[2] = due && v->controller.ticks != ticks ? 1.0f : 0.0f;
    return command;
}}

int ideal_size(void)
{{
    return (int)sizeof(swb_vehicle);
}}

void ideal_begin(void *memory, int after_reset)
{{
    swb_vehicle_begin(memory, after_reset != 0);
}}

float ideal_tick(void *memory, const float *seen, float *said)
{{
    swb_vehicle *v = memory;
    const swb_seen s = {{.depth = seen[0], .depth_age = seen[1], .volume = seen[2],
        .battery = seen[3], .leak = seen[4] > 0.5f, .lost_ticks = (uint32_t)seen[5]}};
    said[0] = said[1] = 0.0f;
    said[2] = v->controller.waiting == 0u ? 1.0f : 0.0f;
    const float wanted = swb_controller_tick(&v->controller, seen[0], seen[2], seen[6]);
    const float command = swb_vehicle_watch(v, &s, wanted, v->controller.missed);
    return v->reason != 0u ? wanted : command;
}}
"""
