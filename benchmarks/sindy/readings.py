"""What the surviving terms of SINDy's library are read as: one table from the kind of a term to effects."""

from collections.abc import Mapping
from dataclasses import dataclass

from .library import Term


@dataclass(frozen=True)
class Reading:
    """What a surviving term is read as: effects that have this form, by the sign of its coefficient where that tells."""

    effects: tuple[str, ...]
    reason: str
    if_negative: tuple[str, ...] | None = None


CROSS = ("motor_gain_mismatch", "wheel_radius_mismatch", "lateral_com_offset")
READINGS = {
    "constant": Reading(
        ("sensor_bias", "asymmetric_friction"),
        "a sensor's offset shifts viscous friction by a constant; Coulomb levels that differ by direction are sign + constant",
    ),
    "speed": Reading((), "viscous friction: a constant of the model"),
    "sign": Reading((), "Coulomb friction: a constant of the model"),
    "input": Reading((), "gain: a constant of the model; a wrong scale of a sensor looks the same"),
    "cross": Reading(CROSS, "a motion driven by another motion's input, speed or friction: the sides differ"),
    "abs": Reading(("asymmetric_viscous_friction",), "B (1 + a sgn s) s = B s + a B |s|"),
    "odd square": Reading(("quadratic_drag",), "v |v| is the drag itself"),
    "Stribeck": Reading(("stribeck_friction",), "sgn s exp(-(s/vs)²) is the effect itself at two speeds vs"),
    "root": Reading(("sublinear_viscous_friction",), "sgn s sqrt |s| grows slower than s"),
    "clip": Reading(
        ("voltage_saturation", "traction_limit"),
        "clip(u, c) added to a smaller gain saturates; taken away, it is a dead zone c",
        ("actuator_dead_zone",),
    ),
    "drive clip": Reading(("traction_limit",), "clip(force, c) added to a smaller gain is a limit", ()),
    "sag": Reading(("battery_sag",), "input times the sum of squared inputs: what a supply's resistance takes away"),
    "heat": Reading(("motor_heating",), "a gain that changes with time since the start"),
    "heading": Reading(("ground_slope",), "sine and cosine of the heading: a constant force in the world"),
    "place": Reading(("surface_change",), "friction that changes with x or y, the linear stand-in for an edge"),
    "ripple": Reading(("cogging_torque",), "sine and cosine of n times the wheel's angle"),
    "Coriolis": Reading(
        ("coriolis_coupling", "lateral_com_offset", "sensor_scale"),
        "products of yaw rate and speed: the turning frame's, also of a centre of mass beside it or a wrong scale",
    ),
    "centrifugal": Reading(("lateral_com_offset",), "square of the yaw rate"),
    "polynomial": Reading((), "a power or product without a name in the vocabulary; neither right nor wrong"),
}
"""Generous: a term names every effect that has its form, and an answer counts if the hidden one is among them."""


def read(term: Term, equation: str, coefficient: float) -> tuple[str, ...]:
    """Effects that a term with this coefficient in this equation is read as."""
    kind = term.kind
    linear = kind in ("input", "speed", "sign") and equation not in term.own
    if linear or (kind in ("clip", "drive clip") and equation != term.motion):
        kind = "cross"
    reading = READINGS[kind]
    return reading.if_negative if coefficient < 0 and reading.if_negative is not None else reading.effects


def read_all(terms: Mapping[str, Term], found: Mapping[tuple[str, str], float]) -> dict[tuple[str, str], list[str]]:
    """What all surviving terms {(equation, label): coefficient} are read as.

    Clipped inputs of one motion are one curve, put together from the levels that the library has: the level that counts
    most gives it its name, the others none.
    """
    weight = {key: abs(value) * terms[key[1]].level for key, value in found.items()}
    read_as = {}
    for key, value in found.items():
        term = terms[key[1]]
        curve = [
            weight[other]
            for other in found
            if other[0] == key[0] and (terms[other[1]].kind, terms[other[1]].motion) == (term.kind, term.motion)
        ]
        silent = term.kind in ("clip", "drive clip") and weight[key] < max(curve)
        read_as[key] = [] if silent else list(read(term, key[0], value))
    return read_as
