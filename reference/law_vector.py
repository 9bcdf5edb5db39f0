"""The vector in which the equations read the laws: it follows that of the effects, and `K` says where what begins.

A place holds one number, one for each axis, wheel or motor, or a curve (`reference.curves`).
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from reference import curves
from reference.effects import E
from reference.law_table import on_signals

_SIZES = {
    # dry friction: excess near standstill by axis, absolute and relative to the level
    "rise": 3, "relative": 3, "rise_speed": 1, "rise_kind": 1, "rise_curve": 12,
    "coulomb_asymmetry": 3, "viscous_asymmetry": 3, "one_sided": 1, "one_sided_viscous": 1, "one_sided_curve": 12,
    "load": 1, "load_driven": 1, "load_full": 1, "load_curve": 12,
    "viscous_kind": 1, "viscous_size": 1, "viscous_curve": 12,
    "drag": 3, "cubic_drag": 1, "drag_force": 1, "drag_curve": 12,
    "turn_moment": 1, "turn_viscous": 1, "turn_radius": 1, "turn_drawn": 1, "turn_curve": 12,
    "track": 1, "track_kind": 1, "track_curve": 12,
    "floor_kind": 1, "floor_change": 1, "floor_x": 1, "floor_y": 1, "floor_offset": 1, "floor_width": 1, "floor_curve": 12,
    "slope_kind": 1, "slope_size": 1, "slope_x": 1, "slope_y": 1, "slope_turn": 1, "slope_offset": 1, "slope_curve": 12,
    # the motors' own model, which replaces the plain one
    "own_motors": 1, "strength": 4, "resistance": 4, "winding": 1, "lag": 4, "frequency": 1, "damping": 1, "slew": 1,
    "sag": 1, "sag_slow": 1, "sag_time": 1, "charge": 1, "sag_drop": 1, "sag_full": 1, "nominal": 1, "sag_curve": 12,
    "heat_resistance": 1, "heat_strength": 1, "heat_time": 1, "heat_rise": 1, "heat_full": 1, "heat_curve": 12,
    "grip_kind": 1, "grip": 4, "grip_curve": 12, "freewheel": 1,
    "ripple": 1, "ripple_second": 1, "ripple_phase": 1, "ripple_share": 1, "ripple_periods": 1, "ripple_drawn": 1,
    "ripple_curve": 12,
    "bristle": 1, "creep": 1, "no_braking": 1, "no_braking_full": 1, "no_braking_curve": 12,
    "payload_kind": 1, "payload": 1, "payload_time": 1, "payload_curve": 12,
    "sensor_first": 3, "sensor_second": 3,
}  # fmt: skip
_STARTS = len(E) + np.concatenate(([0], np.cumsum(list(_SIZES.values()))))
K: Any = IntEnum("K", {name: int(start) for name, start in zip(_SIZES, _STARTS[:-1], strict=True)})
LENGTH = int(_STARTS[-1])
OWN_MOTORS = ("motor_gain_mismatch", "traction_limit", "battery_sag", "motor_heating", "motor_lag", "cogging_torque",
              "load_dependent_friction", "freewheeling_driver")  # fmt: skip
_CURVES: dict[str, tuple[str, Callable[[float], np.ndarray]]] = {
    "stribeck_friction": ("rise_curve", curves.falling),
    "traction_limit": ("grip_curve", curves.compressing),
    "asymmetric_friction": ("one_sided_curve", curves.growing),
    "asymmetric_viscous_friction": ("one_sided_curve", curves.convex),
    "sublinear_viscous_friction": ("viscous_curve", curves.growing),
    "quadratic_drag": ("drag_curve", curves.convex),
    "battery_sag": ("sag_curve", curves.growing),
    "motor_heating": ("heat_curve", curves.growing),
    "surface_change": ("floor_curve", curves.growing),
    "ground_slope": ("slope_curve", curves.growing),
    "cogging_torque": ("ripple_curve", curves.periodic),
    "load_dependent_friction": ("load_curve", curves.growing),
    "turning_friction": ("turn_curve", curves.growing),
    "effective_track": ("track_curve", curves.growing),
    "freewheeling_driver": ("no_braking_curve", curves.falling),
    "payload_change": ("payload_curve", curves.growing),
}


def law_vector(full: Mapping[str, Mapping[str, float]], n_axes: int, n_motors: int) -> np.ndarray:
    """What follows the vector of effects: the laws of `complete_laws` that act in the equations, (LENGTH - len(E),)."""
    e = np.zeros(LENGTH)
    e[K.strength : K.strength + 4] = e[K.resistance : K.resistance + 4] = 1.0
    for law, values in full.items():
        if on_signals(law):
            continue
        mechanism, word = law.split("/")
        if word == "drawn":
            place, draw = _CURVES[mechanism]
            e[K[place] : K[place] + 12] = draw(values["seed"])
        if mechanism in OWN_MOTORS:
            e[K.own_motors] = 1.0
        _WRITE[mechanism](e, word, values, n_axes, n_motors)
    return e[len(E) :]


def _one(e: np.ndarray, slot: int, n: int, values: Mapping[str, float], size: float) -> None:
    """The size in the place of one wheel, motor or axis."""
    which = int(values.get("wheel", values.get("motor", values.get("axis", 1)))) - 1
    if not 0 <= which < n:
        raise ValueError(f"There is no number {which + 1}; there are {n}.")
    e[slot + which] = size


def _stribeck(e, word, v, n_axes, n_motors) -> None:
    e[K.rise_speed] = v["speed"]
    e[K.bristle] = v.get("distance", 0.0)
    e[K.rise_kind] = {"exponential": 1.0, "root": 0.5, "lorentzian": -1.0, "drawn": -2.0}.get(word, 2.0)
    if word == "relative":
        e[K.relative : K.relative + 3] = v["share"]
    elif word == "one_wheel":
        _one(e, K.rise, min(n_axes, 2) if n_motors == 2 else n_axes, v, v["amplitude"])
    else:
        e[K.rise : K.rise + 3] = v["amplitude"]


def _strength(e, word, v, n_axes, n_motors) -> None:
    slot = K.strength if word == "torque_constant" else K.resistance
    _one(e, slot, n_motors, v, 1.0 + v["mismatch"])


def _grip(e, word, v, n_axes, n_motors) -> None:
    if word == "creep":
        e[K.creep] = v["creep"]
        return
    e[K.grip_kind] = {"tanh": 1.0, "drawn": 2.0}.get(word, 0.0)
    if word == "one_wheel":
        _one(e, K.grip, n_motors, v, v["inverse_limit"])
    else:
        e[K.grip : K.grip + 4] = v["inverse_limit"]


def _asymmetry(e, word, v, n_axes, n_motors) -> None:
    if word == "one_wheel":
        _one(e, K.coulomb_asymmetry, n_axes, v, v["asymmetry"])
    elif word == "mirrored":
        e[K.coulomb_asymmetry], e[K.coulomb_asymmetry + 1] = v["asymmetry"], -v["asymmetry"]
    elif word == "drawn":
        e[K.one_sided] = v["asymmetry"]
    else:
        e[K.coulomb_asymmetry : K.coulomb_asymmetry + 3] = v["asymmetry"]
        e[K.viscous_asymmetry : K.viscous_asymmetry + 3] = v["asymmetry"]


def _viscous_asymmetry(e, word, v, n_axes, n_motors) -> None:
    if word == "one_wheel":
        _one(e, K.viscous_asymmetry, n_axes, v, v["asymmetry"])
    elif word == "mirrored":
        e[K.viscous_asymmetry], e[K.viscous_asymmetry + 1] = v["asymmetry"], -v["asymmetry"]
    else:
        e[K.one_sided_viscous] = v["asymmetry"]


def _viscous_shape(e, word, v, n_axes, n_motors) -> None:
    e[K.viscous_kind] = {"tanh": 1.0, "cubic": 2.0, "drawn": 3.0}[word]
    e[K.viscous_size] = next(iter(v.values()))


def _drag(e, word, v, n_axes, n_motors) -> None:
    if word == "one_axis":
        _one(e, K.drag, n_axes, v, v["coefficient"])
    elif word == "cubic":
        e[K.cubic_drag] = v["coefficient"]
    else:
        e[K.drag_force] = v["force"]


def _turning(e, word, v, n_axes, n_motors) -> None:
    if word == "drawn":
        e[K.turn_drawn] = v["moment"]
        return
    e[K.turn_moment], e[K.turn_viscous], e[K.turn_radius] = v["moment"], v.get("viscous", 0.0), v.get("radius", 0.0)


def _track(e, word, v, n_axes, n_motors) -> None:
    e[K.track], e[K.track_kind] = v["share"], {"wider": 0.0, "by_direction": 1.0, "drawn": 2.0}[word]
    if word != "wider":
        e[K.own_motors] = 1.0


def _floor(e, word, v, n_axes, n_motors) -> None:
    e[K.floor_kind], e[K.floor_change] = {"disc": 1.0, "gradual": 2.0, "drawn": 3.0}[word], v["change"]
    if word == "disc":
        e[K.floor_x], e[K.floor_y], e[K.floor_width] = v["x"], v["y"], v["radius"]
    else:
        e[K.floor_x], e[K.floor_y] = np.cos(v["angle"]), np.sin(v["angle"])
        e[K.floor_offset], e[K.floor_width] = v["offset"], v["width"]


def _slope(e, word, v, n_axes, n_motors) -> None:
    e[K.slope_kind] = {"two_planes": 1.0, "bowl": 2.0, "drawn": 3.0}[word]
    e[K.slope_size] = 9.81 * np.sin(v["angle"]) if word != "bowl" else 9.81 * v["curvature"]
    direction = v.get("direction", 0.0)
    e[K.slope_x], e[K.slope_y] = np.cos(direction), np.sin(direction)
    e[K.slope_turn], e[K.slope_offset] = v.get("turn", 0.0), v.get("offset", v.get("width", 0.0))


def _sag(e, word, v, n_axes, n_motors) -> None:
    e[K.nominal] = v["nominal"]
    if word == "total_current":
        e[K.sag] = v["resistance"]
    elif word == "recovery":
        e[K.sag], e[K.sag_slow], e[K.sag_time] = 0.5 * v["resistance"], 0.5 * v["resistance"], v["time"]
    elif word == "charge":
        e[K.charge] = v["fall"]
    else:
        e[K.sag_drop], e[K.sag_full] = v["drop"], v["full"]


def _heat(e, word, v, n_axes, n_motors) -> None:
    if word == "cooling":
        e[K.heat_resistance], e[K.heat_time] = v["coefficient"], v["time"]
    elif word == "torque_constant":
        e[K.heat_strength] = v["coefficient"]
    else:
        e[K.heat_rise], e[K.heat_full] = v["rise"], v["full"]


def _lag(e, word, v, n_axes, n_motors) -> None:
    if word == "inductance":
        e[K.winding] = v["time_constant"]
    elif word == "second_order":
        e[K.frequency], e[K.damping] = 1.0 / v["time_constant"], v["damping"]
    elif word == "one_motor":
        _one(e, K.lag, n_motors, v, v["time_constant"])
    else:
        e[K.slew] = 1.0 / v["time_per_volt"]


def _ripple(e, word, v, n_axes, n_motors) -> None:
    e[K.ripple_periods] = v["periods"]
    if word == "two_harmonics":
        e[K.ripple], e[K.ripple_second], e[K.ripple_phase] = v["amplitude"], v["share"], v["phase"]
    elif word == "by_current":
        e[K.ripple_share] = v["share"]
    else:
        e[K.ripple_drawn] = v["amplitude"]


def _load(e, word, v, n_axes, n_motors) -> None:
    e[K.load], e[K.load_driven], e[K.load_full] = v["share"], v.get("driven", 1.0), v.get("full", 0.0)


def _freewheel(e, word, v, n_axes, n_motors) -> None:
    if word == "below":
        e[K.freewheel] = v["threshold"]
    else:
        e[K.no_braking], e[K.no_braking_full] = v["share"], v.get("full", 0.0)


def _payload(e, word, v, n_axes, n_motors) -> None:
    e[K.payload_kind] = {"in_some_logs": 1.0, "leaking": 2.0, "drawn": 3.0}[word]
    e[K.payload], e[K.payload_time] = v["mass"], v.get("time", 0.0)


def _constants(e, word, v, n_axes, n_motors) -> None:
    """Nothing in the vector: the law changes constants of the robot."""


def _sensor_lag(e, word, v, n_axes, n_motors) -> None:
    if word == "second_order":
        e[K.sensor_first : K.sensor_first + 3] = e[K.sensor_second : K.sensor_second + 3] = 0.5 * v["time_constant"]
    else:
        e[K.sensor_first + int(v["channel"]) - 1] = v["time_constant"]


_WRITE: dict[str, Callable[..., None]] = {
    "stribeck_friction": _stribeck,
    "motor_gain_mismatch": _strength,
    "traction_limit": _grip,
    "asymmetric_friction": _asymmetry,
    "asymmetric_viscous_friction": _viscous_asymmetry,
    "sublinear_viscous_friction": _viscous_shape,
    "quadratic_drag": _drag,
    "turning_friction": _turning,
    "effective_track": _track,
    "surface_change": _floor,
    "ground_slope": _slope,
    "battery_sag": _sag,
    "motor_heating": _heat,
    "motor_lag": _lag,
    "cogging_torque": _ripple,
    "load_dependent_friction": _load,
    "freewheeling_driver": _freewheel,
    "sensor_lag": _sensor_lag,
    "payload_change": _payload,
    "wheel_radius_mismatch": _constants,
}
