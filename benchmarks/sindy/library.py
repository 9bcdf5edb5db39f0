"""The library that SINDy chooses from.

A library somebody who knows wheeled robots would write: constants, speeds, inputs, their products, and for every kind of
physics that a function of speeds, inputs, pose, wheel angles and time can express, that function (friction that depends
on speed or direction, dead zone and limits at a few levels, sag, ripple with the wheel's angle, slope, floor). Grids
stand in for constants inside functions, which a linear regression cannot find. `readings` says what a term means.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxid.robots.pioneer_closed_form import reduced_inertia

Scalar = Any

SMALL = 0.01
"""Speed [m/s, rad/s] over which the library's sign function is smooth: noise has no direction."""
LARGEST_INPUT = {"pioneer": 10.0, "omni": 12.0, "axis": 4.0}
"""About the largest input of the experiments [V]; limits and dead zones of the library lie at fractions of it."""
FRACTIONS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8)
STRIBECK_SPEEDS = (0.04, 0.08)
LARGEST_DRIVE_FORCE = {"pioneer": 80.0, "omni": 120.0}
"""About the largest drive force of a wheel in the experiments [N]."""
PERIODS = tuple(range(1, 13))
"""Periods of ripple per radian of a wheel, or per metre of an axis."""


@dataclass(frozen=True)
class Term:
    """A function of state and input.

    `own`: equations in which it is a constant of the model and names nothing itself. `motion`: the equation whose motion
    a law of wheels drives. `level`: where a clipped signal is clipped. `rubs`: for a term that is dry friction, what a
    coefficient of -1 in an equation adds to the Coulomb level of a rubbing axis, (law, equation, axis, level). It is
    simulated as such: a level decides what sticks, and an acceleration that vanishes at rest does not.
    """

    kind: str
    value: Scalar
    own: tuple[str, ...] = ()
    motion: str = ""
    level: float = 0.0
    rubs: tuple[tuple[str, str, int, Scalar], ...] = ()


def sign(s: Scalar) -> Scalar:
    """Smooth sign."""
    return s / jnp.sqrt(s * s + SMALL**2)


def _friction(s: Scalar) -> dict[str, tuple[str, Scalar]]:
    """Laws of one rubbing speed in m/s, besides the model's own: label -> (kind, value)."""
    laws = {
        "|s|": ("abs", jnp.abs(s)),
        "s|s|": ("odd square", s * jnp.abs(s)),
        "sgn(s) sqrt|s|": ("root", sign(s) * jnp.sqrt(jnp.abs(s) + 1e-12)),
    }
    return laws


def _levels(s: Scalar, state: Mapping[str, Scalar]) -> dict[str, tuple[str, Scalar]]:
    """Factors of the sign of one rubbing speed in m/s: label -> (kind, factor)."""
    levels = {"sgn(s)": ("sign", 1.0 + 0.0 * s)}
    for speed in STRIBECK_SPEEDS:
        levels[f"sgn(s) exp(-(s/{speed})²)"] = ("Stribeck", jnp.exp(-((s / speed) ** 2)))
    for place in ("x", "y", "q"):
        if place in state:
            levels[f"{place} sgn(s)"] = ("place", state[place] + 0.0 * s)
    return levels


def _inputs(u: Scalar, largest: float) -> dict[str, tuple[str, Scalar]]:
    """Static actuator curves of one input."""
    return {f"clip(u, {f * largest:g})": ("clip", jnp.clip(u, -f * largest, f * largest)) for f in FRACTIONS}


def _drive(force: Scalar, largest: float) -> dict[str, tuple[str, Scalar]]:
    """Limits of one wheel's drive force."""
    return {
        f"clip(f, {c * largest:g})": ("drive clip", jnp.clip(force, -c * largest, c * largest)) for c in (0.2, 0.4, 0.7)
    }


def _level(label: str) -> float:
    """The level in the label of a clipped signal, 0 for others."""
    return float(label.split(", ")[1].rstrip(")")) if label.startswith("clip(") else 0.0


def _mixed(each: list[dict[str, tuple[str, Scalar]]], mixes: Mapping[str, tuple[float, ...]]) -> dict[str, Term]:
    """Laws of single wheels summed over the wheels with the signs of each motion."""
    return {
        f"{label} {motion}": Term(
            each[0][label][0],
            sum(w * wheel[label][1] for w, wheel in zip(weights, each, strict=True) if w),
            motion=motion,
            level=_level(label),
        )
        for label in each[0]
        for motion, weights in mixes.items()
    }


def _ripple(angle: Scalar, label: str, unit: float = 1.0) -> dict[str, Term]:
    terms = {}
    for n in PERIODS:
        terms[f"sin({n} {label})"] = Term("ripple", jnp.sin(n * unit * angle))
        terms[f"cos({n} {label})"] = Term("ripple", jnp.cos(n * unit * angle))
    return terms


def axis_terms(state, inputs, p) -> dict[str, Term]:
    """Library of the drive axis."""
    v, (u,), own = state["v"], inputs, ("v",)
    one = 1.0 + 0.0 * v
    terms = {
        "1": Term("constant", one, own),
        "v": Term("speed", v, own),
        "u": Term("input", u, own),
        "v²": Term("polynomial", v * v),
        "v³": Term("polynomial", v**3),
        "u v": Term("polynomial", u * v),
        "u²": Term("polynomial", u * u),
        "t u": Term("heat", state["clock"] * u),
        "q v": Term("place", state["q"] * v),
    }
    for label, (kind, value) in (_friction(v) | _inputs(u, LARGEST_INPUT["axis"])).items():
        terms[label] = Term(kind, value, motion="v", level=_level(label))
    for label, (kind, level) in _levels(v, state).items():
        terms[label] = Term(
            kind, level * sign(v), own if kind == "sign" else (), "v", rubs=((label, "v", 0, p["M"] * level),)
        )
    return terms | _ripple(state["q"], "2π q", 2 * np.pi)


def pioneer_terms(state, inputs, p) -> dict[str, Term]:
    """Library of the Pioneer: right and left wheel's laws, summed (forward) and subtracted (yaw)."""
    eta1, eta2 = state["eta1"], state["eta2"]
    rims = (eta1 + p["L"] * eta2, eta1 - p["L"] * eta2)
    torque = p["tr"] * p["mu"] * p["KT"] / p["Ra"] / p["R"]
    forces = [torque * (u - p["KE"] * p["tr"] * s / p["R"]) for u, s in zip(inputs, rims, strict=True)]
    squares = inputs[0] ** 2 + inputs[1] ** 2
    mixes = {"eta1": (1.0, 1.0), "eta2": (1.0, -1.0)}  # right and left wheel summed, and right minus left
    J11, _, J22 = reduced_inertia(1.0, 0.0, p)  # with the caster trailing
    terms = {"1": Term("constant", 1.0 + 0.0 * eta1)}
    for motion, (a, b) in mixes.items():
        own = (motion,)
        u = a * inputs[0] + b * inputs[1]
        terms[f"V {motion}"] = Term("input", u, own)
        terms[f"V ΣV² {motion}"] = Term("sag", u * squares)
        terms[f"t V {motion}"] = Term("heat", state["clock"] * u)
        right, left = (_levels(rim, state) for rim in rims)
        # A level C of both wheels decelerates by C (sgn s2 + sgn s3) / (R J11) and C L (sgn s2 - sgn s3) / (R J22).
        lever = J11 * p["R"] if motion == "eta1" else J22 * p["R"] / p["L"]
        for label, (kind, level) in right.items():
            other = left[label][1]
            rubs = ((label, own[0], 0, lever * level), (label, own[0], 1, lever * other))
            value = a * sign(rims[0]) * level + b * sign(rims[1]) * other
            terms[f"{label} {motion}"] = Term(kind, value, own if kind == "sign" else (), own[0], rubs=rubs)
    terms |= {
        "eta1": Term("speed", eta1, ("eta1",)),
        "eta2": Term("speed", eta2, ("eta2",)),
        "x eta1": Term("place", state["x"] * eta1),
        "y eta1": Term("place", state["y"] * eta1),
        "eta1²": Term("polynomial", eta1 * eta1),
        "eta1 eta2": Term("polynomial", eta1 * eta2),
        "eta2²": Term("centrifugal", eta2 * eta2),
        "sin(theta)": Term("heading", jnp.sin(state["theta"])),
        "cos(theta)": Term("heading", jnp.cos(state["theta"])),
    }
    wheels = [
        _friction(s) | _inputs(u, LARGEST_INPUT["pioneer"]) | _drive(f, LARGEST_DRIVE_FORCE["pioneer"])
        for s, u, f in zip(rims, inputs, forces, strict=True)
    ]
    terms |= _mixed(wheels, mixes) | {"eta1|eta1|": Term("odd square", eta1 * jnp.abs(eta1))}
    return terms | _ripple(state["phi2"], "phi2") | _ripple(state["phi3"], "phi3")


def omni_terms(state, inputs, p) -> dict[str, Term]:
    """Library of the omni: wheel laws mixed into the three motions, friction laws of the motions themselves."""
    V, Vn, W = (state[name] for name in ("V", "Vn", "W"))
    spin = p["b"] * W
    rims = (Vn + spin, -V + spin, -Vn + spin, V + spin)
    forces = [
        p["l"] * p["Kt"] / p["r"] / p["Ra"] * (u - p["Kv"] * p["l"] * s / p["r"])
        for u, s in zip(inputs, rims, strict=True)
    ]
    squares = sum(u * u for u in inputs)
    motions = {"V": (0.0, -1.0, 0.0, 1.0), "Vn": (1.0, 0.0, -1.0, 0.0), "W": (1.0, 1.0, 1.0, 1.0)}
    uneven = {"1+3": (1.0, 0.0, 1.0, 0.0), "2+4": (0.0, 1.0, 0.0, 1.0)}
    pace = jnp.sqrt(V * V + Vn * Vn + 1e-12)
    terms = {"1": Term("constant", 1.0 + 0.0 * V)}
    for motion, weights in (motions | uneven).items():
        u = sum(w * own for w, own in zip(weights, inputs, strict=True))
        terms[f"u {motion}"] = Term("input", u, (motion,) if motion in motions else ())
        if motion in motions:
            terms[f"u Σu² {motion}"] = Term("sag", u * squares)
            terms[f"t u {motion}"] = Term("heat", state["clock"] * u)
    for name, speed in (("V", V), ("Vn", Vn), ("W", W)):
        rim = spin if name == "W" else speed
        terms[name] = Term("speed", speed, (name,))
        for place in ("x", "y"):
            terms[f"{place} {name}"] = Term("place", state[place] * speed)
        inertia, axis = p["J" if name == "W" else "M"], ("V", "Vn", "W").index(name)
        for label, (kind, level) in _levels(rim, state).items():
            own = (name,) if kind == "sign" else ()
            terms[f"{label}, s = {name}"] = Term(
                kind, level * sign(rim), own, name, rubs=((label, name, axis, inertia * level),)
            )
        for label, (kind, value) in _friction(rim).items():
            terms[f"{label}, s = {name}"] = Term(kind, value)
    terms |= {
        "V sqrt(V² + Vn²)": Term("odd square", V * pace),
        "Vn sqrt(V² + Vn²)": Term("odd square", Vn * pace),
        "W V": Term("Coriolis", W * V),
        "W Vn": Term("Coriolis", W * Vn),
        "W²": Term("centrifugal", W * W),
        "V Vn": Term("polynomial", V * Vn),
        "sin(theta)": Term("heading", jnp.sin(state["theta"])),
        "cos(theta)": Term("heading", jnp.cos(state["theta"])),
    }
    wheels = [
        _inputs(u, LARGEST_INPUT["omni"]) | _drive(f, LARGEST_DRIVE_FORCE["omni"])
        for u, f in zip(inputs, forces, strict=True)
    ]
    terms |= _mixed(wheels, motions)
    for wheel in range(1, 5):
        terms |= _ripple(state[f"phi{wheel}"], f"phi{wheel}")
    return terms


TERMS = {"axis": axis_terms, "pioneer": pioneer_terms, "omni": omni_terms}
