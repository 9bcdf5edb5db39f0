"""One hidden case: six logs to fit and three held out, with physical constants, noise, excitation and effect drawn from a seed.

Whoever explains the case sees the CSV files and the nominal model (`model.toml`: the known constants, and the published
values as starts for the unknown ones), nothing else.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import jaxid
from jaxid.model_file import write_model
from reference import excitation
from reference.axis import AXIS
from reference.effects import EFFECTS
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER

SAMPLING, SAMPLES = 0.02, 1251
REFERENCE = {"pioneer": PIONEER, "omni": OMNI, "axis": AXIS}
MODEL = {"pioneer": jaxid.Pioneer, "omni": jaxid.Omni, "axis": jaxid.Axis}
NOISE = {"pioneer": (0.01, 0.02), "omni": (0.01, 0.01, 0.02), "axis": (0.01,)}
"""Standard deviations at the nominal noise level [m/s, rad/s]."""
AXIS_NAMES = {"J": "M", "Cv": "Fv", "Cs": "Fc", "k": "gain"}
"""The simulator's names of the axis's constants that differ from the model's."""
LARGEST_INPUT = {"pioneer": 10.0, "omni": 12.0, "axis": 4.0}
"""About the largest input of the experiments; a supply limit of strength s lies at 1 - s of it [V]."""
UNKNOWN = {
    "pioneer": ("I0", "Ir1", "Ir", "Ip1", "Cs1", "Cv1", "Cs", "Cv"),
    "omni": ("J", "Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw"),
    "axis": ("J", "Cv", "Cs"),
}
"""Constants that a case draws anew and the model has to find."""
KNOWN = {"pioneer": ("M", "ym", "Ra"), "omni": ("M", "Ra"), "axis": ()}
"""Constants that a case draws anew and its nominal model tells."""
FIT = ("prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "crawl")
CHECK = ("prbs_reversing", "arcs", "crawl")
STRENGTHS = {"weak": 1.5, "medium": 3.0, "strong": 8.0}
"""RMS on held-out logs in units of the noise once the baseline has absorbed what it can."""

OUTSIDE = ("push", "collision", "payload_drop", "resonance", "hysteresis")
"""Effects that no catalogue holds."""


@dataclass(frozen=True)
class Case:
    """`effects` is {} for a complete model; `tables` are the logs by file stem, `truth` the constants behind them."""

    robot: str
    seed: int
    effects: dict[str, dict[str, float]]
    noise: tuple[float, ...]
    truth: dict[str, float]
    nominal: dict[str, float]
    tables: dict[str, pd.DataFrame]

    def write(self, folder: Path) -> tuple[list[Path], list[Path], Path]:
        """The CSV files to fit and to hold out and the nominal model; the truth goes into `truth.json` beside them."""
        folder.mkdir(parents=True, exist_ok=True)
        for stem, table in self.tables.items():
            table.to_csv(folder / f"{stem}.csv", index=False, float_format="%.6g")
        model = folder / "nominal.toml"
        write_model(model, MODEL[self.robot]().with_values(**self.nominal))
        truth = {"robot": self.robot, "effects": self.effects, "parameters": self.truth, "noise": self.noise}
        (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
        return sorted(folder.glob("fit_*.csv")), sorted(folder.glob("check_*.csv")), model


def effect(robot: str, identifier: str, size: float, rng: np.random.Generator) -> dict[str, float]:
    """The parameters of an effect of strength `size` in the reference's terms; what is not strength is drawn from `rng`."""
    sign = float(rng.choice([-1.0, 1.0]))
    speed, inputs = float(rng.uniform(0.03, 0.1)), len(MODEL[robot]().channels.inputs)
    outputs = len(NOISE[robot])
    direction = float(rng.uniform(-np.pi, np.pi))
    channel, motor = float(rng.integers(outputs) + 1), float(rng.integers(inputs) + 1)
    periods = float(rng.integers(3, 13))
    match identifier:
        case "voltage_saturation":
            return {"limit": (1.0 - size) * LARGEST_INPUT[robot]}
        case "traction_limit":
            return {"limit": 1.0 / size}
        case "battery_sag":
            return {"resistance": size, "nominal": 12.0 if robot == "pioneer" else 24.0}
        case "motor_gain_mismatch":
            return {"mismatch": sign * size, "motor": motor}
        case "stribeck_friction":
            return {"amplitude": size, "speed": speed}
        case "asymmetric_friction" | "asymmetric_viscous_friction":
            return {"asymmetry": sign * size}
        case "sublinear_viscous_friction":
            return {"deficit": size}
        case "cogging_torque":
            return {"amplitude": size, "periods": periods}
        case "wheel_radius_mismatch":
            return {"mismatch": sign * size}
        case "surface_change":
            # A line through the places that robots starting at the origin reach.
            return {"coulomb": size, "viscous": size, "angle": direction, "offset": float(rng.uniform(0.2, 1.2))}
        case "ground_slope":
            return {"angle": size, "direction": direction}
        case "lateral_com_offset":
            return {"offset": sign * size}
        case "sensor_bias":
            return {"bias": sign * size, "channel": channel}
        case "sensor_scale":
            # On the Pioneer both channels follow from the wheels; a scale shows on either.
            return {"error": sign * size, "channel": channel}
        case "coriolis_coupling":
            return {"absent": 0.0}
        case "push":
            return {
                "force": sign * size,
                "moment": 0.0,
                "start": float(rng.uniform(3, 8)),
                "duration": 0.4,
                "every": 7.0,
            }
        case "collision":
            return {"speed_loss": min(size, 1.0), "time": float(rng.uniform(4, 12))}
        case "payload_drop":
            return {"mass": size, "time": float(rng.uniform(6, 16))}
        case "resonance":
            return {"mass": size, "frequency": float(rng.uniform(2, 5)), "damping": 0.05}
        case "hysteresis":
            return {"force": size, "distance": float(rng.uniform(0.05, 0.15))}
    return {next(iter(EFFECTS[identifier])): size}


def make(
    robot: str, effects: Mapping[str, float], seed: int, *, noise_level: float | None = None, spread: float = 0.15
) -> Case:
    """Simulate a case. `effects` are {id: size}; `spread` is the relative spread of the physical constants."""
    rng = np.random.default_rng([seed, 20])
    reference = REFERENCE[robot]
    if robot == "axis":
        reference = reference.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
    drawn = {
        name: reference.parameters[name] * float(1 + rng.uniform(-spread, spread))
        for name in (*UNKNOWN[robot], *KNOWN[robot])
    }
    level = float(rng.uniform(0.6, 1.4)) if noise_level is None else noise_level
    reference = reference.with_parameters(**drawn)
    hidden = {name: effect(robot, name, size, rng) for name, size in effects.items()}
    noise = tuple(level * sigma for sigma in NOISE[robot])
    tables = {}
    kinds = [("fit", kind) for kind in FIT] + [("check", kind) for kind in CHECK]
    for number, (role, kind) in enumerate(kinds):
        inputs = excitation.experiment(robot, kind, SAMPLES, 1000 * seed + number)
        table = simulate_log(
            reference, inputs, SAMPLING, noise, 1000 * seed + 500 + number, effects=hidden, rtol=1e-7, atol=1e-9
        )
        tables[f"{role}_{kind}"] = table.drop(columns="q", errors="ignore")
    names = AXIS_NAMES if robot == "axis" else {}
    nominal = {names.get(name, name): reference.parameters[name] for name in KNOWN[robot]}
    if "coriolis_coupling" in effects:
        nominal["coriolis"] = 0.0  # the paper's equations; the data has the turning frame's terms
    if robot == "axis":
        nominal |= {"gain": 10.0, "M": 20.0, "Fv": 30.0, "Fc": 8.0}
    truth = {names.get(name, name): float(value) for name, value in reference.parameters.items() if abs(value) < 1e29}
    return Case(robot, seed, hidden, noise, truth, nominal, tables)
