"""Effects that can be hidden in a simulated log: the catalogue's, and a few that no catalogue holds.

`effects={id: {parameter: value}}`; parameters left out take the value of `EFFECTS`, where the strength (the first
parameter of each entry) is the value that changes nothing. Static actuator effects act on the sampled input, sensor
effects on the sampled output, and all others inside the differential equations, through the vector `e` indexed by
`E`.
"""

from collections.abc import Mapping
from enum import IntEnum

import numpy as np
from numba import njit

NONE = 1e30  # a limit that is never reached

# Strength first. Speeds of friction effects are rim speeds [m/s] for the Pioneer, axis speeds otherwise.
EFFECTS: dict[str, dict[str, float]] = {
    "actuator_dead_zone": {"threshold": 0.0},  # V
    "voltage_saturation": {"limit": NONE},  # V
    "battery_sag": {"resistance": 0.0, "nominal": 12.0},  # ohm, V
    "motor_lag": {"time_constant": 0.0},  # s
    "input_delay": {"delay": 0.0},  # s
    "motor_gain_mismatch": {"mismatch": 0.0, "motor": 1.0},  # relative; number of the input column, from 1
    "motor_heating": {"coefficient": 0.0},  # relative resistance per joule dissipated in the winding
    "stribeck_friction": {"amplitude": 0.0, "speed": 0.05},  # N m or N above the Coulomb level, m/s
    "asymmetric_friction": {"asymmetry": 0.0},  # levels are C (1 +- asymmetry)
    "asymmetric_viscous_friction": {"asymmetry": 0.0},
    "sublinear_viscous_friction": {"deficit": 0.0, "speed": 0.5},  # B s (|s| / speed)^-deficit
    "cogging_torque": {"amplitude": 0.0, "periods": 6.0},  # N m (axis: N) per wheel; periods per turn (axis: per metre)
    "wheel_radius_mismatch": {"mismatch": 0.0},  # R (1 +- mismatch / 2), right and left (omni: wheels 1, 2 and 3, 4)
    "traction_limit": {"limit": NONE},  # N per wheel
    "surface_change": {
        "coulomb": 0.0,
        "viscous": 0.0,
        "angle": 0.0,
        "offset": 1.0,
    },  # relative, beyond x cos + y sin = offset
    "ground_slope": {"angle": 0.0, "direction": 0.0},  # rad, downhill direction in the world frame
    "quadratic_drag": {"coefficient": 0.0},  # N s^2/m^2
    "lateral_com_offset": {"offset": 0.0},  # m
    "coriolis_coupling": {"absent": 0.0},  # 1: the omni paper's equations without the turning frame's terms
    "sensor_bias": {"bias": 0.0, "channel": 1.0},  # number of the speed channel, from 1
    "sensor_scale": {"error": 0.0, "channel": 1.0},
    "sensor_lag": {"time_constant": 0.0},  # s
    "sensor_delay": {"delay": 0.0},  # s
    # in nobody's catalogue
    "push": {"force": 0.0, "moment": 0.0, "start": 5.0, "duration": 0.5, "every": NONE},  # N forwards, N m, s
    "collision": {"speed_loss": 0.0, "time": 6.0},  # all speeds are multiplied by 1 - speed_loss
    "payload_drop": {"mass": 0.0, "time": 8.0},  # kg lost
    "resonance": {"mass": 0.0, "frequency": 4.0, "damping": 0.05},  # kg on a spring along the forward axis, Hz, ratio
    "hysteresis": {"force": 0.0, "distance": 0.02},  # Dahl's model on the forward axis, N and m
}
NO_MOTOR = {
    "battery_sag",
    "motor_heating",
    "motor_gain_mismatch",
    "wheel_radius_mismatch",
    "lateral_com_offset",
    "coriolis_coupling",
}
NOT_FOR = {"pioneer": {"coriolis_coupling"}, "omni": set(), "axis": NO_MOTOR}

E = IntEnum(
    "E",
    "nominal sag lag heating stribeck stribeck_speed asymmetry viscous_asymmetry deficit deficit_speed cogging periods "
    "radius traction surface_coulomb surface_viscous surface_x surface_y surface_offset slope_x slope_y drag com "
    "uncoupled sensor_lag sprung_mass sprung_stiffness sprung_damping dahl_force dahl_distance",
    start=0,
)
_KERNEL = {
    "battery_sag": (E.sag, E.nominal),
    "motor_lag": (E.lag,),
    "motor_heating": (E.heating,),
    "stribeck_friction": (E.stribeck, E.stribeck_speed),
    "asymmetric_friction": (E.asymmetry,),
    "asymmetric_viscous_friction": (E.viscous_asymmetry,),
    "sublinear_viscous_friction": (E.deficit, E.deficit_speed),
    "cogging_torque": (E.cogging, E.periods),
    "wheel_radius_mismatch": (E.radius,),
    "traction_limit": (E.traction,),
    "quadratic_drag": (E.drag,),
    "lateral_com_offset": (E.com,),
    "coriolis_coupling": (E.uncoupled,),
    "sensor_lag": (E.sensor_lag,),
    "hysteresis": (E.dahl_force, E.dahl_distance),
}


def complete(effects: Mapping[str, Mapping[str, float]] | None, robot: str) -> dict[str, dict[str, float]]:
    """All effects with all parameters.

    Raises ValueError for an unknown effect or parameter, or an effect the robot cannot have.
    """
    full = {name: dict(values) for name, values in EFFECTS.items()}
    for name, values in (effects or {}).items():
        if name not in EFFECTS:
            raise ValueError(f"Unknown effect '{name}'; choose from {', '.join(EFFECTS)}.")
        if name in NOT_FOR[robot]:
            raise ValueError(f"The effect '{name}' does not apply to the robot '{robot}'; leave it out.")
        for parameter, value in values.items():
            if parameter not in EFFECTS[name]:
                raise ValueError(
                    f"The effect '{name}' has no parameter '{parameter}'; it has {', '.join(EFFECTS[name])}."
                )
            full[name][parameter] = float(value)
    return full


def kernel_vector(full: Mapping[str, Mapping[str, float]]) -> np.ndarray:
    """The vector `e` of the differential equations."""
    e = np.zeros(len(E))
    for name, places in _KERNEL.items():
        for place, value in zip(places, full[name].values(), strict=True):
            e[place] = value
    surface, slope, sprung = full["surface_change"], full["ground_slope"], full["resonance"]
    e[E.surface_coulomb], e[E.surface_viscous] = surface["coulomb"], surface["viscous"]
    e[E.surface_x], e[E.surface_y] = np.cos(surface["angle"]), np.sin(surface["angle"])
    e[E.surface_offset] = surface["offset"]
    pull = 9.81 * np.sin(slope["angle"])
    e[E.slope_x], e[E.slope_y] = pull * np.cos(slope["direction"]), pull * np.sin(slope["direction"])
    omega = 2 * np.pi * sprung["frequency"]
    e[E.sprung_mass] = sprung["mass"]
    e[E.sprung_stiffness], e[E.sprung_damping] = omega**2, 2 * sprung["damping"] * omega
    return e


def applied_voltage(inputs: np.ndarray, full: Mapping[str, Mapping[str, float]]) -> np.ndarray:
    """What the motors get of the commanded inputs (N, m): gain of one motor, supply limit, dead zone."""
    gain = full["motor_gain_mismatch"]
    u = np.array(inputs, float)
    u[:, int(gain["motor"]) - 1] *= 1 + gain["mismatch"]
    u = np.clip(u, -full["voltage_saturation"]["limit"], full["voltage_saturation"]["limit"])
    return np.sign(u) * np.maximum(np.abs(u) - full["actuator_dead_zone"]["threshold"], 0)


def measured(speeds: np.ndarray, full: Mapping[str, Mapping[str, float]]) -> np.ndarray:
    """Static sensor errors on the speeds (N, n_v)."""
    out = np.array(speeds, float)
    out[:, int(full["sensor_scale"]["channel"]) - 1] *= 1 + full["sensor_scale"]["error"]
    out[:, int(full["sensor_bias"]["channel"]) - 1] += full["sensor_bias"]["bias"]
    return out


@njit
def friction_level(coulomb, amplitude, s, sign, surface, e):
    """Coulomb level [the unit of `coulomb`] for sliding in direction `sign` at speed s."""
    rise = amplitude * np.exp(-((s / e[E.stribeck_speed]) ** 2)) if amplitude != 0.0 else 0.0
    return max(0.0, (coulomb * (1 + sign * e[E.asymmetry]) + rise) * (1 + surface * e[E.surface_coulomb]))


@njit
def viscous(coefficient, rate, s, surface, e):
    """Viscous friction at the rate of the axis [rad/s or m/s], whose speed is s [m/s]."""
    force = coefficient * rate * (1 + surface * e[E.surface_viscous])
    if s > 0:
        force *= 1 + e[E.viscous_asymmetry]
    elif s < 0:
        force *= 1 - e[E.viscous_asymmetry]
    if e[E.deficit] != 0.0 and s != 0.0:
        force *= (abs(s) / e[E.deficit_speed]) ** -e[E.deficit]
    return force


@njit
def beyond(x, y, e):
    """1 on the other surface, 0 on the first."""
    return 1.0 if x * e[E.surface_x] + y * e[E.surface_y] > e[E.surface_offset] else 0.0


@njit
def attached(v, x, xdot, place, e):
    """Forward force on the body from a sprung mass and from Dahl's hysteresis, whose states are x[place:place + 3]."""
    stretch, speed, bend = x[place], x[place + 1], x[place + 2]
    acceleration = e[E.sprung_damping] * (speed - v) + e[E.sprung_stiffness] * stretch
    xdot[place] = speed - v
    xdot[place + 1] = -acceleration
    xdot[place + 2] = (v - abs(v) * bend) / e[E.dahl_distance]
    return e[E.sprung_mass] * acceleration - e[E.dahl_force] * bend


@njit
def supply(command, emf, resistance, n, e, voltage):
    """Voltages of n motors on a sagging supply: ideal choppers of duty command / nominal, inner resistance e[E.sag]."""
    for i in range(n):
        voltage[i] = command[i]
    if e[E.sag] == 0.0:
        return
    above, below = e[E.nominal], 1.0
    for i in range(n):
        duty = command[i] / e[E.nominal]
        above += e[E.sag] * duty * emf[i] / resistance[i]
        below += e[E.sag] * duty * duty / resistance[i]
    for i in range(n):
        voltage[i] = command[i] / e[E.nominal] * above / below
