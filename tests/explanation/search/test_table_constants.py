"""jaxid/explanation/search/table_constants.py: a wrong constant of the table beside the name of what looks the same."""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import Channels, Custom, DifferentialDrive, Log, LogSet, Parameter, Pioneer, explain, output_error
from jaxid.effects import effect_by_id
from jaxid.effects.table_constants import TableConstants
from jaxid.explanation.left.heldout import HeldOut
from jaxid.explanation.refits.refit import Trial, refit, refit_from_itself
from jaxid.explanation.search import said_of_constants, table_constants
from jaxid.explanation.search.said_of_constants import found_wrong
from jaxid.explanation.search.table_constants import (
    changed_by,
    constants_as_well,
    constants_instead,
    constants_like,
    effects_that_are,
)
from jaxid.logs.windows import in_windows
from jaxid.model_file import read_model

DT, NOISE = 0.02, 0.005


def dynamics(state, inputs, p):
    return {"v": (p["radius"] * inputs["spin"] - state["v"]) / p["T"]}


def drive(radius):
    """A drive that is told how fast its wheels are to spin, and follows with a lag; the radius is known from the table."""
    return Custom(
        dynamics=dynamics,
        state_names=("v",),
        own_channels=Channels(("spin",), ("v",), (), {"spin": "rad/s", "v": "m/s"}),
        table={"T": Parameter(0.3, "s", lower=0.0, free=True), "radius": Parameter(radius, "m")},
    )


def log(name, seed, robot, curve=0.0):
    """In closed form: the speed goes exponentially to 0.1 m times the spin, each held; `curve` bends the command."""
    rng = np.random.default_rng(seed)
    spin = np.repeat(rng.uniform(-10.0, 10.0, 20), 15)
    acting, v, seen = 0.1 * spin * (1.0 - curve * np.abs(spin) / 10.0), 0.0, []
    for final in acting:
        seen.append(v)
        v = final + (v - final) * np.exp(-DT / 0.3)
    outputs = np.array(seen) + NOISE * rng.normal(size=300)
    return Log.from_arrays(name, DT * np.arange(300), spin[:, None], outputs[:, None], robot.channels)


def explained(radius, curve=0.0):
    robot = drive(radius)
    fitted = LogSet([log("a", 0, robot, curve), log("b", 1, robot, curve)])
    return explain(output_error(robot, fitted), fitted, LogSet([log("held", 2, robot, curve)]))


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.104, 0.07])
def test_a_wrong_radius_is_named_beside_the_sensors_scale_with_its_error(radius):
    found = explained(radius)
    assert [effect.id for effect in found.effects] == ["sensor_scale"]
    (said,) = [note for note in found.notes if "a wrong constant in the table" in note]
    share = float(said.partition("radius (")[2].partition(" %")[0])
    assert share == pytest.approx(100 * (0.1 / radius - 1.0), abs=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("known", [{}, {"drag": Parameter(1e-3, "1/m")}], ids=["no constant", "another constant"])
def test_a_length_that_is_written_into_the_model_is_said_beside_the_sensors_scale(known):
    """The radius is no parameter, so that nothing of the table does as well in the sensor's place."""
    own = Custom(
        dynamics=lambda state, inputs, p: {
            "v": (0.104 * inputs["spin"] - state["v"]) / p["T"] - (p["drag"] * state["v"] ** 3 if known else 0.0)
        },
        state_names=("v",),
        own_channels=Channels(("spin",), ("v",), (), {"spin": "rad/s", "v": "m/s"}),
        table={"T": Parameter(0.3, "s", lower=0.0, free=True), **known},
    )
    fitted = LogSet([log("a", 0, own), log("b", 1, own)])
    found = explain(output_error(own, fitted), fitted, LogSet([log("held", 2, own)]))
    assert [effect.id for effect in found.effects] == ["sensor_scale"]
    assert any("built in wrongly" in note for note in found.notes)


def test_where_the_table_holds_the_wrong_constant_no_number_outside_it_is_blamed():
    assert not any("built in wrongly" in note for note in explained(0.104).notes)


def test_what_no_constant_does_is_called_by_its_name_alone():
    found = explained(0.1, curve=0.3)
    assert found.effects and not any("wrong constant" in note for note in found.notes)


def slowing(state, inputs, p):
    """What drives it wanes with its speed: gone at the `limit`, which the table holds."""
    speed = state["v"]
    return {"v": (0.1 * inputs["spin"] * (1.0 - (speed / p["limit"]) ** 2) - speed) / p["T"]}


def slowed(name, seed, limit):
    """By SciPy, the command held for 0.3 s each."""
    rng = np.random.default_rng(seed)
    levels, at, seen = rng.uniform(-15.0, 15.0, 20), 0.0, []
    for level in levels:
        span = DT * np.arange(16)
        way = solve_ivp(
            lambda _, v, u=level: (0.1 * u * (1.0 - (v / limit) ** 2) - v) / 0.3,
            (0.0, 0.3),
            [at],
            t_eval=span,
            rtol=1e-9,
        )
        seen += list(way.y[0, :15])
        at = way.y[0, 15]
    spin, outputs = np.repeat(levels, 15), np.array(seen) + NOISE * rng.normal(size=300)
    return Log.from_arrays(name, DT * np.arange(300), spin[:, None], outputs[:, None], SLOWED.channels)


SLOWED = Custom(
    dynamics=slowing,
    state_names=("v",),
    own_channels=Channels(("spin",), ("v",), (), {"spin": "rad/s", "v": "m/s"}),
    table={"T": Parameter(0.3, "s", lower=0.0, free=True), "limit": Parameter(1.65, "m/s")},
)


def test_an_effect_that_is_nothing_but_a_constant_of_the_table_is_that_one():
    assert effects_that_are(["L"], Pioneer()) == ("effective_track",)
    assert effects_that_are(["R"], Pioneer()) == effects_that_are(["L", "R"], Pioneer()) == ()
    # A centre of mass on the axis of symmetry is nothing that a table has wrong.
    assert effects_that_are(["xm"], Pioneer().with_values(xm=0.0)) == ()
    state = HeldOut(1.0, {"eta1": 1.0}, (np.ones((10, 1)),), {"eta1": 1.0}, 0.5)
    before = Trial("", Pioneer(), 100.0, 8, state, lambda: state, {})
    wider = (Pioneer() + effect_by_id(Pioneer(), "effective_track")).with_values(L=1.05 * 0.1689)
    after = Trial("effective_track", wider, 10.0, 9, state, lambda: state, {})
    some = LogSet([slowed("a", 0, 1.5)])  # not looked at
    ((shares, _),) = constants_like(before, after, some, some)
    assert shares == {"L": pytest.approx(0.05)}


@pytest.mark.slow
def test_a_wrong_constant_that_no_effect_stands_for_is_itself_what_is_found(tmp_path):
    fitted = LogSet([slowed("a", 0, 1.5), slowed("b", 1, 1.5)])
    found = explain(output_error(SLOWED, fitted), fitted, LogSet([slowed("held", 2, 1.5)]))
    assert [effect.id for effect in found.effects] == ["table_constants"] and found.verdict == "named"
    (effect,) = found.effects
    assert effect.parameters["limit"].ci95[0] < 1.5 < effect.parameters["limit"].ci95[1]
    assert effect.constants[0]["limit"] == pytest.approx(1.5 / 1.65 - 1.0, abs=0.01)
    assert any("limit by -9" in note for note in found.notes)
    assert found.sentence.startswith("Missing was the right value of limit:")
    found.save(tmp_path)
    again = read_model(tmp_path / "model.toml", SLOWED)
    assert again.parameters["limit"].value == effect.parameters["limit"].value


def braked(state, inputs, p):
    """Drag and a wind beside a rolling resistance; `excess` makes all three those of another wheel: push and wind by as much
    more as the drag is less."""
    speed, more = state["v"], 1.0 + p["excess"]
    driving = more * (p["push"] * inputs["spin"] - p["wind"])
    return {"v": (driving - speed - p["drag"] / more * speed * jnp.abs(speed)) / p["T"]}


BRAKED = Custom(
    dynamics=braked,
    state_names=("v",),
    own_channels=Channels(("spin",), ("v",), (), {"spin": "rad/s", "v": "m/s"}),
    table={
        "T": Parameter(0.3, "s", lower=0.0, free=True),
        "excess": Parameter(0.01, ""),
        "push": Parameter(0.1 / 1.0504, "m"),
        "wind": Parameter(0.5 / 1.0504, "m/s"),
        "drag": Parameter(0.4 * 1.0504, "s/m"),
    },
)


def braked_log(name, seed):
    """By SciPy, of a push of 0.1 m, a wind of 0.5 m/s and a drag of 0.4 s/m, the command held for 0.3 s each."""
    rng = np.random.default_rng(seed)
    levels, at, seen = rng.uniform(-20.0, 20.0, 20), 0.0, []
    for level in levels:
        rate = lambda _, v, u=level: (0.1 * u - 0.5 - v - 0.4 * v * np.abs(v)) / 0.3  # noqa: E731
        way = solve_ivp(rate, (0.0, 0.3), [at], t_eval=DT * np.arange(16), rtol=1e-9)
        seen, at = [*seen, *way.y[0, :15]], way.y[0, 15]
    spin, outputs = np.repeat(levels, 15), np.array(seen) + NOISE * rng.normal(size=300)
    return Log.from_arrays(name, DT * np.arange(300), spin[:, None], outputs[:, None], BRAKED.channels)


@pytest.mark.slow
def test_where_one_constant_would_have_to_be_wrong_by_too_much_others_together_are_found():
    fitted = LogSet([braked_log("a", 0), braked_log("b", 1)])
    found = explain(output_error(BRAKED, fitted), fitted, LogSet([braked_log("held", 2)]))
    assert [effect.id for effect in found.effects] == ["sensor_scale"]
    (said,) = [note for note in found.notes if "3 wrong constants in the table" in note]
    shares = {name: float(said.partition(f"{name} (")[2].partition(" %")[0]) for name in ("push", "wind", "drag")}
    assert shares == {
        "push": pytest.approx(4.0, abs=0.6),
        "wind": pytest.approx(4.0, abs=1.5),
        "drag": pytest.approx(-3.8, abs=1.5),
    }


def test_a_constant_of_a_set_that_is_right_is_left_out(monkeypatch):
    """Of three that were chosen to first order, the wind alone is wrong: without it no model is as good."""
    begun = []

    def refitted(robot, like, *_):
        begun.append(robot.parameters["wind"].value)
        freed = robot.effects[0].constants
        return SimpleNamespace(robot=robot, score=100.0 + 7.0 * len(freed) + (0.0 if "wind" in freed else 500.0))

    monkeypatch.setattr(table_constants, "refit_from_itself", refitted)
    before = SimpleNamespace(robot=BRAKED, held_out=SimpleNamespace(noise={}))
    every = ("push", "wind", "drag")
    robot = (BRAKED + TableConstants(every)).with_values(wind=0.52)
    found, needed = table_constants._needed(before, SimpleNamespace(robot=robot, score=121.0), every, None, None)
    assert needed == ("wind",) and found.score == 107.0
    table = BRAKED.parameters["wind"].value
    assert all(value == pytest.approx(0.52) or value == table for value in begun) and 0.52 in begun
    assert not found.robot.parameters["push"].free and found.robot.parameters["push"].value == pytest.approx(
        0.1 / 1.0504
    )


@pytest.mark.slow
def test_a_part_of_the_mass_that_the_table_has_none_of_is_beside_the_offset_that_does_as_much():
    """A geared drive, by SciPy: the rotors' share of the mass has no offset."""
    carried, rotors, offset, known = 9.0, 6.0, 0.08, {"b": 0.25, "Fc": 0.0, "xc": 0.08}

    def run(name, seed):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.uniform(-12.0, 12.0, (20, 2)), 15, axis=0)
        state, seen = np.zeros(2), []
        for right, left in u:
            seen.append(state)

            def rates(_, state, right=right, left=left):
                v, w = state
                ahead = right + left - 12.0 * v + carried * offset * w**2
                turn = 0.25 * (right - left) - 12.0 * 0.25**2 * w - carried * offset * v * w
                return [ahead / (carried + rotors), turn / (0.9 + carried * offset**2)]

            state = solve_ivp(rates, (0.0, DT), state, rtol=1e-9, atol=1e-10).y[:, -1]
        outputs = np.array(seen) + rng.normal(size=(300, 2)) * [0.002, 0.004]
        return Log.from_arrays(name, DT * np.arange(300), u, outputs, "differential")

    robot = DifferentialDrive().with_values(M=12.0, J=1.0, Fv=5.0, **known).change("Fc", free=False)
    logs = LogSet([run("a", 0), run("b", 1)])
    found = explain(output_error(robot, logs), logs, LogSet([run("c", 2)]))
    assert found.verdict == "ambiguous" and found.after.normalised_rms < 1.05
    (said,) = [note for note in found.notes if "a wrong constant in the table" in note]
    share = float(said.partition("Mr (")[2].partition(" % of M in place of none")[0])
    assert share == pytest.approx(100 * rotors / (carried + rotors), abs=1.5)


def product(state, inputs, p):
    """What drives is a product of two constants, limited by a third."""
    speed = state["v"]
    driving = 0.1 * p["first"] * p["second"] * inputs["spin"] * (1.0 - (speed / 1.5) ** 2)
    return {"v": (driving - speed + 0.3 * speed * (speed / p["third"]) ** 2) / p["T"]}


def test_another_constant_that_does_the_same_as_the_wrong_one_is_said():
    table = {"T": Parameter(0.3, "s", lower=0.0, free=True)}
    table |= {"first": Parameter(1.05, ""), "second": Parameter(2.0, ""), "third": Parameter(1e3, "m/s")}
    robot = Custom(dynamics=product, state_names=("v",), own_channels=SLOWED.own_channels, table=table)
    logs, held = LogSet([halved("a", 0), halved("b", 1)]), LogSet([halved("c", 2)])
    noise = {"v": NOISE}
    before = refit(robot, [{"T": 0.3}], logs, held, noise, {})
    freed = robot + TableConstants(("first",))
    after = replace(refit_from_itself(freed, before, logs, held, noise), id="table_constants")
    assert after.robot.parameters["first"].value == pytest.approx(1.0, abs=0.01)
    (other,) = constants_as_well(before, after, logs, held)
    assert other.shares == {"second": pytest.approx(1.0 / 1.05 - 1.0, abs=0.01)}
    said = found_wrong([{"first": -0.0476}, other.shares], robot)
    assert "the value of first by -4.8 %; or else of second (-4.8 %)" in said


def test_constants_are_tried_in_windows_too():
    """Each window begins with a state of its own, which takes up a part of what a constant does."""
    table = {"T": Parameter(0.3, "s", lower=0.0, free=True)}
    table |= {"first": Parameter(1.05, ""), "second": Parameter(2.0, ""), "third": Parameter(1e3, "m/s")}
    robot = Custom(dynamics=product, state_names=("v",), own_channels=SLOWED.own_channels, table=table)
    logs, held = (
        in_windows(LogSet([halved(n, k) for n, k in own]), 0.5) for own in ((("a", 0), ("b", 1)), (("c", 2),))
    )
    before = refit(robot, [{"T": 0.3}], logs, held, {"v": NOISE}, {})
    right = constants_instead(before, None, logs, held)
    assert right is not None and right.effect.id == "table_constants"
    ((name, share),) = changed_by(right.effect.frees(robot), robot, right.robot.parameters).items()
    assert name in ("first", "second") and share == pytest.approx(1.0 / 1.05 - 1.0, abs=0.02)


def halved(name, seed):
    """`slowed` by its limit, of commands that are half: the product of the two constants is 2."""
    one = slowed(name, seed, 1.5)
    return Log.from_arrays(name, one.time, one.inputs / 2.0, one.outputs, SLOWED.channels)


def test_many_sets_that_have_one_constant_in_common_are_said_by_that():
    robot = Pioneer()
    found = [{"L": -0.03, other: 0.02} for other in ("R", "M", "Ra")]
    assert said_of_constants._listed(found, robot) == "L (-3 %) and one of R (+2 %), M (+2 %), Ra (+2 %)"
    assert said_of_constants._listed(found[:2], robot) == "L (-3 %) and R (+2 %) or L (-3 %) and M (+2 %)"


def test_what_all_motors_have_alike_is_asked_of_constants_though_angles_are_prescribed(monkeypatch):
    """Beside a ripple, whose angles are prescribed, nothing is known to first order; shares that are alike are a constant's."""
    state = HeldOut(1.0, {"eta1": 1.0}, (np.ones((100, 1)),), {"eta1": 1.0}, 0.5)
    bare = Pioneer()
    mismatch = bare + effect_by_id(bare, "motor_gain_mismatch", "torque_constant")
    first, second = mismatch.effects[0].either_nominal(mismatch)
    before = Trial("", bare, 500.0, 8, state, lambda: state, {}, {"phi2": ()})  # angles that are prescribed
    asked = []

    def freed(before, names, *others):
        asked.append(names)
        robot = (before.robot + TableConstants(names)).with_values(**{names[0]: 1.03 * bare.parameters[names[0]].value})
        return SimpleNamespace(
            robot=robot, fitted=state, free=9, squares=10.0 if names == ("Ra",) else 900.0, score=1.0
        )

    monkeypatch.setattr(table_constants, "_with_freed", freed)
    monkeypatch.setattr(table_constants, "told_apart_from", lambda best, trial: trial.squares > 20.0)

    def like(*shares):
        robot = mismatch.with_values(**dict(zip((first, second), shares, strict=True)))
        after = Trial("motor_gain_mismatch", robot, 10.0, 10, state, lambda: state, {}, {"phi2": ()})
        return [wrong.shares for wrong in constants_like(before, after, None, None)]

    assert like(-0.035, -0.0354) == [{"Ra": pytest.approx(0.03)}] and len(asked) > 3
    asked.clear()
    assert like(-0.035, 0.01) == [] and not asked
