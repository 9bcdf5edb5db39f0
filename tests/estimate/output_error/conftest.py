"""A pendulum of a user's own, and logs of SciPy's."""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Integrator, Log, LogSet, Parameter, float64
from jaxid.estimate.output_error.problem import Unknowns
from jaxid.estimate.output_error.setup import build
from reference import pendulum as scipys

CHANNELS = Channels(("u",), ("q",), units={"u": "N m", "q": "rad"})


def dynamics(state, inputs, p):
    """q'' = -g sin q - d q' + b u."""
    return {"q": state["w"], "w": -p["g"] * jnp.sin(state["q"]) - p["d"] * state["w"] + p["b"] * inputs["u"]}


def robot(**values: float) -> Custom:
    """The pendulum, its angle measured; its function is one and the same, so that all of them share their programs."""
    table = {
        "g": Parameter(9.0, "1/s²", free=True, lower=0.0),
        "d": Parameter(0.1, "1/s", free=True, lower=0.0),
        "b": Parameter(1.0, "1/(kg m²)", free=True),
    }
    plain = Custom(dynamics=dynamics, state_names=("q", "w"), own_channels=CHANNELS, table=table, title="pendulum")
    return plain.with_values(**values)


def recorded(name: str, u: np.ndarray, *arguments, **options) -> Log:
    return Log.from_arrays(name, *scipys.recorded(u, *arguments, **options), CHANNELS)


def upright(angle: float, rate: float) -> float:
    """A controller that keeps it upright."""
    return -30.0 * (angle - np.pi) - 6.0 * rate


@pytest.fixture(scope="session")
def pendulum() -> SimpleNamespace:
    return SimpleNamespace(robot=robot, recorded=recorded, upright=upright, held=scipys.held, truth=scipys.TRUTH)


def levels(n, seed):
    return np.repeat(np.random.default_rng(seed).uniform(-2, 2, -(-n // 10)), 10)[:n]


@pytest.fixture(scope="session")
def problem(axis_log):
    """Three logs of different length and channels, gaps, one that starts in motion, a prior and a fixed parameter."""
    gaps = axis_log("gaps", levels(150, 1), noise=0.01, seed=1)
    outputs = gaps.outputs.copy()
    outputs[40:60, 0] = np.nan
    outputs[55:90, 1] = np.nan
    logs = LogSet(
        [
            Log.from_arrays("gaps", gaps.time, gaps.inputs, outputs, "axis"),
            axis_log("no position", levels(200, 2), noise=0.01, seed=2, dt=0.015, position=False),
            axis_log("moving", levels(90, 3), noise=0.01, seed=3, v=0.5, q=0.3),
        ]
    )
    robot = Axis().change("M", prior=(1.3, 0.2)).change("Fc", prior=(0.4, 0.05))
    with float64():
        start = dict(M=1.2, Fv=1.7, Fc=0.4, offset=0.05)
        structure, found, unknowns = build(robot, logs, start=start, integrator=Integrator(2))
        held = np.array([True, True, True, False])  # the offset stays
        found = replace(found, free=jnp.asarray(held), state_precision=jnp.array([3.0, 0.0]))
        rng = np.random.default_rng(4)
        states = jnp.asarray(rng.normal(size=unknowns.states.shape)) * found.state_free
    return structure, found, Unknowns(unknowns.z, states)
