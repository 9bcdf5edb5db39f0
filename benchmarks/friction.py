"""Study of the two dry-friction laws against the event-accurate simulator in `reference/`.

    python -m benchmarks.friction            # about five minutes on two cores; --quick is a trial

How far a simulation with each law and step is from the truth, and what that does to estimates by output error: six fit
logs and three held-out logs of the demonstration Pioneer (creeping, stopping, reversing), at the demonstration logs' own
noise and at half of it. Writes `benchmarks/results/friction.json`, `docs/dry_friction.md` and `docs/friction/*.png`.
"""

import argparse
import json
import textwrap
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from jaxid import Fit, Integrator, Log, LogSet, Pioneer, Smooth, Sticking, float64, output_error, read_logs, simulate
from jaxid.estimate.output_error.problem import parameters_at
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise_compiled
from jaxid.report.style import COLOURS as HOUSE_COLOURS
from jaxid.report.style import HOUSE
from reference.logs import simulate as exact_run
from reference.pioneer import PARAMETERS as TRUTH
from reference.pioneer import PIONEER

ROOT = Path(__file__).parents[1]
DEMO = ROOT / "jaxid/demo_logs/pioneer"
NOISES = {"half": (0.005, 0.01), "demo": (0.01, 0.02)}  # m/s, rad/s
SHOWN = ("Cs", "Cv", "Cs1", "I0")
SEED = 20
STICKING_STEPS = (1, 2, 4, 8)
WIDTHS = (0.02, 0.005, 0.002, 0.001)  # m/s at the wheel's rim
SIMULATED_STEPS = (1, 2, 4, 8, 16)
FITTED_STEPS = {0.02: (4,), 0.005: (4,), 0.002: (4,), 0.001: (4, 16)}  # wider ones do not change with the step


def smooth(width: float) -> Smooth:
    """The smooth law of a width in m/s at the rim; the law itself wants the wheels' rad/s."""
    return Smooth(width / TRUTH["R"])


def logs_and_truth() -> tuple[dict[str, LogSet], list[np.ndarray]]:
    """All nine logs at either noise, the six fit logs first, and their exact speeds."""
    demo = [read_logs(DEMO / f"{role}_*.csv", robot="pioneer") for role in ("fit", "check")]
    logs = [log for part in demo for log in part]
    exact = [exact_run(PIONEER, log.inputs, 0.02).speeds for log in logs]
    rng = np.random.default_rng(SEED)
    half = [
        Log.from_arrays(
            log.name, log.time, log.inputs, speeds + rng.normal(size=speeds.shape) * NOISES["half"], log.channels
        )
        for log, speeds in zip(logs, exact, strict=True)
    ]
    return {"half": LogSet(half), "demo": LogSet(logs)}, exact


def normalised_rms(simulated: list[np.ndarray], target: list[np.ndarray], noise: tuple[float, float]) -> float:
    """Root mean square difference over logs, samples and both speeds, in standard deviations of the noise."""
    parts = [((a - b) / noise).ravel() for a, b in zip(simulated, target, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def simulation_errors(
    robot: Pioneer, logs: LogSet, exact: list[np.ndarray], integrator: Integrator
) -> dict[str, float]:
    """Error of a simulation with the true parameters, in units of either noise."""
    simulated = simulate(robot, logs, integrator=integrator)
    return {name: normalised_rms(simulated, exact, noise) for name, noise in NOISES.items()}


@float64()
def bias(robot: Pioneer, logs: LogSet, exact: list[np.ndarray], integrator: Integrator) -> dict[str, float]:
    """Relative error of the parameters that fit the exact speeds best: what the law alone does, without noise."""
    structure, problem, unknowns = build(robot, logs, start=robot.parameters.numbers, integrator=integrator)
    outputs = np.zeros(problem.outputs.shape)
    for e, speeds in enumerate(exact):
        outputs[e, : len(speeds)] = speeds
    problem = replace(problem, outputs=jnp.asarray(outputs), sigma=jnp.array(NOISES["half"]))
    optimum = minimise_compiled(structure, problem, unknowns, max_steps=100)
    theta = np.asarray(parameters_at(problem, optimum.unknowns.z))
    return {name: float(value / TRUTH[name] - 1.0) for name, value in zip(structure.names, theta, strict=True)}


def judged(
    fit: Fit, logs: LogSet, exact: list[np.ndarray], noise: tuple[float, float], integrator: Integrator
) -> dict[str, Any]:
    """Errors of the estimates against the truth, and the fit's RMS over the noise that the logs really hold."""
    measured = [log.outputs for log in logs]
    simulated = simulate(fit.robot, logs, integrator=integrator)
    floor = [normalised_rms(exact[part], measured[part], noise) for part in (slice(6), slice(6, None))]
    return {
        "fit_rms": normalised_rms(simulated[:6], measured[:6], noise) / floor[0],
        "check_rms": normalised_rms(simulated[6:], measured[6:], noise) / floor[1],
        "iterations": fit.iterations,
        "converged": fit.converged,
        "errors": {
            name: {
                "percent": 100.0 * (fit[name].value / TRUTH[name] - 1.0),
                "standard_errors": (fit[name].value - TRUTH[name]) / fit[name].std_error,
                "status": fit[name].status,
            }
            for name in fit.free_names
        },
    }


def fitted(logs: dict[str, LogSet], exact: list[np.ndarray], integrator: Integrator) -> dict[str, Any]:
    """Output error with one law at both noises, its run time, and its bias without noise."""
    row: dict[str, Any] = {}
    for noise, level in NOISES.items():
        fit_logs = logs[noise][:6]
        start = time.process_time()
        fit = output_error(Pioneer(), fit_logs, integrator=integrator, initial_states="known")
        seconds = time.process_time() - start  # of the second noise: by then everything is compiled
        row[noise] = judged(fit, logs[noise], exact, level, integrator)
        row["cpu_seconds"], row["cpu_seconds_per_iteration"] = seconds, seconds / fit.iterations
    row["bias"] = bias(Pioneer(), logs["demo"][:6], exact[:6], integrator)
    return row


def label(integrator: Integrator) -> str:
    """Name of a row, without the step."""
    friction = integrator.friction
    return "sticking" if isinstance(friction, Sticking) else f"smooth {friction.width * TRUTH['R']:.3g} m/s"


def study(quick: bool) -> dict[str, Any]:
    """All numbers."""
    logs, exact = logs_and_truth()
    robot = Pioneer().with_values(**TRUTH)
    laws: list[tuple[Any, tuple[int, ...]]] = [(Sticking(), STICKING_STEPS)]
    laws += [(smooth(width), FITTED_STEPS[width]) for width in (WIDTHS[1:2] if quick else WIDTHS)]
    rows = []
    for law, fit_steps in laws:
        for steps in SIMULATED_STEPS[:3] if quick else SIMULATED_STEPS:
            integrator = Integrator(steps, law)
            row = {"law": label(integrator), "substeps": steps, "step_ms": 20.0 / steps}
            row["simulation_error"] = simulation_errors(robot, logs["demo"], exact, integrator)
            if steps in fit_steps and not (quick and steps != 4):
                row["fit"] = fitted(logs, exact, integrator)
            rows.append(row)
            text = f"{row['law']:>16}, {steps:2d} sub-steps: error {row['simulation_error']['half']:.3g} noise units"
            if "fit" in row:
                checks = ", ".join(f"{row['fit'][noise]['check_rms']:.4f}" for noise in NOISES)
                text += f"; held-out RMS {checks}; Cs1 bias {100 * row['fit']['bias']['Cs1']:+.2f} %"
            print(text, flush=True)
    return {"sampling_s": 0.02, "noise": {k: list(v) for k, v in NOISES.items()}, "seed": SEED, "rows": rows}


COLOURS = dict(zip(WIDTHS, ("#b2182b", "#ef8a62", "#67a9cf", "#2166ac"), strict=True))


@plt.rc_context(HOUSE)
def error_figure(rows: list[dict[str, Any]], path: Path) -> None:
    """Simulation error over the step, one line a law."""
    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    laws = list(dict.fromkeys(row["law"] for row in rows))
    for law in laws:
        own = [row for row in rows if row["law"] == law]
        steps = [row["step_ms"] for row in own]
        errors = [row["simulation_error"]["half"] for row in own]
        colour = "black" if law == "sticking" else COLOURS[float(law.split()[1])]
        style = dict(lw=2.2, marker="o") if law == "sticking" else dict(lw=1.3, marker="s", ms=4)
        axes.loglog(steps, errors, color=colour, label="true sticking" if law == "sticking" else law, **style)
    steps = np.array([1.25, 20.0])
    anchor = next(r for r in rows if r["law"] == "sticking" and r["substeps"] == 4)["simulation_error"]["half"]
    axes.loglog(steps, anchor * (steps / 5.0) ** 2, color="0.6", ls=":", label="slope 2")
    axes.set(xlabel="integration step [ms]", ylabel="RMS error [standard deviations of the noise]", ylim=(1e-4, 20))
    axes.set_xticks([1.25, 2.5, 5, 10, 20], ["1.25", "2.5", "5", "10", "20"])
    axes.minorticks_off()
    axes.set_title("Simulation with the true parameters; noise 0.005 m/s and 0.01 rad/s")
    axes.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)


@plt.rc_context(HOUSE)
def trace_figure(path: Path) -> None:
    """A stretch of the creeping held-out log: the truth and both laws, and their errors."""
    log = read_logs(DEMO / "check_crawl.csv", robot="pioneer")
    exact = exact_run(PIONEER, log[0].inputs, 0.02).speeds
    robot = Pioneer().with_values(**TRUTH)
    laws = {"smooth, 0.02 m/s": (smooth(0.02), COLOURS[0.02]), "smooth, 0.005 m/s": (smooth(0.005), COLOURS[0.005])}
    laws["true sticking"] = (Sticking(), HOUSE_COLOURS[2])
    time_ = log[0].time
    window = (time_ >= 7.0) & (time_ <= 13.0)
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 5.2), sharex=True, layout="constrained")
    for column, (name, unit, noise) in enumerate((("eta1", "m/s", 0.005), ("eta2", "rad/s", 0.01))):
        axes[0, column].plot(
            time_[window], exact[window, column], color="black", lw=2.5, label="event-accurate reference"
        )
        axes[0, column].set(ylabel=f"{name} [{unit}]")
        axes[1, column].axhspan(-noise, noise, color="0.9", label="noise, one standard deviation")
        axes[1, column].set(ylabel=f"error of {name} [{unit}]", xlabel="time [s]")
    for law, (friction, colour) in laws.items():
        simulated = simulate(robot, log, integrator=Integrator(4, friction))[0]
        for column in range(2):
            axes[0, column].plot(time_[window], simulated[window, column], color=colour, lw=1.1, label=law)
            error = simulated[window, column] - exact[window, column]
            axes[1, column].plot(time_[window], error, color=colour, lw=1.1)
    axes[0, 0].legend(loc="lower left")
    axes[1, 0].legend()
    figure.suptitle("Creeping: four integration steps in each 20 ms, true parameters", x=0.01, ha="left")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def table(rows: list[dict[str, Any]]) -> str:
    """The rows that were fitted, as Markdown."""
    base = next(r for r in rows if r["law"] == "sticking" and r["substeps"] == 4)["fit"]["cpu_seconds_per_iteration"]
    lines = [
        "| law | sub-steps | simulation error, half / demo noise | held-out RMS, half / demo | bias of Cs, Cv, I0 [%] "
        "| bias of Cs1 [%] | errors of Cs, Cv, Cs1, I0, half noise [standard errors] | the same, demo noise "
        "| iterations | time an iteration |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        if "fit" not in row:
            continue
        fit, error = row["fit"], row["simulation_error"]
        half, demo = fit["half"], fit["demo"]
        biases = ", ".join(f"{100 * fit['bias'][name]:+.2f}" for name in ("Cs", "Cv", "I0"))
        own = [", ".join(f"{part['errors'][name]['standard_errors']:+.1f}" for name in SHOWN) for part in (half, demo)]
        lines.append(
            f"| {row['law']} | {row['substeps']} | {error['half']:.3f} / {error['demo']:.3f} "
            f"| {half['check_rms']:.3f} / {demo['check_rms']:.3f} | {biases} | {100 * fit['bias']['Cs1']:+.1f} "
            f"| {own[0]} | {own[1]} | {half['iterations']} / {demo['iterations']} "
            f"| {fit['cpu_seconds_per_iteration'] / base:.2f} |"
        )
    return "\n".join(lines)


PAGE = """# Dry friction: sticking or smoothed

Written by `python -m benchmarks.friction`; all numbers are in `benchmarks/results/friction.json`.

**The laws.** `Sticking()`, the default, is an implicit step: before each integration step it finds the friction
torques that would bring the wheels and the caster's pivot to rest by the end of it, cuts each off at its Coulomb
level, and holds them through the step. An axis that passes through zero within the step feels the mean of both
levels. Below break-away a single axis stands still to rounding; a robot whose axes are coupled creeps by what the two
sweeps of the small contact problem leave, below 0.00001 m/s for the Pioneer, and `Sticking(sweeps=3)` cuts that a
hundredfold. `Smooth(width)` replaces the sign of the speed by `tanh(speed / width)`. Its width is in units of the
rubbing speed (rad/s for the Pioneer, so 0.005 m/s at the rim is `Smooth(0.005 / 0.0825)`), and a smoothed axis never
rests: at half the break-away torque it creeps at {creep} of the width.

**The error.** From one step in 20 ms to sixteen, the smooth law's falls by a factor of {flat_wide} at the largest width
and of {flat_narrow} at the smallest (the slope of friction at rest is the Coulomb level over the width: a narrow law is
stiff). With sticking the error of a single axis falls with the square of the step; on these logs, with coupled axes and
two sweeps, with the power {order}: from {stick1} standard deviations of the smaller noise with one step in 20 ms to
{stick4} with four.

![Simulation error over the step](friction/error.png)

![A creeping stretch](friction/creeping.png)

{table}

Six fit logs and three held-out logs of the demonstration Pioneer. "Half" is noise of 0.005 m/s and 0.01 rad/s, "demo"
the demonstration logs' 0.01 m/s and 0.02 rad/s. Simulation error: RMS with the true parameters, in standard
deviations of the noise. Held-out RMS: of the fitted model on logs it has not seen, over the RMS of the noise in them.
Bias: error of the estimates from the noise-free speeds. Errors in the standard errors that the fit reports: where the
bias is small they are this noise's chance, the same in every such row. Time in processor seconds relative to sticking
with four sub-steps.

**Which to choose.** Sticking with the default step, unless something else needs a smooth law: {best}. One step in 20
ms is {work} of four steps' work, and its error {stick1} standard deviations. The smooth law is for work that wants a
smooth vector field (another integrator, linearisation about rest); then choose the width by the slowest motion in the
logs, a tenth of it or less, and the sub-steps so that the simulation no longer changes. At a width of 0.02 m/s the
simulation error is {wide} standard deviations of the smaller noise, the Coulomb friction of the caster's pivot comes
out {wide_bias} % off ({wide_errors} reported standard errors), the fit takes {wide_iterations} iterations (sticking
{stick_iterations}), and the held-out RMS is {wide_held_out} times the noise.
"""


def page(rows: list[dict[str, Any]]) -> str:
    """The documentation page."""

    def find(law: str, steps: int) -> dict[str, Any]:
        return next(row for row in rows if row["law"] == law and row["substeps"] == steps)

    def fall(law: str) -> float:
        return find(law, 1)["simulation_error"]["half"] / find(law, 16)["simulation_error"]["half"]

    stick = find("sticking", 4)
    wide = find("smooth 0.02 m/s", 4)
    order = (
        np.log2(find("sticking", 1)["simulation_error"]["half"] / find("sticking", 16)["simulation_error"]["half"]) / 4
    )
    fit = find("sticking", 2)["fit"]
    best = (
        f"with two sub-steps of 10 ms, the default at 50 Hz, the held-out "
        f"RMS is {fit['half']['check_rms']:.3f} and {fit['demo']['check_rms']:.3f}, "
        f"and no bias of the four friction parameters and I0 exceeds "
        f"{100 * max(abs(fit['bias'][name]) for name in ('Cs', 'Cv', 'Cs1', 'Cv1', 'I0')):.2f} %"
    )
    text = PAGE.format(
        creep=f"{np.arctanh(0.5):.2f}",
        flat_wide=f"{fall('smooth 0.02 m/s'):.2g}",
        flat_narrow=f"{fall('smooth 0.001 m/s'):.2g}",
        work=f"{find('sticking', 1)['fit']['cpu_seconds_per_iteration'] / stick['fit']['cpu_seconds_per_iteration']:.2f}",
        stick_iterations=stick["fit"]["half"]["iterations"],
        wide_held_out=f"{wide['fit']['half']['check_rms']:.2f}",
        stick1=f"{find('sticking', 1)['simulation_error']['half']:.2g}",
        order=f"{order:.1f}",
        stick4=f"{stick['simulation_error']['half']:.2g}",
        table=table(rows),
        best=best,
        wide=f"{wide['simulation_error']['half']:.2g}",
        wide_errors=f"{wide['fit']['half']['errors']['Cs1']['standard_errors']:.0f}",
        wide_iterations=wide["fit"]["half"]["iterations"],
        wide_bias=f"{100 * wide['fit']['bias']['Cs1']:.0f}",
    )
    parts = [
        part if part.startswith(("#", "|", "!")) else textwrap.fill(part, 125, break_on_hyphens=False)
        for part in text.strip().split("\n\n")
    ]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Run the study and write its results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a trial run that writes nothing")
    parser.add_argument("--page", action="store_true", help="only the page and the pictures, from the stored numbers")
    options = parser.parse_args()
    stored = ROOT / "benchmarks/results/friction.json"
    if options.page:
        results = json.loads(stored.read_text())
    else:
        start = time.monotonic()
        results = study(options.quick)
        print(f"{time.monotonic() - start:.0f} s, {time.process_time():.0f} s of processor time", flush=True)
    if options.quick:
        return
    folder = ROOT / "docs/friction"
    folder.mkdir(parents=True, exist_ok=True)
    stored.parent.mkdir(exist_ok=True)
    stored.write_text(json.dumps(results, indent=1) + "\n")
    error_figure(results["rows"], folder / "error.png")
    trace_figure(folder / "creeping.png")
    (ROOT / "docs/dry_friction.md").write_text(page(results["rows"]))


if __name__ == "__main__":
    main()
