"""A pendulum of a user's own, and logs of SciPy's."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Channels, Custom, Log, Parameter
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
