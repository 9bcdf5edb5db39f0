"""Do standard errors hold on real machines? Repeated recordings scatter; what the standard errors say of that scatter.

    python benchmarks/repeats.py --data ../shared/data

Every recording (or stretch of one) is fitted on its own by output error, once with the standard errors of white residuals
and once as by default. For every parameter: the standard deviation of the estimates over the recordings, divided by the
root mean square of their standard errors. One where the errors hold; sqrt(2 / (n - 1)) of it is chance. Recordings of
different trajectories also differ by what the model lacks, which no standard error of one recording knows.
"""

import argparse
from pathlib import Path

import numpy as np
from measured_sets import bam, emps, robotrace
from measured_sets.emps_loop import FIRST, SAMPLING
from measured_sets.emps_loop import load as load_emps

from jaxid import AXIS, Fit, Integrator, Log, LogSet, fit_fleet
from jaxid.robots import Robot

KINDS = ("white", "auto")


def stretches(log: Log, seconds: float, every: int = 1) -> dict[str, LogSet]:
    """The log in pieces of `seconds`, one sample in `every` kept."""
    found = {}
    for start in np.arange(log.time[0], log.time[-1] - 0.9 * seconds, seconds):
        piece = log.window(start, start + seconds)
        rows = slice(None, None, every)
        thin = Log(piece.name, piece.time[rows], piece.inputs[rows], piece.outputs[rows], piece.channels)
        found[piece.name] = LogSet([thin])
    return found


def of_bam(folder: Path) -> tuple[Robot, dict[str, LogSet], dict]:
    """The 16 runs of one servo."""
    logs = bam.load(folder / "bam_xl330")
    return (
        bam.robot(),
        {log.name: LogSet([log]) for log in logs},
        {"integrator": Integrator(2), "initial_states": "known"},
    )


def of_robotrace(folder: Path) -> tuple[Robot, dict[str, LogSet], dict]:
    """Stretches of 1.25 s of one robot driving straight."""
    recording = robotrace.CLEAN[0]
    log = robotrace.load(folder / "robotrace", recording)
    return robotrace.robot(recording, ()), stretches(log, 1.25), {"integrator": robotrace.STEP}


def of_emps(folder: Path) -> tuple[Robot, dict[str, LogSet], dict]:
    """Stretches of 2 s of the position-controlled axis, open loop, both records, 250 samples a second."""
    found, model = {}, None
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        record = load_emps(folder / "emps", name)
        model = emps.axis(record)
        k = slice(FIRST, len(record.t) - FIRST)
        log = Log.from_arrays(name, record.t[k] - record.t[k][0], record.vir[k], {"q": record.q[k]}, AXIS)
        found |= {f"{name} {part}": logs for part, logs in stretches(log, 500 * 4 * SAMPLING, 4).items()}
    assert model is not None
    return model, found, {"start": emps.PUBLISHED, "initial_states": "estimate"}


SETS = {"bam_xl330": of_bam, "robotrace": of_robotrace, "emps": of_emps}


def ratio(fits: list[Fit], name: str) -> tuple[float, int]:
    """Scatter of the estimates in units of their standard errors, and how many recordings identify the parameter."""
    own = [fit[name] for fit in fits if fit[name].status == "identified" and np.isfinite(fit[name].std_error)]
    if len(own) < 3:
        return np.nan, len(own)
    errors = np.sqrt(np.mean([e.std_error**2 for e in own]))
    return float(np.std([e.value for e in own], ddof=1) / errors), len(own)


def main() -> None:
    """Fit and print."""
    parser = argparse.ArgumentParser(description="Scatter of repeated recordings against their standard errors.")
    parser.add_argument("--data", type=Path, required=True, help="folder with one folder a set")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    arguments = parser.parse_args()
    print(f"{'set':<12}{'parameter':<12}{'recordings':>11}" + "".join(f"{kind:>9}" for kind in KINDS))
    for name in arguments.sets:
        robot, fleet, options = SETS[name](arguments.data)
        found = {kind: fit_fleet(robot, fleet, covariance=kind, **options) for kind in KINDS}
        verdicts = [fit.judgement.verdict for fit in found["auto"].fits.values() if fit.judgement]
        for parameter in robot.parameters.free_names:
            cells = {kind: ratio(list(fleet_.fits.values()), parameter) for kind, fleet_ in found.items()}
            row = "".join(f"{cells[kind][0]:>9.2f}" for kind in KINDS)
            print(f"{name:<12}{parameter:<12}{cells['auto'][1]:>11}{row}")
        print(
            f"{name:<12}judged: " + ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts)), flush=True
        )


if __name__ == "__main__":
    main()
