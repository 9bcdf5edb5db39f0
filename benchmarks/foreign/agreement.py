"""With nothing hidden: how far MuJoCo's Pioneer is from jaxid's with the same constants, without noise."""

from typing import Any

import numpy as np

import jaxid
from benchmarks.hidden.cases import NOISE, SAMPLES
from reference import excitation

from .cases import FIRM, LEVEL
from .pioneer_mjcf import World
from .simulate import SAMPLING, drive

VOLTAGES = ((1.0, 1.0), (4.0, 4.0), (8.0, 8.0), (8.0, 4.0), (6.0, -6.0))
"""Held for 10 s (right, left) [V]; the last sample is the steady motion."""
KINDS = ("prbs_reversing", "turning", "crawl")
SEED = 7100


def _both(name: str, voltages: np.ndarray, **world: float) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [N, 2] by MuJoCo and by jaxid."""
    robot = jaxid.Pioneer()
    foreign = drive(robot.parameters.numbers, voltages, World(**(FIRM | world))).speeds
    time = np.arange(len(voltages)) * SAMPLING
    log = jaxid.Log.from_arrays(name, time, voltages, foreign, jaxid.PIONEER)
    rest = {state: np.zeros(1) for state in robot.states}
    return foreign, jaxid.simulate(robot, jaxid.LogSet([log]), start=rest)[0]


def _difference(kind: str, level: float = LEVEL, **world: float) -> list[float]:
    """RMS difference of both speeds in an experiment [standard deviations of the noise]."""
    voltages = excitation.experiment("pioneer", kind, SAMPLES, SEED + KINDS.index(kind), level)
    foreign, own = _both(kind, voltages, **world)
    return (np.sqrt(np.mean((foreign - own) ** 2, axis=0)) / NOISE["pioneer"]).tolist()


def agreement() -> dict[str, Any]:
    """Steady speeds under constant voltages, and RMS differences of whole experiments in units of the noise."""
    steady = []
    for held in VOLTAGES:
        foreign, own = _both("steady", np.tile(held, (501, 1)))
        steady.append({"voltages": held, "mujoco": foreign[-1].tolist(), "jaxid": own[-1].tolist()})
    step, contact = World().timestep / 2, World().contact_time / 2
    return {
        "steady": steady,
        "rms_in_noise": {kind: _difference(kind) for kind in KINDS},
        "half_step": _difference(KINDS[0], timestep=step),
        "half_step_and_contact_time": _difference(KINDS[0], timestep=step, contact_time=contact),
        "at_8_V": _difference(KINDS[0], level=8.0),
        "at_8_V_grip_10": _difference(KINDS[0], level=8.0, grip=10.0),
    }
