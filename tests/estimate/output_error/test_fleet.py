"""jaxid/estimate/fleet.py: many axes in one batch give what each gives alone, and a bad one does not touch the rest."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Integrator, LogError, LogSet, ParameterError, Pioneer, fit_fleet, output_error
from jaxid.estimate.output_error import lanes

ROBOT = Axis().change("offset", free=False).with_values(M=1.0, Fv=2.0, Fc=0.5)
INPUTS = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 60)
MASSES = {"light": 0.8, "usual": 1.0, "heavy": 1.3}


def member(axis_log, mass, runs, noise=0.01, seed=0):
    return LogSet(
        axis_log(f"run {k}", np.roll(INPUTS, 60 * k)[: 360 - 40 * k], noise, seed + k, position=False, M=mass)
        for k in range(runs)
    )


@pytest.fixture(scope="module")
def fleet(axis_log):
    return {
        name: member(axis_log, mass, runs=1 + k, noise=0.005 * (1 + k), seed=10 * k)
        for k, (name, mass) in enumerate(MASSES.items())
    }


def test_every_member_gets_what_it_gets_alone(fleet):
    found = fit_fleet(ROBOT, fleet)
    assert found.failed == {} and list(found.fits) == list(MASSES)
    for name, fit in found.fits.items():
        alone = output_error(ROBOT, fleet[name])
        assert fit.converged and fit.noise["v"] == pytest.approx(alone.noise["v"], rel=0.01)
        assert set(fit.initial_states) == set(fleet[name].names) and set(fit.log_status.values()) == {"fitted"}
        for symbol in ROBOT.parameters.free_names:
            assert abs(fit[symbol].value - alone[symbol].value) < 0.05 * alone[symbol].std_error
            assert fit[symbol].std_error == pytest.approx(alone[symbol].std_error, rel=0.02)
        assert abs(fit["M"].value - MASSES[name]) < 4 * fit["M"].std_error
        assert name in repr(found)
    frame = found.to_pandas()
    assert list(frame.index.names) == ["member", "parameter"] and set(frame["verdict"]) == {"sound"}
    for name, fit in found.fits.items():
        row = frame.loc[(name, "M")]
        assert (row["value"], row["std_error"]) == (fit["M"].value, fit["M"].std_error)
        assert (row["ci95_low"], row["ci95_high"]) == fit["M"].ci95 and row["unit"] == "kg" and row["meaning"]
        assert frame.loc[(name, "offset"), "status"] == "fixed" and np.isnan(frame.loc[(name, "offset"), "std_error"])


@pytest.mark.parametrize("places, most", [(64, 3), (2, 2)])
def test_members_are_simulated_together_and_another_takes_the_place_of_each_that_ends(
    axis_log, monkeypatch, places, most
):
    alike, asked = {f"axis {k}": member(axis_log, 1.0, 1, seed=k) for k in range(3)}, []
    answered = lanes._answered

    def counted(questions, sizes):
        asked.append((questions[0].answered.__name__, len(questions)))
        return answered(questions, sizes)

    monkeypatch.setattr(lanes, "_answered", counted)
    monkeypatch.setattr(lanes, "_LANES", places)
    found = fit_fleet(ROBOT, alike)
    assert not found.failed and list(found.fits) == list(alike)
    assert asked[0] == ("linearised_together", most) and ("costs_together", most) in asked
    assert max(count for _, count in asked) == most


def test_a_member_whose_simulation_diverges_is_named_and_the_rest_stands(fleet):
    robots = {**dict.fromkeys(fleet, ROBOT), "wild": ROBOT.with_values(gain=1e200)}  # its speeds have no finite square
    sound = fit_fleet(ROBOT, fleet, integrator=Integrator(2))
    found = fit_fleet(robots, {**fleet, "wild": fleet["light"]}, integrator=Integrator(2))
    assert set(found.failed) == {"wild"} and "diverges" in found.failed["wild"] and "wild: " in repr(found)
    for name, fit in sound.fits.items():
        assert found.fits[name]["M"].value == pytest.approx(fit["M"].value, rel=1e-5)


def test_a_parameter_on_its_bound_is_marked_for_the_member_that_has_it(axis_log):
    without_friction = LogSet([axis_log("a", INPUTS, 0.01, 3, position=False, Fc=0.0)])
    fleet = {"usual": member(axis_log, 1.0, 1), "smooth": without_friction}
    found = fit_fleet(ROBOT.change("Fc", lower=0.05), fleet)
    assert found.fits["smooth"]["Fc"].status == "at_bound" and found.fits["smooth"]["Fc"].value == 0.05
    assert found.fits["usual"]["Fc"].status == "identified"


def test_a_start_that_sticks_is_left_as_by_a_single_fit(fleet):
    """With more friction than force nothing moves, and no sensitivity says why: the start used to be the answer."""
    two = {name: fleet[name] for name in ("light", "usual")}
    found = fit_fleet(ROBOT, two, start={"Fc": 50.0})
    for name, fit in found.fits.items():
        alone = output_error(ROBOT, two[name], start={"Fc": 50.0})
        assert fit.converged and fit.reason == alone.reason and fit.notes == alone.notes
        assert fit.cost == pytest.approx(alone.cost, rel=1e-6) and fit.start_cost > 100 * fit.cost
        assert abs(fit["M"].value - MASSES[name]) < 4 * fit["M"].std_error
        assert abs(fit["M"].value - alone["M"].value) < 1e-3 * fit["M"].std_error


def test_members_have_their_own_constants_starts_and_outliers(fleet):
    two = {name: fleet[name] for name in ("light", "usual")}
    robots = {"light": ROBOT.with_values(gain=2.0), "usual": ROBOT}
    starts = {"light": {"M": 2.0}, "usual": {"M": 0.9}}
    found = fit_fleet(robots, two, start=starts, loss="huber")
    for name, fit in found.fits.items():
        alone = output_error(robots[name], two[name], start=starts[name], loss="huber")
        assert len(fit.outliers) == len(alone.outliers)
        for symbol in ROBOT.parameters.free_names:
            assert abs(fit[symbol].value - alone[symbol].value) < 0.01 * alone[symbol].std_error
    assert found.fits["light"]["M"].value == pytest.approx(2.0 * MASSES["light"], rel=0.02)


@pytest.mark.slow
def test_members_have_their_own_clocks(fleet):
    """The light robot's outputs were stamped 10 ms late: its inputs' clock is behind."""
    late = LogSet(replace(log, outputs=shifted(log)) for log in fleet["light"])
    two = {"light": late, "usual": fleet["usual"][:1]}
    found = fit_fleet(ROBOT, two, clock_offset=True, covariance="robust", windows=None)
    for name, ahead in (("light", -0.01), ("usual", 0.0)):
        (offset,) = found.fits[name].clock_offsets.values()
        assert abs(offset.value - ahead) < 4 * offset.std_error < 0.005
        assert found.fits[name].standard_errors == "robust"
        assert abs(found.fits[name]["M"].value - MASSES[name]) < 0.01


def shifted(log):
    """What was measured half a sample before, between two samples of a speed."""
    earlier = np.concatenate([log.outputs[:1], log.outputs[:-1]])
    return 0.5 * (log.outputs + earlier)


@pytest.mark.slow
def test_casters_at_unknown_angles_are_found_in_the_batch(demo_logs):
    """Two Pioneers, whose casters nobody saw: every member gets what it gets alone."""
    logs = demo_logs("pioneer", "fit_[cm]*")
    members = {log.name: LogSet([log.window(0.0, 6.0)]) for log in logs[:2]}
    found = fit_fleet(Pioneer(), members, initial_states="estimate")
    assert found.failed == {} and len(found.fits) == 2
    for name, fit in found.fits.items():
        alone = output_error(Pioneer(), members[name], initial_states="estimate")
        ((_, own),), ((_, single),) = fit.initial_states.items(), alone.initial_states.items()
        assert own["beta"] == pytest.approx(single["beta"], abs=1e-4)
        assert fit["Cs"].value == pytest.approx(alone["Cs"].value, abs=0.01 * alone["Cs"].std_error)


def test_errors_name_what_is_missing(fleet):
    with pytest.raises(LogError, match="no member"):
        fit_fleet(ROBOT, {})
    with pytest.raises(ParameterError, match="no parameter 'mass'"):
        fit_fleet(ROBOT, fleet, start={"mass": 1.0})
    one, *others = fleet
    with pytest.raises(ParameterError, match=f"no robot is given for .*{others[0]}.* there are no logs of other"):
        fit_fleet({one: ROBOT, "other": ROBOT}, fleet)
