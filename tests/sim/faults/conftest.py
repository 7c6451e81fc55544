"""The paper's vehicle with its C compiled, and missions made by hand."""

import math

import numpy as np
import pytest

from swimbladder.io.config import load_vehicle
from swimbladder.physics.dynamics import Plant
from swimbladder.sim.faults.draw import TRACE, Condition, FaultRow, Mission, course_of
from swimbladder.sim.faults.run import FaultCampaign, board_of
from tests.codegen.conftest import gcc
from tests.vehicles import usual

__all__ = ["gcc"]

TICK = 0.3


class Rig:
    """A vehicle, its course and its squadron; flies missions that a test writes."""

    def __init__(self, vehicle, campaign, course):
        self.vehicle, self.campaign, self.course = vehicle, campaign, course
        self.tick = course.vehicle.controller.sample_time

    def fly(
        self,
        *fault_rows,
        who="unsupervised",
        how=0,
        depth=20.0,
        target=None,
        turns=None,
        ticks=1000,
        bottom=math.inf,
        volume=None,
        supply=None,
        waves=None,
        **changes,
    ):
        """Return (result, columns by name); harms: (fault, first, second, begin, end).

        turns: (tick, depth asked for [m]), in place of `target`.
        """
        turns = turns or ((0.0, depth if target is None else target),)
        medium = self.course.medium
        p = medium.plant._replace(z_bottom=bottom)
        if self.course.floats:
            p = p._replace(positioner=0.0, supply=self.vehicle.supply.voltage)
        if supply is not None:
            p = p._replace(supply=supply)
        full = p.supply if self.vehicle.voltage_driven else p.V_max
        quiet = Condition(
            end=ticks,
            tick=self.tick,
            start_depth=depth,
            start_volume=medium.neutral_volume(depth) if volume is None else volume,
            depth_noise=0.0,
            depth_quantum=0.0,
            volume_noise=0.0,
            volume_quantum=0.0,
            battery_noise=0.0,
            full=full,
            ramp=1e9,
            drift=0.0,
            swell=0.0,
            swell_omega=1.0,
            swell_phase=0.0,
            gravity=9.80665,
            leak_input=math.inf,
            brown_out=0.0,
            boot=7,
            band=1.0,
            rated=math.inf,
            stay=1e9,
            quiet_at=0.0,
            full_after=200.0,
            seed=1.0,
        )._replace(**changes)
        mission = Mission(
            number=0,
            faults=(),
            plant=np.array(p),
            condition=quiet,
            fault_rows=np.array([FaultRow(*map(float, h)) for h in fault_rows]).reshape(
                -1, len(FaultRow._fields)
            ),
            turns=np.array([tick for tick, _ in turns]),
            depths=np.array([asked for _, asked in turns]),
            layers=medium.layers,
            **({} if waves is None else {"waves": np.array(waves)}),
        )
        assert len(p) == len(Plant._fields)
        result, rows = self.campaign.traced(mission, who, how)
        return result, {name: rows[:, index] for name, index in TRACE.items()}


@pytest.fixture(scope="session")
def rig_of(request):
    """Rigs of presets and of vehicles by their names, each compiled once."""
    request.getfixturevalue("gcc")
    made, boards = {}, []

    def get(asked, depths=None, column=None):
        name = asked if isinstance(asked, str) else asked.name
        if name not in made:
            vehicle = load_vehicle(asked) if isinstance(asked, str) else asked
            course = course_of(usual(vehicle, depths, column), depths, column)
            boards.append(board_of(course))
            made[name] = Rig(vehicle, FaultCampaign(course, boards[-1]), course)
        return made[name]

    yield get
    for board in boards:
        board.__exit__(None, None, None)


@pytest.fixture(scope="session")
def rig(rig_of):
    return rig_of("feup-em")
