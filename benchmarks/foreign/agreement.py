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


def _both(name: str, voltages: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [N, 2] by MuJoCo and by jaxid."""
    robot = jaxid.Pioneer()
    foreign = drive(robot.parameters.numbers, voltages, World(**FIRM)).speeds
    time = np.arange(len(voltages)) * SAMPLING
    log = jaxid.Log.from_arrays(name, time, voltages, foreign, jaxid.PIONEER)
    rest = {state: np.zeros(1) for state in robot.states}
    return foreign, jaxid.simulate(robot, jaxid.LogSet([log]), start=rest)[0]


def agreement() -> dict[str, Any]:
    """Steady speeds under constant voltages, and RMS differences of whole experiments in units of the noise."""
    steady = []
    for held in VOLTAGES:
        foreign, own = _both("steady", np.tile(held, (501, 1)))
        steady.append({"voltages": held, "mujoco": foreign[-1].tolist(), "jaxid": own[-1].tolist()})
    moving = {}
    for number, kind in enumerate(KINDS):
        foreign, own = _both(kind, excitation.experiment("pioneer", kind, SAMPLES, SEED + number, LEVEL))
        moving[kind] = (np.sqrt(np.mean((foreign - own) ** 2, axis=0)) / NOISE["pioneer"]).tolist()
    return {"steady": steady, "rms_in_noise": moving}
