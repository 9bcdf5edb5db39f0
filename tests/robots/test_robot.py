"""The robots' common base: what a subclass gets for free, what an effect adds, what a compiled program depends on."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from jaxid import AXIS, Axis, Effect, Integrator, LogSet, Omni, Parameter, ParameterTable, Pioneer, Robot, simulate
from jaxid.robots import BUILT_IN


@dataclass(frozen=True)
class Bare(Robot):
    """A drive axis that states its physics and leaves everything else to the base."""

    name: ClassVar[str] = "bare"
    channels = AXIS

    @property
    def states(self):
        return ("q", "v", *self.extra_states)

    def defaults(self):
        return ParameterTable({"M": Parameter(1.3), "Fv": Parameter(2.0), "Fc": Parameter(0.5)})

    def rubbing(self, state, p):
        return (state["v"],)

    def coulomb(self, state, p):
        return ((p["Fc"], p["Fc"]),)

    def rates(self, state, inputs, dry, p):
        rates = {"q": state["v"], "v": (inputs[0] - p["Fv"] * state["v"] - dry[0]) / p["M"]}
        for effect in self.effects:
            rates |= effect.rates(state, inputs, p)
        return rates

    def observe(self, state, inputs, p):
        return state["v"], state["q"]


@dataclass(frozen=True)
class Counter(Effect):
    """An effect with a state and a parameter of its own: it integrates its rate."""

    id: ClassVar[str] = "counter"
    states: ClassVar[tuple[str, ...]] = ("count",)
    needs: ClassVar[tuple[str, ...]] = ("pose",)

    def parameters(self, robot):
        return {self.key("rate"): Parameter(3.0, "1/s")}

    def rates(self, state, currents, p):
        return {"count": p[self.key("rate")]}


def test_a_bare_subclass_sticks_and_slides_like_the_built_in_axis(axis_log):
    inputs = np.repeat(np.random.default_rng(3).uniform(-2, 2, 20), 5)
    logs = LogSet([axis_log("a", inputs, M=1.3)])
    bare = simulate(Bare(), logs, integrator=Integrator(2))[0]
    axis = simulate(Axis().with_values(M=1.3, Fv=2.0, Fc=0.5), logs, integrator=Integrator(2))[0]
    np.testing.assert_allclose(bare, axis, atol=1e-13)
    np.testing.assert_allclose(bare, logs[0].outputs, atol=1e-3)


def test_an_effect_brings_its_parameters_and_states_and_leaves_the_robot_alone():
    robot = Pioneer()
    more = robot + Counter()
    assert "counter.rate" in more.parameters and "counter.rate" not in robot.parameters
    assert more.states[-1] == "count" and {"x", "y", "theta"} <= set(more.states)  # the pose it asked for
    assert robot.effects == () and robot.states == ("beta", "eta1", "eta2")
    assert more.needs("pose") and not more.needs("wheel_angles")
    assert set(more.initial_state()) == set(more.states)
    changed = more.with_values(**{"counter.rate": 5.0}) + Counter()
    assert changed.parameters["counter.rate"].value == 5.0  # a second one keeps what was set


def test_a_compiled_program_depends_on_the_structure_and_not_on_the_numbers():
    for kind in BUILT_IN.values():
        one, other = kind(), kind().change(kind().parameters.free_names[0], value=0.123)
        assert one != other
        assert one.structure == other.structure and hash(one.structure) == hash(other.structure)
    assert Pioneer().structure != Pioneer(pose=True).structure
    assert Omni().structure != (Omni() + Counter()).structure


@pytest.mark.parametrize("kind", BUILT_IN.values())
def test_every_built_in_robot_is_consistent(kind):
    robot = kind()
    state, p = robot.initial_state(), robot.parameters.numbers
    axes = len(robot.rubbing(state, p))
    assert len(robot.coulomb(state, p)) == axes == len(robot.compliance(state, p))
    rates = robot.rates(state, (0.0,) * len(robot.channels.inputs), (0.0,) * axes, p)
    assert set(rates) == set(robot.states)
    assert len(robot.observe(state, (0.0,) * len(robot.channels.inputs), p)) == len(robot.channels.measured)
    assert set(robot.estimated_states) <= set(robot.states)
    assert robot.parameters.free_names


def test_what_a_robot_does_not_say_is_an_error_and_not_a_guess():
    with pytest.raises(NotImplementedError):
        Robot()
