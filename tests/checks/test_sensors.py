"""Sensors of a base that spins while its motors push: alive, or dead all the same."""

import numpy as np
import pytest
from scipy.signal import lfilter

from jaxid import Channels, Custom, Log, LogSet, Parameter

DT, M, DRAG, NOISE = 0.02, 8.0, 6.0, 0.005
OMNI = Custom(
    dynamics=lambda s, u, p: {
        "vx": (u["fx"] - DRAG * s["vx"]) / p["M"] + s["w"] * s["vy"],
        "vy": (u["fy"] - DRAG * s["vy"]) / p["M"] - s["w"] * s["vx"],
        "w": 2.0 * u["turn"] - 2.0 * s["w"],
    },
    state_names=("vx", "vy", "w"),
    own_channels=Channels(
        ("fx", "fy", "turn"),
        ("vx", "vy", "w"),
        (),
        {"fx": "N", "fy": "N", "turn": "rad/s", "vx": "m/s", "vy": "m/s", "w": "rad/s"},
    ),
    table={"M": Parameter(M, "kg", lower=0.0, free=True)},
)


def spinning(seed):
    """A log in closed form but for the heading within a step: in the world's frame the velocity decays towards what pushes."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1.0, 1.0, (40, 3)) * (12.0, 12.0, 4.0), 25, axis=0)
    velocity, heading, w, seen = 0j, 0.0, 0.0, []
    for fx, fy, turn in u:
        own = velocity * np.exp(-1j * heading)
        seen.append((own.real, own.imag, w))
        for _ in range(20):
            decay = np.exp(-DRAG / M * DT / 20)
            velocity = velocity * decay + (fx + 1j * fy) / DRAG * np.exp(1j * heading) * (1.0 - decay)
            heading += w * DT / 20
            w = turn + (w - turn) * np.exp(-2.0 * DT / 20)
    return DT * np.arange(len(u)), u, np.array(seen) + NOISE * rng.normal(size=(len(u), 3))


def dead(time, u, outputs):
    logs = LogSet([Log.from_arrays("run", time, u, outputs, OMNI.channels)])
    return [f.column for f in logs.preflight() if f.check == "dead_sensor"]


@pytest.mark.parametrize("seed", range(6))
def test_speeds_of_a_base_that_spins_are_not_dead(seed):
    assert dead(*spinning(seed)) == []


@pytest.mark.parametrize("seed", range(6))
def test_a_sensor_that_only_rustles_is_dead_on_such_a_base_too(seed):
    time, u, outputs = spinning(seed)
    noise = lfilter([1.0], [1.0, -0.9], np.random.default_rng(100 + seed).normal(size=len(time)))
    outputs[:, 1] = 0.5 * noise / np.std(noise)
    assert dead(time, u, outputs) == ["vy"]
