"""The omni robot under velocity control, as in section 4 of the omni paper (figures 10-12).

    reference -> PI controller of each axis -> duties of four motors, limited to ±255 -> driver -> currents -> motion

The paper prints neither the controller, nor the sampling period, nor what limits the currents. Declared assumptions,
all of them arguments: one PI controller for V, Vn and W each, whose integrators stand still while a duty of theirs is
saturated; speeds measured and duties renewed every 0.02 s; the driver turns duty 255 into the supply voltage and lowers
the voltage at once wherever the motor would draw more than 6 A.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from ..._compile import compiled
from ..._float64 import in_float64
from ...parameters import Parameter
from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.omni import Omni, wheel_speeds
from ...robots.robot import Robot
from ...simulation.friction import Sticking
from ...simulation.rollout import step
from .printed import AXES

LARGEST_DUTY = 255.0
"""The duty at which the driver gives the motors the whole supply voltage."""


@dataclass(frozen=True)
class VelocityController:
    """PI velocity control with a motor driver; the defaults are assumptions that give figures 10-12 their shape.

    **Fields:** `proportional` [duty per m/s, m/s, rad/s] and `integral` [duty per m, m, rad] gains of (V, Vn, W), zero
    integral gains giving P control; `current_limit` [A] of the driver; `sampling` [s].

    Raises `ValueError` for a current limit or sampling period that is not above zero, and for negative gains.
    """

    proportional: tuple[float, float, float] = (600.0, 600.0, 14.0)
    integral: tuple[float, float, float] = (1000.0, 1000.0, 120.0)
    current_limit: float = 6.0
    sampling: float = 0.02

    def __post_init__(self) -> None:
        if not (self.current_limit > 0 and self.sampling > 0):
            raise ValueError(
                f"The controller has current_limit = {self.current_limit} A and sampling = {self.sampling} s; both "
                "must be above zero."
            )
        if len(self.proportional) != 3 or len(self.integral) != 3 or min(*self.proportional, *self.integral) < 0:
            raise ValueError(
                f"The controller has gains {self.proportional} and {self.integral}; give three for V, Vn, W, none "
                "negative."
            )


class ClosedLoop(NamedTuple):
    """What the loop did, as NumPy arrays: `time` [T] s; `reference` and `speeds` [T, 3] m/s, m/s, rad/s; `currents`
    [T, 4] A; `duty` [T, 4] in ±255.

    Row k holds the speeds at t_k, the duty chosen from them, and the currents just after t_k. With
    `Omni(inductance=True)` the currents are those at t_k, before the new duty acts.
    """

    time: np.ndarray
    reference: np.ndarray
    speeds: np.ndarray
    currents: np.ndarray
    duty: np.ndarray


def mix(command: Scalars) -> Scalars:
    """Commands of the axes (V, Vn, W) -> commands of wheels 1-4, the transpose of the traction forces' eqs. 4-6."""
    V, Vn, W = command
    return Vn + W, -V + W, -Vn + W, V + W


@dataclass(frozen=True)
class CurrentLimit(Effect):
    """A motor driver that at every instant lowers the voltage to where no motor draws more than its limit [A].

    Not one of the missing effects to be named from data: part of the closed loop here. Without inductance (eq. 9).
    """

    id: ClassVar[str] = "driver_current_limit"
    where: ClassVar[str] = "actuator"
    limit: float = field(default=6.0, compare=False)  # a number, no part of the compiled structure

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        return {
            self.key("limit"): Parameter(self.limit, "A", lower=0.0, meaning="largest motor current", source="assumed")
        }

    def supply(self, volts: Scalars, currents: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        emf = (p["Kv"] * p["l"] / p["r"] * v for v in wheel_speeds(state, p))
        reach = p["Ra"] * p[self.key("limit")]
        return tuple(jnp.clip(u, e - reach, e + reach) for u, e in zip(volts, emf, strict=True))


@partial(compiled, static_argnames=("robot", "substeps"))
def _loop(robot: Omni, p: Numbers, reference: Float[Array, "T 3"], gains, sampling, substeps: int):
    """Scan over the samples: speeds [T, 3] with currents [T, 4], and duties [T, 4]."""
    proportional, integral = gains
    friction = Sticking()

    def sample(carry, wanted):
        state, memory = carry
        error = wanted - jnp.stack([state[name] for name in AXES])
        raw = jnp.stack(mix(tuple(proportional * error + memory)))
        duty = jnp.clip(raw, -LARGEST_DUTY, LARGEST_DUTY)
        # An axis whose motors are all within their range integrates; V drives motors 2 and 4, Vn 1 and 3, W all four.
        within = jnp.abs(raw) <= LARGEST_DUTY
        one, two, three, four = within
        free = jnp.stack([two & four, one & three, one & two & three & four])
        memory = memory + jnp.where(free, integral * sampling * error, 0.0)
        commanded = tuple(duty / LARGEST_DUTY * p["supply"])
        seen = jnp.stack([jnp.asarray(y) for y in robot.observe(state, commanded, p)])

        def substep(s, _):
            return step(robot, s, commanded, sampling / substeps, p, friction), None

        state, _ = jax.lax.scan(substep, state, None, length=substeps)
        return (state, memory), (seen, duty)

    start = {name: jnp.asarray(value, float) for name, value in robot.initial_state().items()}
    _, rows = jax.lax.scan(sample, (start, jnp.zeros(3)), reference)
    return rows


@in_float64
def closed_loop(
    reference: ArrayLike | Sequence[float],
    robot: Omni | None = None,
    controller: VelocityController | None = None,
    *,
    duration: float = 1.5,
    substeps: int = 8,
) -> ClosedLoop:
    """Simulate the velocity-controlled omni robot from rest.

    **Arguments:**

    - `reference`: (V, Vn, W) [m/s, m/s, rad/s] to hold, or `[T, 3]`, one row for each sampling instant.
    - `robot`, `controller`: the defaults are the paper's means and the assumptions above.
    - `duration` [s] for a constant reference; `substeps` integration steps in a sampling period.

    Raises `ValueError` for a reference of another shape or not finite, and a duration or substeps below one step.
    """
    robot = Omni() if robot is None else robot
    controller = VelocityController() if controller is None else controller
    wanted = np.asarray(reference, dtype=float)
    if wanted.shape == (3,):
        wanted = np.tile(wanted, (round(duration / controller.sampling) + 1, 1))
    if wanted.ndim != 2 or wanted.shape[1] != 3 or len(wanted) < 2 or not np.isfinite(wanted).all():
        raise ValueError(
            f"The reference has shape {wanted.shape}; give finite (V, Vn, W), or one such row for each of two or more "
            "samples."
        )
    if substeps < 1:
        raise ValueError(f"The loop cannot run with {substeps} substeps; give 1 or more.")
    robot = robot + CurrentLimit(controller.current_limit)
    numbers = {name: jnp.asarray(value) for name, value in robot.parameters.numbers.items()}
    gains = jnp.asarray(controller.proportional), jnp.asarray(controller.integral)
    seen, duty = _loop(robot.structure, numbers, jnp.asarray(wanted), gains, controller.sampling, substeps)
    seen = np.asarray(seen)
    time = np.arange(len(wanted)) * controller.sampling
    return ClosedLoop(time, wanted, seen[:, :3], seen[:, 3:7], np.asarray(duty))
