"""How large each hidden effect has to be to show: `python -m benchmarks.hidden.sizes [ROBOT ...]` writes `sizes.json`.

For every robot and effect the size at which the baseline's held-out RMS, after it has absorbed what it can, is three
times the noise, by secant steps on the logarithm over two seeds; weak and strong sizes follow in proportion to the
excess (root of RMS squared less one). Every case of the study reports the RMS it turned out to have.
"""

import argparse
import json
import math
from pathlib import Path

import numpy as np

import jaxid
from jaxid.explanation.left.heldout import held_out_state
from reference.effects import EFFECTS, NOT_FOR

from .cases import MODEL, STRENGTHS, make

PATH = Path(__file__).with_name("sizes.json")
SEEDS = (1, 2)
EVALUATIONS = 4
FIRST = {
    "actuator_dead_zone": 0.4,
    "voltage_saturation": 0.15,
    "battery_sag": 0.15,
    "motor_lag": 0.04,
    "input_delay": 0.03,
    "motor_gain_mismatch": 0.05,
    "motor_heating": 3e-4,
    "stribeck_friction": 0.15,
    "asymmetric_friction": 0.15,
    "asymmetric_viscous_friction": 0.15,
    "sublinear_viscous_friction": 0.2,
    "cogging_torque": 0.15,
    "wheel_radius_mismatch": 0.03,
    "traction_limit": 1 / 15.0,
    "surface_change": 0.3,
    "ground_slope": 0.02,
    "quadratic_drag": 3.0,
    "lateral_com_offset": 0.02,
    "sensor_bias": 0.03,
    "sensor_scale": 0.05,
    "sensor_lag": 0.04,
    "sensor_delay": 0.03,
    "push": 10.0,
    "collision": 0.7,
    "payload_drop": 3.0,
    "resonance": 1.0,
    "hysteresis": 3.0,
}
AXIS_FIRST = {
    "stribeck_friction": 8.0,
    "cogging_torque": 8.0,
    "quadratic_drag": 25.0,
    "actuator_dead_zone": 0.8,
    "sublinear_viscous_friction": 0.3,
    "traction_limit": 1 / 30.0,
    "surface_change": 0.5,
    "push": 10.0,
    "resonance": 3.0,
    "hysteresis": 10.0,
}
OMNI_FIRST = {
    "stribeck_friction": 10.0,
    "traction_limit": 1 / 40.0,
    "push": 30.0,
    "payload_drop": 8.0,
    "hysteresis": 10.0,
}
LARGEST = {
    "actuator_dead_zone": 2.5,
    "voltage_saturation": 0.7,
    "collision": 1.0,
    "payload_drop": 10.0,
    "sublinear_viscous_friction": 0.5,
    "surface_change": 3.0,
    "asymmetric_friction": 0.9,
    "asymmetric_viscous_friction": 0.9,
}


def held_out_rms(robot: str, identifier: str, size: float) -> float:
    """RMS of the fitted baseline on held-out logs in units of the true noise, over the seeds."""
    squares = []
    for seed in SEEDS:
        case = make(robot, {identifier: size}, seed, noise_level=1.0)
        logs = {}
        channels = MODEL[robot]().channels
        for stem, table in case.tables.items():
            values = {name: table[name].to_numpy() for name in table}
            inputs = np.column_stack([values[name] for name in channels.inputs])
            measured = [values.get(name, np.full(len(table), np.nan)) for name in channels.measured]
            log = jaxid.Log.from_arrays(stem, values["t"], inputs, np.column_stack(measured), channels)
            logs.setdefault(stem.split("_")[0], []).append(log)
        model = MODEL[robot]().with_values(**case.nominal)
        fit = jaxid.output_error(model, jaxid.LogSet(logs["fit"]), max_steps=25)
        noise = dict(zip(channels.outputs, case.noise, strict=True))
        squares.append(held_out_state(fit.robot, jaxid.LogSet(logs["check"]), noise).normalised_rms ** 2)
    return math.sqrt(float(np.mean(squares)))


def size_for(robot: str, identifier: str, target: float, first: float, report) -> float | None:
    """The size at which the held-out RMS is `target`."""
    wanted = math.log(math.sqrt(target**2 - 1))
    size, known = first, []
    for _ in range(EVALUATIONS):
        rms = held_out_rms(robot, identifier, size)
        excess = math.log(max(math.sqrt(max(rms**2 - 1, 0.0)), 0.03))
        known.append((math.log(size), excess))
        report(f"{robot} {identifier}: size {size:.4g} shows as {rms:.2f}")
        if abs(excess - wanted) < 0.2:
            return size
        below = max((k for k in known if k[1] < wanted), default=None)
        above = min((k for k in known if k[1] > wanted), default=None)
        if below and above and below[0] < above[0]:
            share = (wanted - below[1]) / (above[1] - below[1])
            size = math.exp(below[0] + min(max(share, 0.2), 0.8) * (above[0] - below[0]))
        else:
            size = math.exp(known[-1][0] + min(max(wanted - excess, -1.5), 0.9))
        if size >= LARGEST.get(identifier, math.inf):
            if math.log(LARGEST[identifier]) in (k[0] for k in known):
                break
            size = LARGEST[identifier]
    closest = min(known, key=lambda pair: abs(pair[1] - wanted))
    return math.exp(closest[0]) if abs(closest[1] - wanted) < 1.5 else None


def main() -> None:
    """Find and write the sizes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=["pioneer", "omni", "axis"])
    arguments = parser.parse_args()
    sizes = json.loads(PATH.read_text()) if PATH.is_file() else {}
    for robot in arguments.robots:
        own = sizes.setdefault(robot, {})
        for identifier in EFFECTS:
            if identifier in NOT_FOR[robot] or identifier == "coriolis_coupling" or identifier in own:
                continue
            if robot == "axis" and identifier in (
                "ground_slope",
                "asymmetric_friction",
                "sensor_scale",
                "surface_change",
            ):
                continue  # on one axis the same model as an offset or another gain, or not in the catalogue
            first = {"omni": OMNI_FIRST, "axis": AXIS_FIRST}.get(robot, {}).get(identifier, FIRST[identifier])
            medium = size_for(robot, identifier, STRENGTHS["medium"], first, lambda m: print(m, flush=True))
            if medium is None:
                continue
            unit = medium / math.sqrt(STRENGTHS["medium"] ** 2 - 1)
            largest = LARGEST.get(identifier, math.inf)
            found = {name: min(unit * math.sqrt(rms**2 - 1), largest) for name, rms in STRENGTHS.items()}
            own[identifier] = found
            PATH.write_text(json.dumps(sizes, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
