"""A robot on four mecanum wheels for the pictures of what resists it sideways."""

from collections.abc import Callable

from jaxid import Channels, Custom, DriveAxis, Parameter

_WHEELS = {"front_left": (-1, -1), "front_right": (1, 1), "rear_left": (1, -1), "rear_right": (-1, 1)}
"""What each wheel's rim moves by, a unit of motion to the left and one of turning to the left."""


def _rim(wheel: str) -> Callable:
    left, turn = _WHEELS[wheel]
    return lambda state, p: state["vx"] + left * state["vy"] + turn * p["a"] * state["w"]


def _force(wheel: str) -> Callable:
    return lambda state, u, p: p["gain"] * (u[f"u_{wheel}"] - p["back_emf"] * _rim(wheel)(state, p))


def _rates(state, u, p, friction):
    ahead, left, turning = 0.0, 0.0, 0.0
    for wheel, (to_left, turn) in _WHEELS.items():
        force = _force(wheel)(state, u, p) - p["Fv"] * _rim(wheel)(state, p) - friction[wheel]
        ahead, left, turning = ahead + force, left + to_left * force, turning + turn * p["a"] * force
    return {
        "vx": ahead / p["M"] + state["w"] * state["vy"],
        "vy": left / p["M"] - state["w"] * state["vx"],
        "w": turning / p["J"],
    }


MECANUM = Custom(
    dynamics=_rates,
    state_names=("vx", "vy", "w"),
    own_channels=Channels(
        inputs=tuple(f"u_{wheel}" for wheel in _WHEELS),
        outputs=("vx", "vy", "w"),
        units={**{f"u_{wheel}": "V" for wheel in _WHEELS}, "vx": "m/s", "vy": "m/s", "w": "rad/s"},
    ),
    axes={wheel: DriveAxis(speed=_rim(wheel), coulomb="Fc", viscous="Fv", torque=_force(wheel)) for wheel in _WHEELS},
    forces={"vx": "M", "vy": "M", "w": "J"},
    turning="w",
    table={
        "M": Parameter(12.0, "kg", free=True),
        "J": Parameter(0.5, "kg m^2", free=True),
        "Fv": Parameter(1.0, "N s/m", free=True),
        "Fc": Parameter(0.5, "N", free=True),
        "a": Parameter(0.4, "m", meaning="half the wheelbase and half the track"),
        "gain": Parameter(1.0, "N/V"),
        "back_emf": Parameter(6.0, "V s/m"),
    },
    title="mecanum",
)
