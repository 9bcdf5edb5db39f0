"""jaxid/estimate/output_error/beyond_supply.py: commands that the supply cannot give are said of the fit."""

import numpy as np

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, ParameterTable, Pioneer, output_error
from jaxid.estimate.output_error.beyond_supply import beyond_supply


def driven(volts, robot=None):
    robot = robot or Pioneer()
    rows = len(volts)
    outputs = {name: np.zeros(rows) for name in robot.channels.outputs}
    inputs = np.tile(np.asarray(volts, float)[:, None], (1, len(robot.channels.inputs)))
    return LogSet([Log.from_arrays("run", 0.02 * np.arange(rows), inputs, outputs, robot.channels)])


def test_percent_where_volts_are_meant():
    percent = np.repeat([50.0, -40.0, 10.0, 80.0], 50)
    said = beyond_supply(Pioneer(), driven(percent))
    assert "V2 and V3: 75% of the commands are beyond the 12 V of the supply (supply), up to 80 V" in said
    assert not beyond_supply(Pioneer().with_values(supply=100.0), driven(percent))


def test_a_full_battery_a_spike_and_robots_without_a_supply_are_passed_over():
    volts = np.repeat([12.9, -12.5, 6.0, 11.0], 50)
    volts[3] = 400.0
    assert not beyond_supply(Pioneer(), driven(volts))
    assert not beyond_supply(Axis(), driven(1e3 * volts, Axis()))


def test_a_fit_says_it():
    """First order, exact for held commands: 40 % of 12 V taken for 40 V."""
    u = np.repeat([40.0, -20.0, 30.0, 5.0], 40)
    keep, v = np.exp(-0.05), np.zeros(len(u))
    for k in range(len(u) - 1):
        v[k + 1] = keep * v[k] + (1 - keep) * u[k] * 0.12
    robot = Custom(
        dynamics=lambda s, i, p: {"v": (p["gain"] * i["u"] - s["v"]) / p["tau"]},
        state_names=("v",),
        own_channels=Channels(inputs=("u",), outputs=("v",), units={"u": "V"}),
        table=ParameterTable({"gain": Parameter(1.0, "m/s/V", free=True), "tau": Parameter(0.3, "s", free=True)}),
        supply_voltage=12.0,
    )
    v = v + 0.01 * np.random.default_rng(0).normal(size=len(v))
    logs = LogSet([Log.from_arrays("run", 0.02 * np.arange(len(u)), u[:, None], {"v": v}, robot.channels)])
    fit = output_error(robot, logs)
    assert abs(fit["gain"].value - 0.12) < 0.01
    assert any("beyond the 12 V of the supply, up to 40 V" in note for note in fit.remarks)
