"""What gross outliers cost, by loss: `python -m benchmarks.outliers [--repeats 100]`.

Realisations of the noise on the axis, and the Pioneer's six demonstration logs; in each, 5 % of all samples are then off by
10 to 200 times the noise. The parameters' error (root mean square, in standard errors of the clean fit) under every loss,
over the error of the clean least-squares fit. Writes `benchmarks/results/outliers.json` and `docs/outliers.md`.
"""

import argparse
import json
from pathlib import Path

import numpy as np

import jaxid
from jaxid.demo import truth
from reference import excitation

HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results" / "outliers.json", HERE.parent / "docs" / "outliers.md"
LOSSES = ("squares", "huber", "cauchy", "student_t")
SHARE = 0.05
AXIS = jaxid.Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.05)
PIONEER_NOISE = np.array([0.01, 0.02])

_HEAD = f"""# Gross outliers

Written by `python -m benchmarks.outliers`. {100 * SHARE:.0f} % of all samples are off by 10 to 200 times the noise, either
way. Error of the parameters under each loss over that of least squares on the same logs without outliers (root mean square
over parameters and realisations, in standard errors of the clean fit; target for a robust loss: at most 1.3), share of the
robust 95 % intervals that hold the truth, and share of the outliers that the fit lists. The Pioneer's rows have one and the
same measurement noise throughout, so that a parameter which that puts outside its interval is outside in most of them.

| logs | loss | error over the clean fit's | intervals that hold the truth | outliers listed | sound samples listed |
| --- | --- | --- | --- | --- | --- |
"""


def spoilt(
    logs: jaxid.LogSet, noise: np.ndarray, rng: np.random.Generator
) -> tuple[jaxid.LogSet, dict[str, np.ndarray]]:
    """The logs with outliers, and where those are [T, ny] by log."""
    found, where = [], {}
    for log in logs:
        ny = len(noise)
        hit = rng.random((len(log), ny)) < SHARE
        off = rng.choice([-1.0, 1.0], hit.shape) * rng.uniform(10, 200, hit.shape) * noise
        outputs = np.array(log.outputs)
        outputs[:, :ny] += np.where(hit, off, 0.0)
        found.append(jaxid.Log.from_arrays(log.name, log.time, log.inputs, outputs, log.channels))
        where[log.name] = hit
    return jaxid.LogSet(found), where


def listed(fit: jaxid.Fit, logs: jaxid.LogSet, where: dict[str, np.ndarray]) -> tuple[int, int]:
    """How many outliers, and how many sound samples, the fit lists."""
    true = sound = 0
    for outlier in fit.outliers:
        log = logs[outlier.log]
        rows = (log.time >= outlier.start) & (log.time <= outlier.stop)
        hit = where[outlier.log][rows, log.channels.measured.index(outlier.channel)]
        true += int(hit.sum())
        sound += int(outlier.samples - hit.sum())
    return true, sound


def axis_logs(seed: int) -> jaxid.LogSet:
    """Two runs of 10 s with fresh noise of 0.01 m/s."""
    runs = []
    for number, kind in enumerate(("multilevel", "crawl")):
        inputs = excitation.experiment("axis", kind, 500, seed=5)
        blank = jaxid.Log.from_arrays(kind, np.arange(500) * 0.02, inputs, {"v": np.zeros(500)}, jaxid.AXIS)
        v = jaxid.simulate(AXIS, jaxid.LogSet([blank]))[0][:, 0]
        v = v + 0.01 * np.random.default_rng([seed, number]).normal(size=500)
        runs.append(jaxid.Log.from_arrays(kind, blank.time, inputs, {"v": v}, jaxid.AXIS))
    return jaxid.LogSet(runs)


def row(
    robot: jaxid.Robot, cases: list[tuple[jaxid.LogSet, dict[str, float]]], noise: np.ndarray, name: str
) -> list[dict]:
    """Errors of all losses over a list of (clean logs, true values)."""
    errors: dict[str, list] = {loss: [] for loss in ("clean", *LOSSES)}
    inside: dict[str, list] = {loss: [] for loss in LOSSES}
    counts = {loss: np.zeros(4) for loss in LOSSES}
    for number, (logs, known) in enumerate(cases):
        dirty, where = spoilt(logs, noise, np.random.default_rng([number, 17]))
        clean = jaxid.output_error(robot, logs)
        names = [n for n in clean.free_names if n in known and clean[n].status == "identified"]
        scale = np.array([clean[n].std_error for n in names])
        true = np.array([known[n] for n in names])
        errors["clean"].append((np.array([clean[n].value for n in names]) - true) / scale)
        for loss in LOSSES:
            fit = jaxid.output_error(robot, dirty, loss=loss)
            off = np.array([fit[n].value for n in names]) - true
            errors[loss].append(off / scale)
            inside[loss].append(np.abs(off) <= 1.96 * np.array([fit[n].std_error for n in names]))
            hits, sound = listed(fit, dirty, where)
            all_hits = sum(int(hit.sum()) for hit in where.values())
            counts[loss] += (hits, all_hits, sound, sum(hit.size for hit in where.values()) - all_hits)
        print(f"{name} {number + 1} of {len(cases)}", flush=True)
    reference = np.sqrt(np.mean(np.square(np.concatenate(errors["clean"]))))
    return [
        {
            "logs": name,
            "loss": loss,
            "realisations": len(cases),
            "error_ratio": float(np.sqrt(np.mean(np.square(np.concatenate(errors[loss])))) / reference),
            "coverage": float(np.mean(np.concatenate(inside[loss]))),
            "outliers_listed": float(counts[loss][0] / counts[loss][1]),
            "sound_listed": float(counts[loss][2] / counts[loss][3]),
        }
        for loss in LOSSES
    ]


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description="Robust losses against gross outliers.")
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--pioneer", type=int, default=5, help="realisations of the outliers on the Pioneer's logs")
    arguments = parser.parse_args()
    axis = [(axis_logs(seed), AXIS.parameters.numbers) for seed in range(arguments.repeats)]
    rows = row(AXIS, axis, np.array([0.01]), f"axis, 2 logs of 10 s, {arguments.repeats} realisations")
    folder = HERE.parent / "jaxid" / "demo_logs" / "pioneer"
    demo = jaxid.read_logs(str(folder / "fit_*.csv"), robot="pioneer")

    known = truth("pioneer")
    name = f"Pioneer, the 6 demonstration logs, {arguments.pioneer} realisations"
    rows += row(jaxid.Pioneer(), [(demo, known)] * arguments.pioneer, PIONEER_NOISE, name)
    RESULTS.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    text = _HEAD
    for r in rows:
        text += (
            f"| {r['logs']} | {r['loss']} | {r['error_ratio']:.2f} | {100 * r['coverage']:.0f} % | "
            f"{100 * r['outliers_listed']:.1f} % | {100 * r['sound_listed']:.3f} % |\n"
        )
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
