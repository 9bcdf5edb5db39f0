"""Laws that nature may have written a mechanism in: their names, parameters and sources, and the vector the equations read.

`laws={"mechanism/law": {parameter: value}}`; parameters left out take the value of `LAWS`, where the first is the
strength, and zero changes nothing. Names of mechanisms are those of `reference.effects`, whose own formulas these laws
are not, and of a few mechanisms more. `drawn` laws are curves without a formula (`reference.curves`), drawn from `seed`.

Laws of forces, friction, motors and floors act in the differential equations (`reference.law_robots`) through the vector
that follows `reference.effects.E`, indexed by `K`; those of commands, delays and sensors on the signals
(`reference.law_signals`).
"""

from collections.abc import Callable, Mapping
from enum import IntEnum

import numpy as np

from reference import curves
from reference.effects import E

Laws = Mapping[str, Mapping[str, float]]

# Speeds in m/s at the rim (Pioneer) or of the axis; wheels, motors, axes and channels are counted from 1.
LAWS: dict[str, dict[str, float]] = {
    # Armstrong-Helouvry, Dupont, Canudas 1994: exp(-(s / speed)^d) with d = 1 and 1/2, and 1 / (1 + (s / speed)^2)
    "stribeck_friction/exponential": {"amplitude": 0.0, "speed": 0.05},
    "stribeck_friction/lorentzian": {"amplitude": 0.0, "speed": 0.05},
    "stribeck_friction/root": {"amplitude": 0.0, "speed": 0.05},
    "stribeck_friction/relative": {"share": 0.0, "speed": 0.05},  # of each axis's own Coulomb level, Gaussian
    "stribeck_friction/one_wheel": {"amplitude": 0.0, "speed": 0.05, "wheel": 1.0},  # Gaussian
    "stribeck_friction/drawn": {"amplitude": 0.0, "speed": 0.05, "seed": 0.0},  # gone at three times `speed`
    # torque = Kt i and emf = Ke w have one constant; i = (u - emf) / R
    "motor_gain_mismatch/torque_constant": {"mismatch": 0.0, "motor": 1.0},
    "motor_gain_mismatch/winding_resistance": {"mismatch": 0.0, "motor": 1.0},
    "motor_gain_mismatch/drawn": {"mismatch": 0.0, "motor": 1.0, "full": 10.0, "seed": 0.0},  # gain by voltage
    # drive force f becomes F tanh(f / F); a hard limit at one wheel; F curve(|f| / 2.5 F) 2.5
    "traction_limit/tanh": {"inverse_limit": 0.0},  # 1/N
    "traction_limit/one_wheel": {"inverse_limit": 0.0, "wheel": 1.0},
    "traction_limit/drawn": {"inverse_limit": 0.0, "seed": 0.0},
    "asymmetric_friction/one_wheel": {"asymmetry": 0.0, "wheel": 1.0},
    "asymmetric_friction/mirrored": {"asymmetry": 0.0},  # wheels 1 and 2 the other way round: by turning direction
    "asymmetric_friction/with_viscous": {"asymmetry": 0.0},
    "asymmetric_friction/drawn": {"asymmetry": 0.0, "seed": 0.0},  # forwards only, level (1 + asymmetry (1 + curve))
    "asymmetric_viscous_friction/one_wheel": {"asymmetry": 0.0, "wheel": 1.0},
    "asymmetric_viscous_friction/mirrored": {"asymmetry": 0.0},
    "asymmetric_viscous_friction/drawn": {"asymmetry": 0.0, "seed": 0.0},  # forwards only, and not linear
    "sublinear_viscous_friction/tanh": {"curvature": 0.0},  # B s becomes B tanh(curvature s) / curvature; s/m
    "sublinear_viscous_friction/cubic": {"coefficient": 0.0},  # B s (1 + coefficient s^2); MuJoCo's polynomial damping
    "sublinear_viscous_friction/drawn": {"share": 0.0, "seed": 0.0},  # B s (1 - share curve(|s|))
    "quadratic_drag/one_axis": {"coefficient": 0.0, "axis": 1.0},  # N s^2/m^2, of one speed alone
    "quadratic_drag/cubic": {"coefficient": 0.0},  # N s^3/m^3 along the forward axis
    "quadratic_drag/drawn": {"force": 0.0, "seed": 0.0},  # N at 1 m/s, odd, convex
    "actuator_dead_zone/threshold": {"threshold": 0.0},  # V; nothing below, everything above
    "actuator_dead_zone/unequal": {"threshold": 0.0, "ratio": 0.3},  # edges threshold and -ratio threshold, subtracted
    "actuator_dead_zone/one_motor": {"threshold": 0.0, "motor": 1.0},
    "actuator_dead_zone/drawn": {"threshold": 0.0, "seed": 0.0},  # convex up to three thresholds, the identity beyond
    "voltage_saturation/tanh": {"inverse_limit": 0.0},  # 1/V
    "voltage_saturation/unequal": {"inverse_limit": 0.0},  # forwards only, hard
    "voltage_saturation/drawn": {"inverse_limit": 0.0, "seed": 0.0},
    "battery_sag/total_current": {"resistance": 0.0, "nominal": 12.0},  # by the sum of |i| instead of the choppers' input
    "battery_sag/recovery": {"resistance": 0.0, "nominal": 12.0, "time": 3.0},  # half at once, half through one RC element
    "battery_sag/charge": {"fall": 0.0, "nominal": 12.0},  # V of open-circuit voltage per A s
    "battery_sag/drawn": {"drop": 0.0, "nominal": 12.0, "full": 20.0, "seed": 0.0},  # V at `full` amperes
    "motor_heating/cooling": {"coefficient": 0.0, "time": 8.0},  # 1/J, s
    "motor_heating/torque_constant": {"coefficient": 0.0},  # Kt (and Ke) fall, 1/J
    "motor_heating/drawn": {"rise": 0.0, "full": 500.0, "seed": 0.0},  # resistance, relative, at `full` joules
    "motor_lag/inductance": {"time_constant": 0.0},  # L / R: the back-EMF lags as well
    "motor_lag/second_order": {"time_constant": 0.0, "damping": 0.8},  # 1 / natural frequency
    "motor_lag/one_motor": {"time_constant": 0.0, "motor": 1.0},
    "motor_lag/slew": {"time_per_volt": 0.0},  # s/V; a driver's ramp
    "motor_lag/drawn": {"time_constant": 0.0, "seed": 0.0},  # step response in four drawn steps, this their mean delay
    "input_delay/one_motor": {"delay": 0.0, "motor": 1.0},
    "input_delay/jittering": {"delay": 0.0, "seed": 0.0},  # each row's own, uniform in 0 to 2 delay
    "sensor_lag/second_order": {"time_constant": 0.0},  # two equal ones in series, each of half of it
    "sensor_lag/one_channel": {"time_constant": 0.0, "channel": 1.0},
    "sensor_lag/moving_average": {"time_constant": 0.0},  # over a window of twice this
    "sensor_lag/drawn": {"time_constant": 0.0, "seed": 0.0},
    "sensor_delay/one_channel": {"delay": 0.0, "channel": 1.0},
    "sensor_delay/jittering": {"delay": 0.0, "seed": 0.0},
    "surface_change/disc": {"change": 0.0, "x": 0.5, "y": 0.5, "radius": 0.4},  # Coulomb and viscous, relative, m
    "surface_change/gradual": {"change": 0.0, "angle": 0.0, "offset": 0.5, "width": 0.3},
    "surface_change/drawn": {"change": 0.0, "angle": 0.0, "offset": 0.0, "width": 2.0, "seed": 0.0},
    "ground_slope/two_planes": {"angle": 0.0, "direction": 0.0, "turn": 1.0, "offset": 0.3},  # turned beyond x = offset
    "ground_slope/bowl": {"curvature": 0.0},  # rad of slope per metre from the origin, uphill outwards
    "ground_slope/drawn": {"angle": 0.0, "direction": 0.0, "width": 1.5, "seed": 0.0},  # curve of the way downhill
    "cogging_torque/two_harmonics": {"amplitude": 0.0, "periods": 6.0, "share": 0.6, "phase": 1.0},
    "cogging_torque/by_current": {"share": 0.0, "periods": 6.0},  # drive (1 + share sin(periods angle))
    "cogging_torque/drawn": {"amplitude": 0.0, "periods": 6.0, "seed": 0.0},
    "sensor_bias/drifting": {"bias": 0.0, "channel": 1.0},  # from 0 to this at the end of a log
    "sensor_bias/warming": {"bias": 0.0, "channel": 1.0, "time": 6.0},  # bias (1 - exp(-t / time))
    "sensor_bias/drawn": {"bias": 0.0, "channel": 1.0, "seed": 0.0},  # over the log
    "sensor_scale/one_direction": {"error": 0.0, "channel": 1.0},  # forwards only
    "sensor_scale/drawn": {"error": 0.0, "channel": 1.0, "seed": 0.0},  # v (1 + error curve(|v|))
    "sensor_cross_talk/misaligned": {"angle": 0.0, "channel": 1.0, "other": 2.0},  # v + angle other
    "load_dependent_friction/level": {"share": 0.0},  # of |drive torque| (BAM's M3)
    "load_dependent_friction/efficiency": {"share": 0.0, "driven": 0.3},  # driving, and this part of it when driven
    "load_dependent_friction/drawn": {"share": 0.0, "full": 4.0, "seed": 0.0},  # share full curve(|drive| / full)
    "turning_friction/coulomb_viscous": {"moment": 0.0, "viscous": 0.3},  # N m; per rad/s relative to it (smooth at rest)
    "turning_friction/scrub": {"moment": 0.0, "radius": 0.3},  # by the ratio of turning to driving; m
    "turning_friction/drawn": {"moment": 0.0, "seed": 0.0},  # at 2 rad/s
    "effective_track/wider": {"share": 0.0},
    "effective_track/by_direction": {"share": 0.0},  # wider by it in left turns, narrower in right ones
    "effective_track/drawn": {"share": 0.0, "seed": 0.0},  # by yaw rate, full at 2 rad/s
    "freewheeling_driver/below": {"threshold": 0.0},  # V: no current below it, so no braking by the back-EMF either
}
NOT_ON = {
    "pioneer": {"quadratic_drag/one_axis"},
    "omni": {"effective_track/wider"},  # the same model as other constants about W
    "axis": set(),
}
_AXIS_HAS_NO = (
    "motor_gain_mismatch battery_sag motor_heating asymmetric_friction surface_change ground_slope sensor_scale "
    "sensor_cross_talk turning_friction effective_track freewheeling_driver"
).split()
_WORDS_OF_MANY = ("one_wheel", "mirrored", "one_motor", "one_channel", "inductance", "one_axis")

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
    "sensor_first": 3, "sensor_second": 3,
}  # fmt: skip
_STARTS = len(E) + np.concatenate(([0], np.cumsum(list(_SIZES.values()))))
K = IntEnum("K", {name: int(start) for name, start in zip(_SIZES, _STARTS[:-1], strict=True)})
LENGTH = int(_STARTS[-1])
SIGNALS = ("actuator_dead_zone", "voltage_saturation", "input_delay", "sensor_delay", "sensor_bias", "sensor_scale",
           "sensor_cross_talk", "motor_gain_mismatch/drawn", "motor_lag/drawn", "sensor_lag/moving_average",
           "sensor_lag/drawn")  # fmt: skip
"""Laws, or mechanisms all of whose laws act on the signals."""
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
}


def applies(law: str, robot: str) -> bool:
    """Whether the robot can have the law, and be another robot with it."""
    mechanism, word = law.split("/")
    if robot == "axis" and (mechanism in _AXIS_HAS_NO or word in _WORDS_OF_MANY):
        return False
    if robot == "omni" and mechanism == "effective_track":
        return False
    return law not in NOT_ON[robot]


def complete_laws(laws: Laws | None, robot: str) -> dict[str, dict[str, float]]:
    """The laws that change something, with all parameters; raises ValueError for what is unknown."""
    full = {}
    for law, values in (laws or {}).items():
        if law not in LAWS:
            raise ValueError(f"Unknown law '{law}'; choose from {', '.join(LAWS)}.")
        if not applies(law, robot):
            raise ValueError(f"The law '{law}' does not apply to the robot '{robot}'; leave it out.")
        unknown = set(values) - set(LAWS[law])
        if unknown:
            raise ValueError(f"The law '{law}' has no parameter {sorted(unknown)}; it has {', '.join(LAWS[law])}.")
        own = {**LAWS[law], **{name: float(value) for name, value in values.items()}}
        if next(iter(own.values())) != 0.0:
            full[law] = own
    return full


def on_signals(law: str) -> bool:
    """Whether the law acts on commands or measurements, not in the differential equations."""
    return law in SIGNALS or law.split("/")[0] in SIGNALS


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
    e[K.freewheel] = v["threshold"]


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
}
