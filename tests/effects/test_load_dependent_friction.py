"""Friction that grows with the drive torque, against Newton's law of one mass."""

import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    DriveAxis,
    EffectError,
    Integrator,
    Log,
    LogSet,
    Omni,
    Parameter,
    ParameterTable,
    Pioneer,
    explain,
    output_error,
)
from jaxid.effects import effect_by_id
from jaxid.effects.drivetrain.load_dependent_friction import (
    LoadDependentFriction,
    LoadOfAnyPower,
    LoadOfAxes,
    TwoEfficiencies,
)
from jaxid.simulation.simulate import simulate

MASS, COULOMB, SHARE = 2.0, 1.0, 0.2
LAWS = {"share_of_torque": {"share": SHARE}, "driving_and_driven": {"driving": SHARE, "driven": SHARE}}


AXIS = Axis().with_values(M=MASS, Fv=0.0, Fc=COULOMB)
OWN = Custom(  # says the torque of its axis and at which speed it rubs, and no angle
    dynamics=lambda s, u, p, friction: {"v": (u["F"] - friction["wheel"]) / p["M"]},
    state_names=("v",),
    own_channels=Channels(inputs=("F",), outputs=("v",), units={"F": "N", "v": "m/s"}),
    table=ParameterTable({"M": Parameter(MASS, "kg"), "Fc": Parameter(COULOMB, "N")}),
    axes={"wheel": DriveAxis(speed="v", coulomb="Fc", torque=lambda s, u, p: u["F"])},
)


def speeds(law, forces, robot=AXIS):
    """Speeds [T] under the `forces` [T], 0.02 s each."""
    effect = effect_by_id(robot, "load_dependent_friction", law)
    robot = (robot + effect).with_values(**{effect.key(name): value for name, value in LAWS[law].items()})
    inputs, still = np.asarray(forces)[:, None], np.zeros((len(forces), 1))
    log = Log.from_arrays("run", 0.02 * np.arange(len(forces)), inputs, still, robot)
    return simulate(robot, LogSet([log]), integrator=Integrator(8))[0][:, 0]


@pytest.mark.parametrize("robot", [AXIS, OWN], ids=["axis", "own"])
@pytest.mark.parametrize("law", LAWS)
def test_a_gear_that_stands_loses_what_it_loses_once_it_turns(law, robot):
    """It breaks away where `torque (1 - share)` exceeds the Coulomb level, either way, and not before."""
    breaks = COULOMB / (1.0 - SHARE)
    for way in (1.0, -1.0):
        assert np.abs(speeds(law, np.full(50, 0.97 * way * breaks))).max() < 1e-9
        found = speeds(law, np.full(50, 1.2 * way * breaks), robot)
        assert found[-1] == pytest.approx(way * (1.2 - 1.0) * COULOMB / MASS * 0.98, rel=0.01)


@pytest.mark.parametrize("law", LAWS)
def test_braking_takes_more_than_the_torque_and_then_it_stands(law):
    forces = np.concatenate([np.full(50, 5.0), np.full(100, -1.2)])
    found = speeds(law, forces)
    fastest = (5.0 * (1.0 - SHARE) - COULOMB) / MASS
    stops = fastest * MASS / (1.2 * (1.0 + SHARE) + COULOMB)
    np.testing.assert_allclose(found[50:100], fastest * (1.0 - np.arange(50) * 0.02 / stops), atol=0.005 * fastest)
    assert stops < 1.9 and abs(found[-1]) < 1e-9  # 1.2 N less a fifth is not enough to go back


@pytest.mark.parametrize("exponent", [0.7, 1.0, 1.5])
def test_another_power_loses_as_much_at_the_largest_torque(exponent):
    """At half of it, by Newton's law, half of that to the power of the exponent."""
    robot = Axis().with_values(M=MASS, Fv=0.0, Fc=COULOMB)
    effect = LoadDependentFriction().freer
    assert effect is not None and effect == effect_by_id(robot, "load_dependent_friction", "power_of_torque")
    robot = robot + effect
    largest = robot.parameters[effect.key("largest")].value
    robot = robot.with_values(**{effect.key("share"): SHARE, effect.key("exponent"): exponent})
    for force in (largest, 0.5 * largest):
        rates = robot.rates({"v": 1.0}, (force,), (COULOMB,), robot.parameters.numbers)
        lost = SHARE * largest * (force / largest) ** exponent
        assert float(rates["v"]) == pytest.approx((force - lost - COULOMB) / MASS, rel=1e-6)


def test_one_that_begins_softly_loses_hardly_anything_of_small_torques_and_less_of_large_ones_by_what_that_is():
    robot = Axis().with_values(M=MASS, Fv=0.0, Fc=COULOMB)
    effect = LoadOfAnyPower().freer
    assert effect is not None and effect.freer is None and effect.restricts == {"soft": 0.0}
    for soft in (0.0, 2.0):
        with_it = (robot + effect).with_values(**{effect.key("share"): SHARE, effect.key("soft"): soft})
        for force in (0.1, 6.0):
            rates = with_it.rates({"v": 1.0}, (force,), (COULOMB,), with_it.parameters.numbers)
            lost = SHARE * (np.hypot(force, soft) - soft)
            assert float(rates["v"]) == pytest.approx((force - lost - COULOMB) / MASS, rel=1e-6)


def test_a_gear_takes_from_the_torque_and_never_adds_to_it():
    """Else a dead zone, which brakes less than it drives, has the name of a negative loss."""
    for law in (LoadDependentFriction(), TwoEfficiencies()):
        assert all(p.lower == 0.0 for p in law.parameters(Axis()).values() if p.free)


def omni_rates(state, law="", **sizes):
    """Accelerations of an omni without other friction, by Newton's law, under volts that drive it ahead and turn it left."""
    none = {name: 0.0 for name in ("Bv", "Bvn", "Bw", "Cv", "Cvn", "Cw")}
    robot = Omni().with_values(**none)
    if law:
        effect = effect_by_id(robot, "load_dependent_friction", law)
        robot = (robot + effect).with_values(**{effect.key(name): value for name, value in sizes.items()})
    rates = robot.rates(dict(zip(("V", "Vn", "W"), state, strict=True)), (2.0, -4.0, 2.0, 8.0), (0.0, 0.0, 0.0),
                        robot.parameters.numbers)  # fmt: skip
    return np.array([float(rates[name]) for name in ("V", "Vn", "W")])


def test_where_a_body_s_axes_rub_what_drives_them_is_lost_in_part():
    ahead, back = (0.5, 0.0, 0.3), (-0.2, 0.0, 0.3)
    for state in (ahead, back):
        free, lossy = omni_rates(state), omni_rates(state, "share_of_axis", share=SHARE)
        # Driven ahead and to the left: what is lost of it drags whichever way the axis moves.
        assert free[0] > 0 and free[2] > 0
        np.testing.assert_allclose(lossy[[0, 2]], free[[0, 2]] * (1.0 - SHARE * np.sign(state)[[0, 2]]), rtol=1e-6)
    both = {"driving": SHARE, "driven": 0.5 * SHARE}
    np.testing.assert_allclose(
        omni_rates(ahead, "driving_and_driven_axis", **both)[[0, 2]],
        omni_rates(ahead)[[0, 2]] * (1.0 - SHARE),
        rtol=1e-6,
    )
    held_back = omni_rates(back, "driving_and_driven_axis", **both)
    assert held_back[0] == pytest.approx(omni_rates(back)[0] * (1.0 + 0.5 * SHARE))


def test_an_axis_of_its_own_motor_has_the_gear_s_laws():
    with pytest.raises(EffectError, match="those of its motors"):
        Pioneer() + LoadOfAxes()


def rounded(force):
    """A loss in proportion to large forces that begins with the square of small ones."""
    return 0.09 * (np.hypot(force, 0.6) - 0.6)


def root(force):
    """One that grows slower than the force."""
    return 0.25 * abs(force) ** 0.7


def lossy(loss, seed, samples=800, dt=0.02, fine=40):
    """A log of an axis that loses some of the force, by small steps of Euler's method that stop where dry friction does."""
    random = np.random.default_rng(seed)
    forces, found, v = np.repeat(random.uniform(-8, 8, samples // 25), 25), np.zeros(samples), 0.0
    for k, force in enumerate(forces):
        found[k] = v
        lost = COULOMB + loss(force)
        for _ in range(fine):
            pushed = v + dt / fine / MASS * (force - 3.0 * v)
            v = np.sign(pushed) * max(abs(pushed) - dt / fine / MASS * lost, 0.0)
    seen = found + 0.006 * random.normal(size=samples)
    return Log.from_arrays(f"{seed}", dt * np.arange(samples), forces[:, None], seen[:, None], Axis())


def explained(loss):
    """What an axis with such a loss is said to miss."""
    fit, held_out = (LogSet([lossy(loss, k) for k in seeds]) for seeds in (range(4), (10, 11)))
    robot = Axis().with_values(offset=0.0).change("offset", free=False)
    return explain(output_error(robot, fit), fit, held_out)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxid.LogWarning")
def test_dry_friction_beside_a_law_that_is_only_near_the_right_one_holds_the_truth():
    """A power of the torque takes for its own what the rounded loss has not at small ones, and leaves less to dry friction."""
    story = explained(rounded)
    assert [(effect.id, effect.law) for effect in story.effects] == [("load_dependent_friction", "power_of_torque")]
    assert any("with a freer form" in note for note in story.notes)
    for name, true in {"M": MASS, "Fv": 3.0, "Fc": COULOMB}.items():
        estimate = story.final[name]
        assert abs(estimate.value - true) < 2.0 * estimate.std_error < 0.06 * true, name


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxid.LogWarning")
def test_a_loss_that_is_no_share_of_the_force_is_named_by_its_power():
    """By a curve from the origin dry friction is another one: where the axis stands the curve is not seen."""
    story = explained(root)
    assert [(effect.id, effect.law) for effect in story.effects] == [("load_dependent_friction", "power_of_torque")]
    known = {"M": MASS, "Fv": 3.0, "Fc": COULOMB, "load_dependent_friction.exponent": 0.7}
    for name, true in known.items():
        estimate = story.final[name]
        assert abs(estimate.value - true) < 2.5 * estimate.std_error < 0.25 * true, name
