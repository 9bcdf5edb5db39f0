"""A line across the floor, beyond which something is another: `x cos(angle) + y sin(angle) > offset`."""

import jax.numpy as jnp
import numpy as np

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers, Scalar, State
from ..robots.probe import Seen
from ..robots.robot import Robot
from ..robots.trigonometry import sincos
from .effect_parameters import shape, signed


def line_parameters(effect: Effect, robot: Robot) -> dict[str, Parameter]:
    """Angle and offset of the line, and the fixed width of its edge: the way of one integration step."""
    scales = robot.scales
    line = signed(effect, "angle", "rad", 1.0) | signed(effect, "offset", robot.length_unit, 0.15 * scales.length)
    return line | shape(effect, "width", robot.length_unit, 0.25 * scales.speed * scales.interval, free=False)


def beyond_line(effect: Effect, state: State, p: Numbers, edge: float) -> Scalar:
    """0 before the line, 1 beyond it, smooth over `edge` times the width."""
    sine, cosine = sincos(p[effect.key("angle")])
    distance = state["x"] * cosine + state["y"] * sine - p[effect.key("offset")]
    return 0.5 * (1.0 + jnp.tanh(distance / (edge * p[effect.key("width")])))


def lines_across(effect: Effect, seen: Seen, shares: tuple[float, ...], half: bool = False) -> list[dict[str, float]]:
    """Lines in eight directions (with `half`, in the four that are no other's far side) that leave `shares` of the driven path
    on their near side; none where the path is not known. The near side, on which the robot is what its own parameters say,
    is that on which the first log begins: a line with its sides exchanged is another robot on another floor, and the same."""
    path = seen.path()
    if path is None:
        return []
    places = []
    for angle in np.arange(4 if half else 8) * np.pi / 4:
        along = path @ np.array([np.cos(angle), np.sin(angle)])
        for offset in np.quantile(along, shares):
            side = 1.0 if along[0] <= offset else -1.0
            turned = angle if side > 0.0 else (angle + np.pi) % (2.0 * np.pi)
            places.append({effect.key("angle"): float(turned), effect.key("offset"): float(side * offset)})
    return places
