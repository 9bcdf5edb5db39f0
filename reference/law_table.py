"""Laws that nature may have written a mechanism in: their names, parameters and sources.

`laws={"mechanism/law": {parameter: value}}`; parameters left out take the value of `LAWS`, where the first is the
strength, and zero changes nothing. Names of mechanisms are those of `reference.effects`, whose own formulas these laws
are not, and of a few mechanisms more. `drawn` laws are curves without a formula (`reference.curves`), drawn from `seed`.

Laws of forces, friction, motors and floors act in the differential equations (`reference.law_robots`) through a vector
(`reference.law_vector`); those of commands, delays and sensors on the signals (`reference.law_signals`).
"""

from collections.abc import Mapping

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
    "battery_sag/total_current": {
        "resistance": 0.0,
        "nominal": 12.0,
    },  # by the sum of |i| instead of the choppers' input
    "battery_sag/recovery": {
        "resistance": 0.0,
        "nominal": 12.0,
        "time": 3.0,
    },  # half at once, half through one RC element
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
    "turning_friction/coulomb_viscous": {
        "moment": 0.0,
        "viscous": 0.3,
    },  # N m; per rad/s relative to it (smooth at rest)
    "turning_friction/scrub": {"moment": 0.0, "radius": 0.3},  # by the ratio of turning to driving; m
    "turning_friction/drawn": {"moment": 0.0, "seed": 0.0},  # at 2 rad/s
    "effective_track/wider": {"share": 0.0},
    "effective_track/by_direction": {"share": 0.0},  # of the drive: wider by it in left turns, narrower in right ones
    "effective_track/drawn": {"share": 0.0, "seed": 0.0},  # of the drive, by yaw rate, full at 2 rad/s
    "freewheeling_driver/below": {"threshold": 0.0},  # V: no current below it, so no braking by the back-EMF either
    # Those above were there when the cases of the studies got their seeds; new ones follow in the order they came.
    # Canudas et al. 1995: bristles that bend by `distance` [m] before sliding, with a Gaussian Stribeck curve
    "stribeck_friction/lugre": {"amplitude": 0.0, "speed": 0.05, "distance": 0.001},
    "traction_limit/creep": {"creep": 0.0},  # slip ratio per newton: wheels turn faster than the floor passes
    "input_delay/growing": {"delay": 0.0},  # from 0 to twice this over a log: a second clock
    "sensor_delay/growing": {"delay": 0.0},
    "sensor_cross_talk/rotated": {"angle": 0.0},  # the first two speeds, in a sensor's turned frame
    "sensor_cross_talk/drawn": {"error": 0.0, "channel": 1.0, "other": 2.0, "seed": 0.0},  # even in the other speed
    "freewheeling_driver/no_braking": {"share": 0.0},  # of a current against the command that does not flow: diodes
    "freewheeling_driver/drawn": {"share": 0.0, "full": 6.0, "seed": 0.0},  # the same at 0 V, by command less
    "payload_change/in_some_logs": {"mass": 0.0},  # kg (axis: the unit of its inertia)
    "payload_change/leaking": {"mass": 0.0, "time": 20.0},  # lost at a steady rate
    "payload_change/drawn": {"mass": 0.0, "time": 20.0, "seed": 0.0},
    "backlash/command": {"width": 0.0},  # V: the play operator, half a width to either side
    "wheel_radius_mismatch/one_wheel": {"mismatch": 0.0, "wheel": 1.0},
    "motor_cross_talk/one_way": {"share": 0.0, "motor": 1.0, "other": 2.0},  # u + share other
    "motor_cross_talk/mutual": {"share": 0.0},  # of the mean of all others
    "motor_cross_talk/drawn": {"share": 0.0, "full": 10.0, "seed": 0.0},  # mutual, growing with the others' voltage
}
NOT_ON = {
    "pioneer": {"quadratic_drag/one_axis"},
    "omni": {"wheel_radius_mismatch/one_wheel"},
    "axis": set(),
}
_AXIS_HAS_NO = (
    "motor_gain_mismatch motor_cross_talk battery_sag motor_heating asymmetric_friction surface_change ground_slope "
    "sensor_scale sensor_cross_talk turning_friction effective_track freewheeling_driver wheel_radius_mismatch"
).split()
_WORDS_OF_MANY = ("one_wheel", "mirrored", "one_motor", "one_channel", "inductance", "one_axis", "creep")

SIGNALS = ("actuator_dead_zone", "voltage_saturation", "input_delay", "sensor_delay", "sensor_bias", "sensor_scale",
           "sensor_cross_talk", "motor_cross_talk", "backlash", "motor_gain_mismatch/drawn", "motor_lag/drawn",
           "sensor_lag/moving_average", "sensor_lag/drawn")  # fmt: skip
"""Laws, or mechanisms all of whose laws act on the signals."""


def applies(law: str, robot: str) -> bool:
    """Whether the robot can have the law, and be another robot with it."""
    mechanism, word = law.split("/")
    if robot == "axis" and (mechanism in _AXIS_HAS_NO or word in _WORDS_OF_MANY):
        return False
    if robot == "omni" and mechanism == "effective_track":
        return False  # the same model as other constants about W
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
