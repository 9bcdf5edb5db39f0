"""What effects know of a robot they take from the robot: its supply, what a load changes, and no number of their own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("numba")
from benchmarks.hidden.cases import MODEL, NOISE, REFERENCE  # noqa: E402
from jaxid import DifferentialDrive, Integrator, Log, LogSet
from jaxid.effects import catalogue, effect_by_id, laws_of
from jaxid.simulation.simulate import simulate
from reference import excitation  # noqa: E402
from reference.logs import simulate_log  # noqa: E402

N, DT = 400, 0.02


def compared(name, model, effects, kind="multilevel"):
    """What the simulator's effect changes, and what the model lacks of it, in units of the noise."""
    reference, inputs = REFERENCE[name], excitation.experiment(name, kind, N, 11)
    known = {k: float(v) for k, v in reference.parameters.items() if k in model.parameters and k != "supply"}
    model = model.with_values(**known)
    names = list(model.channels.outputs)
    without, true = (simulate_log(reference, inputs, DT, 0.0, 0, effects=e)[names].to_numpy() for e in ({}, effects))
    log = Log.from_arrays("one", DT * np.arange(N), inputs, np.zeros((N, len(names))), model)
    (found,) = simulate(model, LogSet([log]), integrator=Integrator(6))
    size, left = (np.sqrt(np.mean((e / NOISE[name]) ** 2)) for e in (true - without, found[:, : len(names)] - true))
    assert size > 1.0
    return size, left


@pytest.mark.parametrize("name", ["pioneer", "omni"])
@pytest.mark.parametrize("supply", [9.0, 24.0])
def test_a_supply_sags_from_the_robots_own_voltage(name, supply):
    model = MODEL[name]().with_values(supply=supply)
    effect = effect_by_id(model, "battery_sag")
    model = (model + effect).with_values(**{effect.key("resistance"): 0.3})
    hidden = {"battery_sag": {"resistance": 0.3, "nominal": supply}}
    if name == "omni" and supply < 12.0:  # the omni's driver cannot give more than its supply
        hidden["voltage_saturation"] = {"limit": supply}
    size, left = compared(name, model, hidden)
    assert left < 0.1 * size


@pytest.mark.parametrize("name", ["pioneer", "omni"])
def test_every_law_of_the_supply_asks_the_robot_for_its_voltage(name):
    """Twice the voltage: another motion under the same sag."""
    inputs = excitation.experiment(name, "multilevel", 120, 11)
    for law in laws_of(MODEL[name](), "battery_sag"):
        if law.from_columns:  # a share of whatever the voltage is
            continue
        found = []
        for supply in (24.0, 48.0):
            model = MODEL[name]().with_values(supply=supply) + law
            typical = {k: p.typical or 1.0 for k, p in law.parameters(model).items() if p.free}
            model = model.with_values(**typical)
            still = np.zeros((120, len(model.channels.outputs)))
            log = Log.from_arrays("one", DT * np.arange(120), inputs, still, model)
            found.append(simulate(model, LogSet([log]), integrator=Integrator(4))[0])
        assert np.max(np.abs(found[0] - found[1])) > 1e-4, law.title


@pytest.mark.parametrize("name", ["pioneer", "omni", "axis", "differential"])
@pytest.mark.parametrize(
    "odd",
    [{"speed": 40.0, "length": 0.3}, {"speed": 1e-4, "length": 50.0}, {"time": 1e-4}, {"time": 1e3, "interval": 1e-4}],
    ids=lambda odd: ", ".join(odd),
)
def test_a_robot_of_any_size_can_have_every_effect(name, odd):
    """Logs in another unit than they say (a yaw rate in degrees) make a robot that outruns its own path."""
    robot = (MODEL | {"differential": DifferentialDrive})[name]()
    odd_one = replace(robot, scales=replace(robot.scales, **odd))
    for effect in catalogue(odd_one):
        for law in laws_of(odd_one, effect.id):
            for key, parameter in (odd_one + law).parameters.items():
                assert parameter.lower <= parameter.value <= parameter.upper, (law.title, key)


@pytest.mark.parametrize(("name", "mass"), [("pioneer", 4.0), ("omni", 8.0), ("axis", 0.3)])
def test_a_load_that_is_dropped_changes_the_mass_that_the_robot_names(name, mass):
    model = MODEL[name]()
    effect = effect_by_id(model, "payload_change", "from_a_moment")
    gone = {effect.key("mass"): -mass, effect.key("moment"): 4.0}
    names = {"J": "M", "Cv": "Fv", "Cs": "Fc", "k": "gain"} if name == "axis" else {}
    known = {ours: float(REFERENCE[name].parameters[theirs]) for theirs, ours in names.items()}
    size, left = compared(
        name, (model + effect).with_values(**known, **gone), {"payload_drop": {"mass": mass, "time": 4.0}}
    )
    assert left < 0.1 * size


@pytest.mark.parametrize("measures", ["body", "wheels"])
def test_a_side_with_more_resistance_in_its_winding_needs_no_winding_of_the_robot(measures):
    """A drive known by its gain and back-EMF alone, against Newton's laws of a body on two wheels, integrated by SciPy."""
    M, J, b, gain, back_emf, viscous, excess = 14.0, 0.6, 0.24, 1.9, 4.4, 3.3, 0.12

    def rates(t, state):
        v, w = state
        sides = np.array([v + b * w, v - b * w])
        force = gain * (np.array([5.0, 4.0]) - back_emf * sides) / (1.0, 1.0 + excess) - viscous * sides
        return [force.sum() / M, b * (force[0] - force[1]) / J]

    time = DT * np.arange(100)
    v, w = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    known = {"M": M, "J": J, "b": b, "gain": gain, "back_emf": back_emf, "Fv": viscous, "Fc": 0.0}
    robot = DifferentialDrive(measures=measures).with_values(**known)
    effect = effect_by_id(robot, "motor_gain_mismatch", "winding_resistance")
    model = (robot + effect).with_values(**{effect.key("excess_u_left"): excess})
    outputs = np.stack([v, w] if measures == "body" else [v + b * w, v - b * w], axis=1)
    log = Log.from_arrays("one", time, np.tile([5.0, 4.0], (100, 1)), 0.0 * outputs, model)
    np.testing.assert_allclose(simulate(model, LogSet([log]), integrator=Integrator(8))[0], outputs, atol=1e-5)
    assert "winding_resistance" not in [law.law for law in laws_of(robot.with_values(back_emf=0.0), effect.id)]
