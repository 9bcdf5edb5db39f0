"""Linear methods or output error? All against the Cramér-Rao bound: `python -m benchmarks.cramer_rao [--only axis]`.

For every setting (robot, noise, sampling rate, length, excitation, start, colour of the noise) one clean simulation gets
thousands of noise realisations, all fitted by output error in one compiled batch, some of them by integral least squares
and instrumental variables as well (`--linear`; with `--fits 0` by these alone). Reported by setting and estimator:
variance over the bound (J'J)^-1 at the true parameters, bias in standard errors of one fit, and how many of the reported
95 % intervals hold the truth. The logs come from the model itself, since the question is what noise does to a right model.

A parameter is judged where the bound puts its standard error below a quarter of its distance from its bounds: nearer, no
estimator that respects the bounds is unbiased. Writes `benchmarks/results/cramer_rao.json` and `docs/uncertainty.md`.
"""

import argparse
import datetime
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import jaxid
from jaxid.estimate.linear.integral_least_squares import linear_estimate
from jaxid.estimate.output_error.fleet import Fitted, fit_lanes
from jaxid.estimate.output_error.problem import Problem, Structure, Unknowns, linearise, simulate_all
from jaxid.estimate.output_error.robust_covariance import robust_covariance
from jaxid.estimate.output_error.setup import build
from reference import excitation

RESULTS = Path(__file__).parent / "results" / "cramer_rao.json"
PAGE = Path(__file__).parents[1] / "docs" / "uncertainty.md"
MODELS = {
    "axis": jaxid.Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.05),
    "omni": jaxid.Omni(),
    "pioneer": jaxid.Pioneer(),
}
NOISE = {"axis": (0.01,), "omni": (0.01, 0.01, 0.02), "pioneer": (0.01, 0.02)}
JUDGED = 4.0
"""Standard errors that a parameter must be away from its bounds."""
LINEAR = ("least_squares", "instrumental_variables")
LANES = 128


@dataclass(frozen=True)
class Setting:
    """One row of the study. `noise` multiplies the usual noise, `colour` is its AR(1) coefficient, and every start value is
    off by up to the factor `off`, either way."""

    robot: str
    noise: float = 1.0
    hertz: int = 50
    seconds: float = 10.0
    kinds: tuple[str, ...] = ("multilevel",)
    off: float = 1.0
    colour: float = 0.0
    linear: bool = True

    @property
    def name(self) -> str:
        """The row's label."""
        parts = [f"noise x{self.noise:g}", f"{self.hertz} Hz", f"{len(self.kinds)} x {self.seconds:g} s"]
        parts.append("+".join(dict.fromkeys(self.kinds)).replace("_", " "))
        parts += [f"start x/÷ {self.off:g}"] * (self.off != 1) + [f"AR(1) {self.colour:g}"] * (self.colour != 0)
        return f"{self.robot}: {', '.join(parts)}"


_AXIS = Setting("axis")
_PIONEER = Setting("pioneer", kinds=("multilevel", "turning"))
_OMNI = Setting("omni", kinds=("multilevel",))
SETTINGS = (
    _AXIS,
    replace(_AXIS, noise=0.1),
    replace(_AXIS, noise=5.0),
    replace(_AXIS, hertz=25),
    replace(_AXIS, hertz=100),
    replace(_AXIS, seconds=5.0),
    replace(_AXIS, seconds=20.0),
    replace(_AXIS, kinds=("prbs_reversing",)),
    replace(_AXIS, kinds=("crawl",)),
    replace(_AXIS, off=3.0, linear=False),
    replace(_AXIS, colour=0.8, seconds=20.0),
    _OMNI,
    replace(_OMNI, noise=5.0),
    _PIONEER,
    replace(_PIONEER, noise=0.3),
    replace(_PIONEER, kinds=("prbs_reversing", "crawl")),
)


def inputs_of(setting: Setting, number: int) -> np.ndarray:
    """The run's inputs; every sampling rate gets the same signal."""
    n = round(50 * setting.seconds)
    signal = excitation.experiment(setting.robot, setting.kinds[number], n, seed=40 + number)
    return np.repeat(signal, setting.hertz // 50, axis=0) if setting.hertz >= 50 else signal[:: 50 // setting.hertz]


def truth(setting: Setting) -> tuple[Structure, Problem, Unknowns]:
    """The setting's problem with noise-free measurements, at the true parameters."""
    robot = MODELS[setting.robot]
    logs = []
    for number in range(len(setting.kinds)):
        inputs = inputs_of(setting, number)
        time_ = np.arange(len(inputs)) / setting.hertz
        outputs = np.zeros((len(inputs), len(robot.channels.outputs)))
        logs.append(jaxid.Log.from_arrays(f"{number}", time_, inputs, outputs, robot.channels))
    structure, problem, at = build(robot, jaxid.LogSet(logs), start={}, initial="known")
    clean = jax.jit(simulate_all, static_argnums=0)(structure, problem, at)
    sigma = np.ones(problem.sigma.shape)
    sigma[: len(NOISE[setting.robot])] = setting.noise * np.array(NOISE[setting.robot])
    return structure, replace(problem, outputs=clean, sigma=jnp.asarray(sigma)), at


def realisations(setting: Setting, problem: Problem, count: int) -> np.ndarray:
    """Noisy measurements [N, E, T, ny]; coloured noise has the same variance."""
    noise = np.random.default_rng([7, 11]).normal(size=(count, *problem.outputs.shape))
    if setting.colour:
        fresh = np.sqrt(1 - setting.colour**2)
        for t in range(1, noise.shape[2]):
            noise[:, :, t] = setting.colour * noise[:, :, t - 1] + fresh * noise[:, :, t]
    return np.where(np.asarray(problem.mask), np.asarray(problem.outputs) + noise * np.asarray(problem.sigma), 0.0)


def bound(structure: Structure, problem: Problem, at: Unknowns) -> np.ndarray:
    """Cramér-Rao bound on the covariance of the physical parameters [n, n]."""
    triangle = jax.jit(linearise, static_argnums=0)(structure, problem, at)
    jacobian = np.asarray(triangle.shared) / np.asarray(problem.bounds.slope(at.z))
    return np.linalg.inv(jacobian.T @ jacobian)


def output_errors(setting: Setting, structure: Structure, problem: Problem, at: Unknowns, measured: np.ndarray):
    """Estimates and standard errors [N, n] of all realisations, in one compiled batch, and the share that converged."""
    N = len(measured)
    z = np.repeat(np.asarray(at.z)[None], N, axis=0)
    if setting.off != 1.0:
        factors = np.exp(np.random.default_rng(13).uniform(-1, 1, z.shape) * np.log(setting.off))
        z = np.asarray(jax.vmap(problem.bounds.coordinates)(problem.held * factors))
    starts = Unknowns(jnp.asarray(z), jnp.zeros((N, *at.states.shape)))
    own = {"outputs": jnp.asarray(measured), "sigma": jnp.broadcast_to(problem.sigma * 1.3, (N, len(problem.sigma)))}
    found: Fitted = fit_lanes(structure, problem, own, starts, lanes=LANES)
    at_optimum = found.optimum.unknowns.z
    theta = np.asarray(jax.vmap(problem.bounds.physical)(at_optimum))
    slope = np.asarray(jax.vmap(problem.bounds.slope)(at_optimum))
    jacobian = np.asarray(found.optimum.triangle.shared) / slope[:, None, :]
    if setting.colour:
        covariance = np.stack(
            [
                robust_covariance(
                    structure,
                    replace(problem, outputs=own["outputs"][k], sigma=found.sigma[k]),
                    Unknowns(at_optimum[k], starts.states[k]),
                ).covariance
                for k in range(N)
            ]
        )
    else:
        covariance = np.linalg.pinv(np.einsum("kij,kil->kjl", jacobian, jacobian))
    return theta, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), float(np.mean(found.optimum.converged))


def linear_estimates(setting: Setting, measured: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray, float]]:
    """Estimates and standard errors [N, n] (NaN where not identified), and the share that converged, of both linear
    methods."""
    robot = MODELS[setting.robot]
    runs = [inputs_of(setting, number) for number in range(len(setting.kinds))]
    ny = len(NOISE[setting.robot])
    fits: dict[str, list] = {method: [] for method in LINEAR}
    for y in measured:
        logs = [
            jaxid.Log.from_arrays(f"{e}", np.arange(len(u)) / setting.hertz, u, y[e, : len(u), :ny], robot.channels)
            for e, u in enumerate(runs)
        ]
        fits["least_squares"].append(linear_estimate(robot, logs)[0])
        start = fits["least_squares"][-1]
        fits["instrumental_variables"].append(jaxid.instrumental_variables(robot, logs, start))
    return {
        method: (
            np.array([[fit[n].value for n in fit.free_names] for fit in own]),
            np.array([[fit[n].std_error for n in fit.free_names] for fit in own]),
            float(np.mean([fit.converged for fit in own])),
        )
        for method, own in fits.items()
    }


def figures(theta: np.ndarray, errors: np.ndarray, true: np.ndarray, limit: np.ndarray, judged: np.ndarray) -> dict:
    """Variance over the bound, bias and coverage of every judged parameter, and over all of them."""
    standard = np.sqrt(np.diag(limit))
    off = theta - true
    ratio = off.var(axis=0, ddof=1) / standard**2
    spread = off.std(axis=0, ddof=1)
    coverage = np.sum(np.abs(off) <= 1.959964 * errors, axis=0) / np.maximum(np.isfinite(errors).sum(axis=0), 1)
    bias, at = off.mean(axis=0) / spread, np.flatnonzero(judged)
    return {
        "fits": len(theta),
        "variance_over_bound": {"mean": float(ratio[at].mean()), "each": ratio.tolist()},
        "bias_in_standard_errors": {"worst": float(np.abs(bias)[at].max()), "each": bias.tolist()},
        "coverage": {
            "mean": float(coverage[at].mean()),
            "lowest": float(coverage[at].min()),
            "highest": float(coverage[at].max()),
            "each": coverage.tolist(),
        },
    }


def study(setting: Setting, fits: int, linear: int) -> dict:
    """One row: `fits` realisations by output error, `linear` by the linear methods; a method without any is left out."""
    begin = time.process_time()
    with jaxid.float64():
        structure, problem, at = truth(setting)
        limit = bound(structure, problem, at)
        true = np.asarray(problem.held)
        lower, upper = np.asarray(problem.bounds.lower), np.asarray(problem.bounds.upper)
        judged = JUDGED * np.sqrt(np.diag(limit)) < np.minimum(true - lower, upper - true)
        measured = realisations(setting, problem, max(fits, linear))
        row = {
            "setting": setting.name,
            "parameters": list(structure.names),
            "relative_standard_error_at_bound": (np.sqrt(np.diag(limit)) / np.abs(true)).tolist(),
            "judged": judged.tolist(),
        }
        if fits:
            theta, errors, converged = output_errors(setting, structure, problem, at, measured[:fits])
            row["output_error"] = {"converged": converged, **figures(theta, errors, true, limit, judged)}
    if setting.linear and linear:
        for method, (theta, errors, converged) in linear_estimates(setting, measured[:linear]).items():
            row[method] = {"converged": converged, **figures(theta, errors, true, limit, judged)}
            row[method]["run"] = datetime.date.today().isoformat()
    return {**row, "processor_seconds": time.process_time() - begin}


def main() -> None:
    """Run all settings, or those of some robots, and write figures and page."""
    from .cramer_rao_page import write_page

    parser = argparse.ArgumentParser(description="Estimators against the Cramér-Rao bound.")
    parser.add_argument("--fits", type=int, default=2000, help="realisations by output error")
    parser.add_argument("--linear", type=int, default=300, help="realisations by the linear methods")
    parser.add_argument("--only", default="", help="settings whose name holds this; the others stay as they are")
    arguments = parser.parse_args()
    rows = {row["setting"]: row for row in json.loads(RESULTS.read_text())["rows"]} if RESULTS.exists() else {}
    wanted = [setting for setting in SETTINGS if arguments.only in setting.name]
    for number, setting in enumerate(wanted):
        row = study(setting, arguments.fits, arguments.linear)
        rows[setting.name] = {**rows.get(setting.name, {}), **row}
        for method in ("output_error", *LINEAR):
            if method in row:
                found = row[method]
                print(
                    f"[{number + 1}/{len(wanted)}] {setting.name}, {method}: variance/bound "
                    f"{found['variance_over_bound']['mean']:.3f}, bias {found['bias_in_standard_errors']['worst']:.3f}, "
                    f"coverage {found['coverage']['lowest']:.3f} to {found['coverage']['highest']:.3f}, "
                    f"{100 * found['converged']:.0f} % converged ({row['processor_seconds']:.0f} processor seconds)",
                    flush=True,
                )
        kept = [rows[s.name] for s in SETTINGS if s.name in rows]
        RESULTS.write_text(json.dumps({"rows": kept}, indent=1) + "\n", encoding="utf-8")
    write_page(json.loads(RESULTS.read_text())["rows"], PAGE)


if __name__ == "__main__":
    main()
