"""Writes the demonstration logs: `python -m reference.demo OUTDIR`.

OUTDIR gets README.md and the folders pioneer, omni, pioneer_paper and omni_paper, each with its logs and truth.toml,
and the folder unknown, whose truth is in do_not_look_yet.toml.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from reference import excitation
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER
from reference.velocity_control import controlled_log

SAMPLING = 0.02
PIONEER_NOISE = (0.01, 0.02)  # m/s, rad/s
OMNI_NOISE = (0.01, 0.01, 0.02)  # m/s, m/s, rad/s
CURRENT_NOISE = 0.05  # A
THETA_NOISE = 0.01  # rad
GRAVITY, DISC_RADIUS = 9.8, 0.25  # m/s^2, m: section 3.3 of the omni paper

README = """# Demonstration logs

Written by `python -m reference.demo jaxid/demo_logs` in a checkout, with an independent simulator whose dry friction
really sticks (folder `reference/`). The constants behind each folder's logs are in its `truth.toml`. All logs are
sampled at 50 Hz; row k holds what was measured at t_k and the input applied from t_k to t_(k+1). Runs start at rest
at the origin. Noise is white and Gaussian, drawn from `numpy.random.default_rng(seed)`; the seed of a log is given
below.

- `pioneer`: six logs `fit_*` and three `check_*` of 25 s; columns t, V2, V3, eta1, eta2; noise 0.01 m/s and 0.02
  rad/s. Each starts with 1.2 s straight ahead, so that the caster trails. The centre of mass is 7 cm behind the
  wheels' axle and the model is coupled.
- `omni`: six logs `fit_*` and two `check_*` of 20 s; columns t, u1 ... u4, V, Vn, W, i1 ... i4; noise 0.01 m/s, 0.01
  m/s, 0.02 rad/s, 0.05 A. A current is the one just after t_k, with row k's voltage applied. Geometry and motors are
  this package's assumed constants.
- `pioneer_paper`: the experiments of Innocenti et al.: `straight_*` (V2 = V3), `spot_*` (V2 = -V3, the caster starts
  at about -99.6 degrees, where d + l1 cos(beta) = 0) and `validation_step` (forwards, then backwards). The robot is
  the coupled one: in the spot experiments the centre of mass pulls it backwards, so eta1 is not zero there.
- `omni_paper`: the experiments of Conceicao, Moreira & Costa, driven by an assumed velocity controller (one PI for
  each axis, duties within +-255, 24 V at 255, a driver that keeps every motor within 6 A, encoders with noise of their
  own): `steady_*` (method 1: one speed commanded for 5 s), `coast_*` (method 2: the motors are disconnected at 2 s,
  then currents and forces are zero; the u columns show 0 there), `control_*` (figures 10-12: one speed commanded from
  rest; no method uses them) and `hanging_*` (method 3; columns t, theta, mass; theta starts at 1 rad with no speed; torque
  = mass * 9.8 m/s^2 * 0.25 m, noise 0.01 rad). As in the paper, the falling mass's own inertia (mass * 0.25^2, 2.3 %
  of J at 0.51 kg) is left out.
- `unknown`: six logs `fit_*` and three `check_*` of 15 s of a robot that is a Pioneer as far as its maker's data sheet
  goes; columns and noise as in `pioneer`. Something about it is not in the data sheet. `notebooks/explain.ipynb` finds
  out what; the answer is in `do_not_look_yet.toml`.

| log | seed |
| --- | --- |
"""


FORMATS = {"t": "%.2f", "mass": "%.3f", **dict.fromkeys(("V2", "V3", "u1", "u2", "u3", "u4"), "%.5g")}


def _write(table: pd.DataFrame, path: Path) -> None:
    columns = {
        str(name): [FORMATS.get(str(name), "%.4f") % value for value in column] for name, column in table.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(columns).replace({"-0.0000": "0.0000", "-0": "0"}).to_csv(path, index=False, lineterminator="\n")


def _write_truth(folder: Path, parameters: dict[str, float], comment: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"# {comment}", *(f"{name} = {value!r}" for name, value in parameters.items() if abs(value) < 1e29)]
    (folder / "truth.toml").write_text("\n".join(lines) + "\n")


def pioneer_logs() -> dict[str, tuple[pd.DataFrame, int]]:
    """{file stem: (log, seed)} of the coupled Pioneer."""
    plan = [("fit", kind) for kind in ("prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "crawl")]
    plan += [("check", kind) for kind in ("prbs_reversing", "arcs", "crawl")]
    return {
        f"{role}_{kind}": (
            simulate_log(PIONEER, excitation.experiment("pioneer", kind, 1251, seed), SAMPLING, PIONEER_NOISE, seed),
            seed,
        )
        for seed, (role, kind) in enumerate(plan, start=101)
    }


def omni_logs() -> dict[str, tuple[pd.DataFrame, int]]:
    """{file stem: (log, seed)} of the coupled omni."""
    plan = [("fit", kind) for kind in ("prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "crawl")]
    plan += [("check", kind) for kind in ("prbs_reversing", "multilevel")]
    out = {}
    for seed, (role, kind) in enumerate(plan, start=201):
        inputs = excitation.experiment("omni", kind, 1001, seed)
        out[f"{role}_{kind}"] = (
            simulate_log(OMNI, inputs, SAMPLING, OMNI_NOISE, seed, current_noise=CURRENT_NOISE),
            seed,
        )
    return out


def pioneer_paper_logs() -> dict[str, tuple[pd.DataFrame, int]]:
    """The experiments of Innocenti et al.: three straight, three on the spot, one validation."""
    n, zero = 1251, np.zeros(1251)
    p = PIONEER.parameters
    settled = -float(np.arccos(-p["d"] / p["l1"]))
    rng = np.random.default_rng(300)
    lead = np.zeros(25)

    def led(signal: np.ndarray) -> np.ndarray:
        return np.append(lead, signal)[:n]

    straight = {
        "straight_1_prbs": led(excitation.prbs(n, 30, 2.0, 5.0, rng)),
        "straight_2_prbs": led(excitation.prbs(n, 30, 3.0, 9.0, rng)),
        "straight_3_step": led(excitation.steps(n, [4.0, 7.0, 2.5, 9.0, 0.0, 6.0])),
        "validation_step": excitation.forward_back(n, 6.0),
    }
    spot = {
        "spot_1_step": led(excitation.steps(n, [2.0, 4.0, 1.5, 3.0, 0.0, 3.5])),
        "spot_2_prbs": led(excitation.prbs(n, 30, 1.2, 2.4, rng)),
        "spot_3_prbs": led(excitation.prbs(n, 30, 1.5, 4.0, rng)),
    }
    runs = {name: (excitation.wheels(signal, zero), {}) for name, signal in straight.items()}
    runs |= {name: (excitation.wheels(zero, signal), {3: settled}) for name, signal in spot.items()}
    return {
        name: (simulate_log(PIONEER, inputs, SAMPLING, PIONEER_NOISE, seed, start=start), seed)
        for seed, (name, (inputs, start)) in enumerate(runs.items(), start=301)
    }


def _held(axis: str, speed: float, n: int) -> np.ndarray:
    """Reference (n, 3) that holds one speed."""
    return np.tile(np.where(np.array(OMNI.speeds) == axis, speed, 0.0), (n, 1))


def _controlled(axis: str, speed: float, n: int, seed: int) -> pd.DataFrame:
    """One speed commanded from rest."""
    return controlled_log(OMNI, _held(axis, speed, n), OMNI_NOISE, seed, CURRENT_NOISE)[0]


def _coast_down(axis: str, speed: float, seed: int) -> pd.DataFrame:
    """2 s under velocity control, then 2 s with the motors disconnected."""
    driven, states = controlled_log(OMNI, _held(axis, speed, 101), OMNI_NOISE, seed, CURRENT_NOISE)
    start = dict(enumerate(states[-1]))
    free = simulate_log(
        OMNI.with_parameters(Kt=0.0, Kv=0.0), np.zeros((101, 4)), SAMPLING, start=start, current_noise=0.0
    )
    rng = np.random.default_rng([seed, 1])
    for name, sigma in zip((*OMNI.speeds, "i1", "i2", "i3", "i4"), (*OMNI_NOISE, *[CURRENT_NOISE] * 4), strict=True):
        free[name] += rng.standard_normal(len(free)) * sigma
    table = pd.concat((driven.iloc[:-1], free), ignore_index=True)
    table["t"] = np.arange(len(table)) * SAMPLING
    return table


def hanging(mass: float, seed: int, duration: float = 4.5) -> pd.DataFrame:
    """Method 3 of the omni paper: the hanging robot turned by a falling mass, at rest at 1 rad for t = 0."""
    t = np.arange(round(duration / SAMPLING) + 1) * SAMPLING
    theta = 1.0 + 0.5 * mass * GRAVITY * DISC_RADIUS / OMNI.parameters["J"] * t**2
    theta += np.random.default_rng(seed).standard_normal(t.size) * THETA_NOISE
    return pd.DataFrame({"t": t, "theta": theta, "mass": mass})


def omni_paper_logs() -> dict[str, tuple[pd.DataFrame, int]]:
    """The experiments of Conceicao, Moreira & Costa: steady speeds, coast-down, hanging robot, velocity control."""
    out, seed = {}, 401
    for axis in OMNI.speeds:
        for speed in (0.6, 0.8, 1.0, 1.2):
            out[f"steady_{axis}_{speed:.1f}"] = _controlled(axis, speed, 251, seed), seed
            seed += 1
    for axis, speed in (("V", 1.4), ("Vn", 0.95), ("W", 1.9)):
        out[f"coast_{axis}"] = (_coast_down(axis, speed, seed), seed)
        seed += 1
    for number, mass in enumerate((0.51, 0.51, 0.51, 1.0), start=1):
        out[f"hanging_{number}"] = (hanging(mass, seed), seed)
        seed += 1
    for axis in OMNI.speeds:
        out[f"control_{axis}"] = _controlled(axis, 1.0, 76, seed), seed
        seed += 1
    return out


UNKNOWN = PIONEER.with_parameters(I0=0.34, Cs=0.29, Cv=0.05)
UNKNOWN_EFFECT = {"stribeck_friction": {"amplitude": 0.3, "speed": 0.06}}  # N m, m/s


def unknown_logs() -> dict[str, tuple[pd.DataFrame, int]]:
    """{file stem: (log, seed)} of a Pioneer of which its owner does not know everything."""
    plan = [("fit", kind) for kind in ("prbs_forward", "prbs_reversing", "multilevel", "steps", "turning", "crawl")]
    plan += [("check", kind) for kind in ("prbs_reversing", "arcs", "crawl")]
    out = {}
    for seed, (role, kind) in enumerate(plan, start=501):
        inputs = excitation.experiment("pioneer", kind, 751, seed)
        number = sum(stem.startswith(role) for stem in out) + 1
        out[f"{role}_{number}"] = (
            simulate_log(UNKNOWN, inputs, SAMPLING, PIONEER_NOISE, seed, UNKNOWN_EFFECT),
            seed,
        )
    return out


def _write_unknown_truth(folder: Path) -> None:
    lines = ["# What is hidden in these logs. Run notebooks/explain.ipynb first.", *[""] * 30]
    lines += [f"{name} = {value!r}" for name, value in UNKNOWN.parameters.items()]
    for name, values in UNKNOWN_EFFECT.items():
        lines += ["", f"[effects.{name}]", *(f"{key} = {value!r}" for key, value in values.items())]
    (folder / "do_not_look_yet.toml").write_text("\n".join(lines) + "\n")


def write_all(folder: Path) -> None:
    """All demonstration logs below `folder`."""
    rows = []
    for name, logs, robot, comment in (
        (
            "pioneer",
            pioneer_logs(),
            PIONEER,
            "Constants of the simulated Pioneer (Innocenti et al., tables 1, 2, 5), SI units",
        ),
        (
            "omni",
            omni_logs(),
            OMNI,
            "Constants of the simulated omni (paper's tables 5, 6; geometry and motors assumed), SI units",
        ),
        (
            "pioneer_paper",
            pioneer_paper_logs(),
            PIONEER,
            "Constants of the simulated Pioneer (Innocenti et al.), SI units",
        ),
        ("omni_paper", omni_paper_logs(), OMNI, "Constants of the simulated omni, SI units"),
    ):
        _write_truth(folder / name, robot.parameters, comment)
        for stem, (table, seed) in logs.items():
            _write(table, folder / name / f"{stem}.csv")
            rows.append(f"| {name}/{stem}.csv | {seed} |")
    for stem, (table, seed) in unknown_logs().items():
        _write(table, folder / "unknown" / f"{stem}.csv")
        rows.append(f"| unknown/{stem}.csv | {seed} |")
    _write_unknown_truth(folder / "unknown")
    (folder / "README.md").write_text(README + "\n".join(rows) + "\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m reference.demo OUTDIR")
    write_all(Path(sys.argv[1]))
