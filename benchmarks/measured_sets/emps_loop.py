"""The EMPS record and its closed loop as a robot: reference in, controller voltage out.

The plant is a pure integrator inside a closed loop: its open-loop simulation drifts, and what disturbs the position
returns through the controller into the force. The controller is known, so the loop itself can be simulated: its input,
the reference, is free of noise, and nothing drifts.
"""

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, sosfiltfilt

from jaxid import Channels, Custom, Fit, Integrator, Log, LogSet, Parameter, output_error, simulate

from . import relative_error

Array = NDArray[np.float64]
SAMPLING = 1e-3  # s
CUTOFF = 100.0  # Hz, of the published zero-phase filter
FIRST = 50  # samples left out at the start, as published: the filters' transients
IDENTIFIED = ("M", "Fv", "Fc", "offset")
_LOOP = Channels(("dqg", "pulse"), ("vir",), ("q", "v"), units={"dqg": "m/s", "pulse": "V", "vir": "V", "q": "m"})


@dataclass(frozen=True)
class Record:
    """One file: reference qg [m], position q [m], its rate v [m/s], controller voltage vir [V], added pulses [V]."""

    name: str
    t: Array
    qg: Array
    q: Array
    v: Array
    vir: Array
    pulse: Array
    gain: float
    kp: float
    kv: float


def load(folder: Path, name: str) -> Record:
    """Read `DATA_EMPS.mat` or `DATA_EMPS_PULSES.mat`.

    Speed is the central difference of the position after the published zero-phase filter (fourth-order Butterworth,
    100 Hz). The pulses are added to the voltage with the gain that makes the controller's law hold in the record
    (from reference, position and voltage alone; no plant model is involved).
    """
    data = loadmat(folder / f"{name}.mat")
    q, qg, vir = (data[key].ravel() for key in ("qm", "qg", "vir"))
    kp, kv = data["kp"].item(), data["kv"].item()
    low_pass = butter(4, CUTOFF, fs=1 / SAMPLING, output="sos")
    speed = np.asarray(np.gradient(sosfiltfilt(low_pass, q), SAMPLING), float)
    pulse = data["pulses_N"].ravel().astype(float) if "pulses_N" in data else np.zeros_like(q)
    if pulse.any():
        rest = (vir - _law(qg, q, kp, kv))[FIRST:]
        pulse = pulse * float(rest @ pulse[FIRST:]) / float(pulse[FIRST:] @ pulse[FIRST:])
    t = SAMPLING * np.arange(len(q), dtype=float)
    return Record(name, t, qg, q, speed, vir, pulse, data["gtau"].item(), kp, kv)


def _law(qg: Array, q: Array, kp: float, kv: float) -> Array:
    """The controller's voltage: speed is the position's difference over two samples, one sample old on average."""
    before = np.concatenate([q[:1], q[:1], q[:-2]])
    return kv * (kp * (qg - q) - (q - before) / (2 * SAMPLING))


def controller_error(record: Record) -> float:
    """Relative error [%] of the published control law against the voltage in the record."""
    law = _law(record.qg, record.q, record.kp, record.kv) + record.pulse
    return relative_error(record.vir[FIRST:], law[FIRST:])


def loop(record: Record, *, hold: bool = False, asymmetric: bool = False) -> Custom:
    """Axis and controller: reference speed in, controller voltage out.

    The reference is a state, so that it runs smoothly between samples. `w` is the controller's speed, one sample old.
    With `hold` the force follows the voltage half a sample later, which is what holding it for a sample does on
    average; without, force and motion of one instant belong together, as in the published treatment. With `asymmetric`
    viscous friction is Fv (1 + asymmetry sgn v).
    """
    kp, kv, gain = record.kp, record.kv, record.gain

    def voltage(state, inputs):
        return kv * (kp * (state["r"] - state["q"]) - state["w"]) + inputs["pulse"]

    def dynamics(state, inputs, p, friction):
        v, command = state["v"], voltage(state, inputs)
        force = gain * (state["u"] if hold else command)
        viscous = p["Fv"] * v * (1.0 + p["asymmetry"] * jnp.sign(v) if asymmetric else 1.0)
        rates = {"q": v, "r": inputs["dqg"], "w": (v - state["w"]) / SAMPLING}
        if hold:
            rates["u"] = (command - state["u"]) / (SAMPLING / 2)
        return rates | {"v": (force - viscous - friction["slide"] - p["offset"]) / p["M"]}

    def output(state, inputs, p):
        return {"vir": voltage(state, inputs), "q": state["q"], "v": state["v"]}

    start = {"r": record.qg, "q": record.q, "v": record.v, "w": record.v}
    start |= {"u": record.vir} if hold else {}
    parameters = {
        "M": Parameter(95.0, "kg", free=True, lower=1.0),
        "Fv": Parameter(200.0, "N s/m", free=True),
        "Fc": Parameter(20.0, "N", free=True, lower=0.0),
        "offset": Parameter(-3.0, "N", free=True),
    }
    if asymmetric:
        parameters["asymmetry"] = Parameter(0.0, "", free=True, typical=0.1)
    return Custom(
        dynamics=dynamics,
        state_names=tuple(start),
        own_channels=_LOOP,
        table=parameters,
        output=output,
        dry_friction=(("slide", "v", "Fc"),),
        start={name: float(values[FIRST]) for name, values in start.items()},
        title="closed loop of the axis",
    )


def loop_log(record: Record, *, motion: bool = False) -> LogSet:
    """The record as a log of the closed loop; with `motion` position and speed are in it, too."""
    k = slice(FIRST, None)
    speed = np.append(np.diff(record.qg), 0.0) / SAMPLING
    outputs = {"vir": record.vir[k]} | ({"q": record.q[k], "v": record.v[k]} if motion else {})
    log = Log.from_arrays(record.name, record.t[k], {"dqg": speed[k], "pulse": record.pulse[k]}, outputs, _LOOP)
    return LogSet([log])


def closed_loop(record: Record, start: Fit | None = None, *, hold: bool = False, asymmetric: bool = False) -> Fit:
    """Output error of the controller's voltage in the simulated loop, the whole record in one run."""
    robot = loop(record, hold=hold, asymmetric=asymmetric)
    first = {name: start[name].value for name in IDENTIFIED} if start is not None else None
    logs = loop_log(record)
    return output_error(robot, logs, start=first, initial_states="known", integrator=Integrator(2 if hold else 1))


def simulation(record: Record, fit: Fit, *, hold: bool = False) -> tuple[Array, tuple[float, ...]]:
    """Simulated (voltage, position, speed) [T, 3] of a record; relative errors of position, speed and force [%]."""
    return simulation_with(record, {name: fit[name].value for name in IDENTIFIED}, hold=hold)


def simulation_with(
    record: Record, numbers: dict[str, float], *, hold: bool = False
) -> tuple[Array, tuple[float, ...]]:
    """`simulation` with the given M, Fv, Fc and offset."""
    robot = loop(record, hold=hold).with_values(**numbers)
    seen = simulate(robot, loop_log(record, motion=True), integrator=Integrator(2 if hold else 1))[0]
    k = slice(FIRST, None)
    measured = (record.q[k], record.v[k], record.vir[k])
    errors = tuple(relative_error(m, seen[:, column]) for m, column in zip(measured, (1, 2, 0), strict=True))
    return seen, errors
