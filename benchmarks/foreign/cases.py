"""What is hidden in MuJoCo's logs, and what would be a right answer."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import jaxid
from benchmarks.hidden.cases import CHECK, FIT, KNOWN, NOISE, SAMPLES, UNKNOWN
from jaxid.model_file import write_model
from reference import excitation

from .pioneer_mjcf import World
from .simulate import drive, log_table
from .uneven_friction import UnevenFriction

LEVEL = 5.0
"""About the largest voltage [V]: at 8 V the wheels slip at reversals even on the floor of `FIRM`."""
SPREAD = 0.15
"""Relative spread of the constants, drawn anew for every case."""
SLIPS = 0.01
"""Slip [m/s] that counts: the noise of the forward speed."""
FIRM: dict[str, Any] = {"grip": 3.0, "height": -0.04}
"""A floor on which next to nothing slips and a low body: what jaxid's equations take for granted."""


@dataclass(frozen=True)
class Case:
    """`world` and `delay` [s] are what is hidden; `answer` the catalogue's name for it, None where it has none.

    `true` holds the hidden size in the named effect's own parameter. `told` says what was hidden in words. `effects` are
    candidates beside the catalogue's.
    """

    name: str
    told: str
    seed: int
    answer: str | None
    world: World = field(default_factory=lambda: World(**FIRM))
    delay: float = 0.0
    true: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[jaxid.Effect, ...] = ()


def _case(
    name: str, told: str, seed: int, answer: str | None, true: Mapping[str, float] | None = None, **hidden
) -> Case:
    delay, effects = hidden.pop("delay", 0.0), hidden.pop("effects", ())
    return Case(name, told, seed, answer, World(**(FIRM | hidden)), delay, true or {}, effects)


CASES = (
    _case("nothing", "nothing", 7000, None),
    _case("nothing_2", "nothing, other constants", 7008, None),
    _case("nothing_3", "nothing, other constants", 7009, None),
    _case(
        "tilted_floor", "floor tilted by 1.4 degrees", 7001, "ground_slope",
        {"slope_x": 0.015, "slope_y": -0.02}, slope_x=0.015, slope_y=-0.02,
    ),
    _case("shifted_mass", "centre of mass 15 mm to the right", 7002, "lateral_com_offset", {"xm": 0.015}, shift=0.015),
    _case("friction_loss", "0.06 N m more dry friction in the right wheel's joint", 7003, None, extra_loss=0.06),
    _case(
        "friction_loss_own_effect", "the same, and `explain` is given a user's effect for it", 7003, "uneven_friction",
        {"difference": 0.06}, extra_loss=0.06, effects=(UnevenFriction(),),
    ),
    _case("delayed_actuator", "motors get their voltage 25 ms late", 7004, "input_delay", {"delay": 0.025}, delay=0.025),
    _case("slip", "wheels slip: contact friction 0.8 in place of 3", 7005, None, grip=0.8),
    _case("scrub", "tyres resist turning on the spot: torsional friction 5 mm", 7006, None, torsion=0.005),
    _case("soft_contact", "soft contacts: time constant 40 ms in place of 2 ms", 7007, None, contact_time=0.04),
)  # fmt: skip


def constants(seed: int) -> dict[str, float]:
    """The robot's constants: the papers', those that a fit finds or a model file tells drawn within `SPREAD`."""
    table = jaxid.Pioneer().parameters
    values = {name: float(value) for name, value in table.numbers.items()}
    rng = np.random.default_rng([seed, 20])
    for name in (*UNKNOWN["pioneer"], *KNOWN["pioneer"]):
        values[name] *= float(1 + rng.uniform(-SPREAD, SPREAD))
    return values


@dataclass(frozen=True)
class Written:
    """Files to fit and held out, the nominal model's, the wheels' `largest_slip` [m/s] and `slipping`, the share of
    samples at which one slips by more than `SLIPS`."""

    fit: list[Path]
    held_out: list[Path]
    model: Path
    largest_slip: float
    slipping: float


def write(case: Case, folder: Path) -> Written:
    """Drive, and write six logs to fit, three held out and the nominal model into `folder`."""
    p = constants(case.seed)
    files: dict[str, list[Path]] = {"fit": [], "check": []}
    slips = []
    for number, (role, kind) in enumerate([*(("fit", k) for k in FIT), *(("check", k) for k in CHECK)]):
        voltages = excitation.experiment("pioneer", kind, SAMPLES, 1000 * case.seed + number, LEVEL)
        motion = drive(p, voltages, case.world, case.delay)
        slips.append(np.abs(motion.slip).max(axis=1))
        sigma = NOISE["pioneer"]
        table = log_table(voltages, motion, (sigma[0], sigma[1]), 1000 * case.seed + 500 + number)
        files[role].append(folder / f"{role}_{kind}.csv")
        table.to_csv(files[role][-1], index=False, float_format="%.6g")
    model = folder / "nominal.toml"
    write_model(model, jaxid.Pioneer().with_values(**{name: p[name] for name in KNOWN["pioneer"]}))
    slip = np.concatenate(slips)
    return Written(files["fit"], files["check"], model, float(slip.max()), float(np.mean(slip > SLIPS)))
