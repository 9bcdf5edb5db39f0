"""One wheel that turns less easily than the other, on data of an independent simulation with sticking."""

import numpy as np
import pytest

from jaxid import (
    Axis,
    Channels,
    Custom,
    DifferentialDrive,
    DriveAxis,
    Log,
    LogSet,
    Omni,
    Parameter,
    Pioneer,
    explain,
    output_error,
)
from jaxid.effects import effect_by_id
from jaxid.robots.effect import EffectError

M, B = 12.0, 0.21
J = M * B**2
"""With this inertia a force at one rim accelerates that rim alone, by 2 / M: two axes that know nothing of each other."""


def recorded(dry, viscous, count=5, backward=None):
    """Speeds of a differential drive with the friction of its (right, left) wheel, by 200 semi-implicit steps a sample in which
    friction stops what it can stop; `backward` where its level is another that way."""
    backward = dry if backward is None else backward
    rng = np.random.default_rng(7)
    u = np.repeat(rng.uniform(-20, 20, (count, 30, 2)), 15, axis=1)
    s, h, rims = np.zeros((count, 2)), 1e-4, []
    for force in u.swapaxes(0, 1):
        rims.append(s)
        for _ in range(200):
            free = s + 2 * h / M * (force - viscous * s)
            s = np.sign(free) * np.maximum(np.abs(free) - 2 * h / M * np.where(free > 0, dry, backward), 0.0)
    right, left = np.moveaxis(np.array(rims), -1, 0)
    logs = []
    for k in range(count):
        v, w = (right + left)[:, k] / 2, (right - left)[:, k] / (2 * B)
        outputs = {"v": v + 0.004 * rng.normal(size=len(v)), "w": w + 0.01 * rng.normal(size=len(w))}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(len(v)), u[k], outputs, DifferentialDrive()))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dry", "viscous", "name", "mean"),
    [
        pytest.param((3.6, 2.0), (6.0, 6.0), "asymmetric_friction", ("Fc", 2.8), marks=pytest.mark.slow),
        ((2.0, 2.0), (4.0, 7.0), "asymmetric_viscous_friction", ("Fv", 5.5)),
    ],
)
def test_a_wheel_that_turns_less_easily_is_named_with_its_share(dry, viscous, name, mean):
    """Dry friction of one wheel was called a Stribeck friction that never falls off, and viscous friction had no name."""
    logs, held_out = recorded(dry, np.array(viscous))
    fit = output_error(DifferentialDrive().with_values(b=B, M=20.0, J=0.2, Fv=3.0, Fc=1.0), logs)
    found = explain(fit, logs, held_out)
    assert (found.verdict, [effect.id for effect in found.effects]) == ("named", [name])
    assert found.effects[0].law == "between_axes"
    right, left = dry if name == "asymmetric_friction" else viscous
    share = found.effects[0].parameters["difference_1"]
    assert (
        share.value == pytest.approx((right - left) / (right + left), abs=4 * share.std_error)
        and share.std_error < 2e-3
    )
    own = found.final[mean[0]]
    assert own.value == pytest.approx(mean[1], abs=4 * own.std_error)


@pytest.mark.slow
def test_a_wheel_that_rubs_more_and_more_one_way_than_the_other_is_one_law():
    """Asymmetries of each wheel alone left their levels alike, for which a dead zone of one motor stood in."""
    logs, held_out = recorded((4.2, 2.0), np.array([6.0, 6.0]), backward=(1.8, 2.0))
    fit = output_error(DifferentialDrive().with_values(b=B, M=20.0, J=0.2, Fv=3.0, Fc=1.0), logs)
    found = explain(fit, logs, held_out)
    assert (found.verdict, [effect.id for effect in found.effects]) == ("named", ["asymmetric_friction"])
    assert found.effects[0].law == "per_axis_and_between"
    own = found.effects[0].parameters
    for name, truth in (("difference_1", 0.2), ("asymmetry_1", 0.4), ("asymmetry_2", 0.0)):
        assert own[name].value == pytest.approx(truth, abs=4 * own[name].std_error) and own[name].std_error < 0.01
    assert found.final["Fc"].value == pytest.approx(2.5, abs=4 * found.final["Fc"].std_error)


def test_each_wheel_has_a_level_of_its_own_either_way():
    robot = DifferentialDrive().with_values(Fc=2.0)
    law = effect_by_id(robot, "asymmetric_friction", "per_axis_and_between")
    model = robot + law
    own = {"difference_1": 0.25, "asymmetry_1": 0.4, "asymmetry_2": -0.2}
    p = {**model.parameters.numbers, **{law.key(name): value for name, value in own.items()}}
    right, left = np.array(model.coulomb(dict.fromkeys(model.states, 0.0), p), float)
    # Backward and forward: the right wheel 2.5 N on average, the left one 1.5 N.
    assert right == pytest.approx([1.5, 3.5]) and left == pytest.approx([1.8, 1.2])


def test_friction_that_differs_already_cannot_differ_once_more():
    for name, word in (("asymmetric_friction", "dry"), ("asymmetric_viscous_friction", "viscous")):
        for robot, why in ((Omni(), f"{word} friction each of its own"), (Axis(), "one drive axis")):
            with pytest.raises(KeyError, match=why):
                effect_by_id(robot, name, "between_axes")
        law = type(effect_by_id(Pioneer(), name, "between_axes"))()
        with pytest.raises(EffectError, match="each of its own"):
            Omni() + law


def test_all_wheels_but_the_last_have_a_difference_and_friction_never_drives():
    robot = Custom(
        dynamics=lambda s, u, p, friction: {k: u["u"] - p["B"] * s[k] - friction[k] for k in ("a", "b", "c")},
        state_names=("a", "b", "c"), own_channels=Channels(("u",), ("a", "b", "c")),
        table={"C": Parameter(2.0, "N", free=True), "B": Parameter(1.0, "N s/m", free=True)},
        axes={k: DriveAxis(k, "C", "B", torque=lambda s, u, p: u["u"]) for k in ("a", "b", "c")},
        forces=dict.fromkeys(("a", "b", "c"), 1.0),
    )  # fmt: skip
    law = effect_by_id(robot, "asymmetric_friction", "between_axes")
    model = robot + law
    names = [name for name in model.parameters if "difference" in name]
    assert names == ["asymmetric_friction.difference_1", "asymmetric_friction.difference_2"]
    p = {**model.parameters.numbers, names[0]: 0.9, names[1]: 0.3}
    levels = model.coulomb(dict.fromkeys("abc", 0.0), p)
    assert np.array(levels, float)[:, 1] == pytest.approx([3.8, 2.6, 0.0])  # the third would be -0.4


def test_an_asymmetry_is_less_than_all_of_the_friction():
    """Beyond it friction would drive one way: what a slope under a robot that balances itself was called (1.34)."""
    for identifier in ("asymmetric_friction", "asymmetric_viscous_friction"):
        effect = effect_by_id(DifferentialDrive(), identifier)
        (asymmetry,) = effect.parameters(DifferentialDrive()).values()
        assert (asymmetry.lower, asymmetry.upper) == (-1.0, 1.0)


def test_friction_that_all_but_vanishes_one_way_is_a_push_and_no_gear_s():
    robot = DifferentialDrive()
    law = effect_by_id(robot, "asymmetric_friction", "per_axis")
    model = robot + law
    assert law.doubt(model.with_values(**{law.key("asymmetry_1"): 0.4, law.key("asymmetry_2"): -0.6})) == ""
    doubt = law.doubt(model.with_values(**{law.key("asymmetry_1"): 0.4, law.key("asymmetry_2"): -0.97}))
    assert doubt.startswith("dry friction that is 3 % of the usual one way and 197 % the other")
