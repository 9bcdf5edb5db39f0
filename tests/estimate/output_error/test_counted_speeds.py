"""Fits to speeds that are differences of an encoder's counts, and to the counts that they add up to, against the simulated
robot's own values."""

import tomllib

import numpy as np
import pandas as pd
import pytest

from jaxid import Axis, DifferentialDrive, LogSet, output_error, read_logs
from jaxid.simulation.summed_speeds import as_positions, in_a_mapping
from tests.counted_loop import axis_in_a_loop, drive_in_a_loop

TRUTH = {"M": 2.0, "Fv": 3.0, "Fc": 1.5}


def _off(fit):
    return max(
        abs(fit.parameters[name].value - value) / fit.parameters[name].std_error for name, value in TRUTH.items()
    )


@pytest.fixture(scope="module", params=[True, False], ids=["closed", "open"])
def axis(request):
    logs = LogSet([axis_in_a_loop(f"run{k}", Axis(), k, 1e-3, 12.0, looped=request.param) for k in range(2)])
    return request.param, logs, output_error(Axis(), logs)


def test_they_bias_the_estimate_and_a_note_says_how_not_to(axis, tmp_path):
    closed, logs, fit = axis
    assert not fit.trustworthy and _off(fit) > 3.0
    (note,) = (note for note in fit.notes if "an encoder's counts" in note)
    assert note.startswith("Unless ")  # a sensor rounds its speeds to steps
    assert ("a controller makes commands" in note) == closed and ("late by half a row" in note) != closed
    mapping = tomllib.loads(note.split("with the mapping ")[1].removesuffix("."))
    paths = []
    for log in logs:
        paths.append(tmp_path / f"{log.name}.csv")
        pd.DataFrame({"t": log.time, "u": log.input("u"), "v": log.output("v")}).to_csv(paths[-1], index=False)
    counts = output_error(Axis(), read_logs(paths, Axis(), mapping=mapping))
    assert _off(counts) < 3.5
    smaller = [counts.parameters[name].std_error / fit.parameters[name].std_error for name in TRUTH]
    assert max(smaller) < 0.2


def test_the_lines_of_a_mapping_are_those_that_add_up():
    robot = DifferentialDrive().with_values(b=0.14)
    logs = LogSet([drive_in_a_loop("run", robot, 3, 1e-3, 6.0)])
    summed = as_positions(robot, logs)
    assert summed is not None and summed.steps == pytest.approx({"way_right": 1e-3, "way_left": 1e-3})
    lines = tomllib.loads(in_a_mapping(robot).replace(" and ", "\n"))
    for name, entry in lines.items():
        speeds = sum(weight * logs[0].output(field) for field, weight in entry["fields"].items())
        way = np.append(0.0, np.cumsum(speeds[1:]) * 0.02)
        np.testing.assert_allclose(summed.logs[0].output(name), way, atol=1e-9)
    # With another track these are no counts of the wheels' own.
    assert as_positions(robot.with_values(b=0.1453), logs) is None
