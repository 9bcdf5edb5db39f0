"""Viscous friction beside a curve of the speed, whose straight share may be either's, on an axis integrated here."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jaxid import (
    AXIS,
    Axis,
    Controller,
    DifferentialDrive,
    Log,
    LogSet,
    Omni,
    Pioneer,
    closed_loop,
    output_error,
)
from jaxid.effects import effect_by_id
from jaxid.estimate.result import Estimate
from jaxid.explanation.certainty.straight_shares import open_gain, shared_lines, without_shared_lines
from jaxid.explanation.refits.held_parameters import settled
from jaxid.robots.scales import Scales
from jaxid.simulation.scaled import scaled_to

M, FV = 1.0, 2.0


def resistance(v):
    """Viscous friction and a drawn loss that bends."""
    return FV * v + np.sign(v) * np.interp(np.abs(v), [0.0, 0.3, 0.8, 1.5, 4.0], [0.0, 0.4, 0.6, 1.6, 2.0])


def driven(seed, steps=400, fine=20, h=0.02):
    """Logs of random commands that are held, integrated by the classical Runge-Kutta method in fine steps."""
    random, logs = np.random.default_rng(seed), []
    for name in ("a", "b"):
        u = np.repeat(random.uniform(-6.0, 6.0, steps // 10 + 1), 10)[: steps + 1]
        v, speeds = 0.0, [0.0]
        for k in range(steps):
            for _ in range(fine):
                d = h / fine
                r1 = (u[k] - resistance(v)) / M
                r2 = (u[k] - resistance(v + 0.5 * d * r1)) / M
                r3 = (u[k] - resistance(v + 0.5 * d * r2)) / M
                r4 = (u[k] - resistance(v + d * r3)) / M
                v += d / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)
            speeds.append(v)
        y = np.array(speeds) + 0.005 * random.normal(size=steps + 1)
        logs.append(Log.from_arrays(name, h * np.arange(steps + 1), u[:, None], {"v": y}, AXIS))
    return LogSet(logs)


@pytest.fixture(scope="module")
def fits():
    """The fits with a curve of viscous friction and with one of the Stribeck effect."""
    logs = driven(3)
    robot = scaled_to(Axis().with_values(M=M, Fv=FV, Fc=0.0), logs).change("Fc", free=False)

    def fitted(identifier):
        return output_error(robot + effect_by_id(robot, identifier, "shape"), logs)

    return fitted("sublinear_viscous_friction"), fitted("stribeck_friction")


def test_viscous_friction_is_not_identified_beside_a_curve_of_the_speed(fits):
    bent, _ = fits
    assert bent["Fv"].status in ("identified", "at_bound")  # wherever the share that it may have ended
    told = without_shared_lines(bent)
    assert told["Fv"].status == "not_identifiable" and np.isinf(told["Fv"].std_error)
    assert told["M"] == bent["M"] and told["M"].status == "identified"
    assert told["sublinear_viscous_friction.at_1"] == bent["sublinear_viscous_friction.at_1"]
    (note,) = shared_lines(told)
    assert "Fv, of which it may have a share" in note
    # What is determined instead: the resistance at the curve's end over the speed there.
    value, error = (float(number) for number in note.split(" is ")[-1].split(" N s/m")[0].split(" ± "))
    end = bent.robot.parameters["sublinear_viscous_friction.reach"].value
    assert abs(value - resistance(end) / end) < max(4.0 * error, 0.02 * value) and error < 0.1


def test_what_a_curve_cannot_stand_for_stays(fits):
    bent, stribeck = fits
    # That there is nothing beyond the reach of a Stribeck curve is what such friction is.
    assert without_shared_lines(stribeck) is stribeck and not shared_lines(stribeck)
    # A viscous friction that is known is none of the answers.
    known = replace(bent, parameters={**bent.parameters, "Fv": Estimate.of(2.0, 0.0, "N s/m", "fixed")})
    assert without_shared_lines(known) is known


def like(fit, robot):
    """A fit of `robot` that identifies all of its parameters."""
    names = robot.parameters.free_names
    found = {n: Estimate.of(p.value, 0.01, p.unit, "identified" if n in names else "fixed")
             for n, p in robot.parameters.items()}  # fmt: skip
    return replace(fit, robot=robot, parameters=found, free_names=names, covariance=1e-4 * np.eye(len(names)))


@pytest.mark.parametrize(
    ("robot", "identifier", "shared"),
    [
        (Omni(), "quadratic_drag", {"Bv", "Bvn"}),
        (Omni(), "turning_friction", {"Bw"}),
        (Pioneer(), "voltage_saturation", set()),
        # Curves that need not be zero at rest, one for either way of every axis.
        (Pioneer(), "asymmetric_friction", {"Cs", "Cv"}),
        # In millimetres, where a yaw rate of the speeds' size is far beyond what the wheels reach.
        (
            replace(DifferentialDrive().with_values(b=110.0), scales=Scales(speed=700.0)),
            "sublinear_viscous_friction",
            {"Fv"},
        ),
    ],
)
def test_whose_share_it_is_follows_from_the_equations_of_motion(fits, robot, identifier, shared):
    model = robot + effect_by_id(robot, identifier, "shape")
    told = without_shared_lines(like(fits[0], model))
    assert {n for n in model.parameters if told[n].status == "not_identifiable"} == shared
    assert bool(shared_lines(told)) == bool(shared)


def test_why_a_limit_that_takes_from_the_smallest_commands_leaves_all_open_is_said(fits):
    model = DifferentialDrive() + effect_by_id(DifferentialDrive(), "voltage_saturation", "shape")
    known = like(fits[0], model)
    assert open_gain(known) == ""
    open_ = {
        n: replace(e, status="not_identifiable") if e.status == "identified" else e for n, e in known.parameters.items()
    }
    opened = replace(known, parameters=open_)
    assert not settled(known) and not settled(opened)  # whether the first height is needed is asked
    said = open_gain(opened)
    assert "M, J, Fv, Fc and the heights of the curve are known but for a factor" in said and "weighed" in said


def test_a_controller_around_the_robot_changes_nothing_of_it(fits):
    controller = Controller(lambda r, y, s, p: {"u": 3.0 * (r["goal"] - y["v"])}, ("goal",))
    logs = LogSet([replace(log, extra=pd.DataFrame({"goal": np.ones(len(log.time))})) for log in driven(4)])
    loop, _ = closed_loop(Axis().with_values(Fc=0.5), logs, controller)
    loop = loop + effect_by_id(loop.alone, "sublinear_viscous_friction", "shape")
    told = without_shared_lines(like(fits[0], loop))
    assert {n for n in loop.parameters if told[n].status == "not_identifiable"} == {"Fv"}
