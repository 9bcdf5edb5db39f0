"""The omni and a user's own robot (a driven pendulum): the same problems for jaxid and C++, data by jaxid's simulation.

Start 10 % off. The pendulum's runs begin hanging at rest, as `mujoco.sysid`, which fits no initial states, needs it; samples
are a step of the integrator apart, so that MuJoCo's Runge-Kutta steps are the same.
"""

from dataclasses import dataclass, replace

import numpy as np

from jaxid import Channels, Custom, Integrator, Log, LogSet, Omni, Parameter, Robot, float64, simulate
from jaxid.estimate.output_error.problem import Problem, Structure, Unknowns, parameters_at
from jaxid.estimate.output_error.setup import build

from .cpp_fit import OMNI_FIXED, CppTask

OFF = 1.1
"""Start over truth."""
_HELD = 1e12
"""Weight of a prior that lets an initial state not move."""
PENDULUM = {"inertia": 0.05, "weight": 1.5, "friction": 0.02}
PENDULUM_CHANNELS = Channels(("u",), ("q", "w"), units={"u": "N m", "q": "rad", "w": "rad/s"})
GEAR = 1.0


@dataclass(frozen=True)
class OtherProblem:
    """`robot` at the truth; logs; noise `sigma` [ny]; free initial states or not; seconds between samples."""

    robot: Robot
    logs: LogSet
    sigma: np.ndarray
    initial: str
    interval: float
    substeps: int

    def built(self) -> tuple[Structure, Problem, Unknowns]:
        """jaxid's problem, in these weights."""
        with float64():
            start = {name: OFF * self.robot.parameters[name].value for name in self.robot.parameters.free_names}
            structure, arrays, unknowns = build(
                self.robot, self.logs, start=start, initial=self.initial, integrator=Integrator(self.substeps)
            )
            shown = np.asarray(arrays.sigma).copy()
            shown[: len(self.sigma)] = self.sigma
            return structure, replace(arrays, sigma=shown), unknowns

    def task(self, kind: str) -> CppTask:
        """The same for C++."""
        p = self.robot.parameters
        scale = np.array([p[name].value for name in p.free_names])
        order, s = list(p.free_names), len(self.robot.estimated_states)
        if isinstance(self.robot, Omni):
            robot, constants, names = "omni", [p[n].value for n in OMNI_FIXED], "J Bv Bvn Bw Cv Cvn Cw".split()
        else:
            robot, constants, names = "pendulum", [GEAR], list(PENDULUM)
        inputs, outputs = (np.stack([getattr(log, what) for log in self.logs]) for what in ("inputs", "outputs"))
        return CppTask(
            robot,
            kind,
            inputs,
            outputs[:, :, : len(self.sigma)],
            np.array(constants),
            scale[[order.index(n) for n in names]],
            self.sigma,
            np.full(s, 0.0 if self.initial == "estimate" else _HELD),
            interval=self.interval,
            substeps=self.substeps,
            state_scale=1.0,
        )

    def start_point(self) -> np.ndarray:
        """C++'s start: parameters over the truth, initial states at rest."""
        n, s = len(self.robot.parameters.free_names), len(self.robot.estimated_states)
        return np.concatenate([np.full(n, OFF), np.zeros(s * len(self.logs))])

    def point_of(self, structure: Structure, arrays: Problem, unknowns: Unknowns) -> np.ndarray:
        """jaxid's unknowns in C++'s order and units."""
        task, s = self.task("scalar"), len(self.robot.estimated_states)
        theta = dict(zip(structure.names, np.asarray(parameters_at(arrays, unknowns.z)), strict=True))
        names = "J Bv Bvn Bw Cv Cvn Cw".split() if isinstance(self.robot, Omni) else list(PENDULUM)
        states = np.zeros((len(self.logs), s))
        if self.initial == "estimate":
            states = np.asarray(unknowns.states) * np.asarray(arrays.state_scale)
        return np.concatenate([np.array([theta[name] for name in names]) / task.scale, states.ravel()])


def _problem(
    robot: Robot, inputs: np.ndarray, sigma: np.ndarray, initial: str, interval: float, substeps: int, seed: int
) -> OtherProblem:
    time, channels = interval * np.arange(inputs.shape[1]), robot.channels

    def logs(outputs: list[np.ndarray]) -> LogSet:
        return LogSet(
            Log.from_arrays(
                f"run {e + 1}",
                time,
                dict(zip(channels.inputs, inputs[e].T, strict=True)),
                dict(zip(channels.outputs, outputs[e].T, strict=True)),
                robot,
            )
            for e in range(len(inputs))
        )

    E, rng = len(inputs), np.random.default_rng(seed)
    nothing = [np.zeros((len(time), len(sigma)))] * E
    begin = {name: np.full(E, float(value)) for name, value in robot.initial_state().items()}
    seen = simulate(robot, logs(nothing), start=begin, integrator=Integrator(substeps))
    noisy = [y[:, : len(sigma)] + sigma * rng.normal(size=(len(time), len(sigma))) for y in seen]
    return OtherProblem(robot, logs(noisy), sigma, initial, interval, substeps)


def _levels(rng: np.random.Generator, largest: float, E: int, T: int, held: int, channels: int) -> np.ndarray:
    found = rng.uniform(-largest, largest, size=(E, -(-T // held), channels))
    return np.repeat(found, held, axis=1)[:, :T]


def omni_problem(experiments: int = 8, samples: int = 1000) -> OtherProblem:
    """Seven parameters and three initial states a log, 50 Hz, four sub-steps."""
    inputs = _levels(np.random.default_rng(1), 12.0, experiments, samples, 25, 4)
    return _problem(Omni(), inputs, np.array([0.01, 0.01, 0.02]), "estimate", 0.02, 4, 2)


def pendulum() -> Custom:
    """inertia w' = u - friction w - weight sin(q), angle and speed measured."""
    import jax.numpy as jnp

    def dynamics(state, inputs, p):
        torque = GEAR * inputs["u"] - p["friction"] * state["w"] - p["weight"] * jnp.sin(state["q"])
        return {"q": state["w"], "w": torque / p["inertia"]}

    table = {name: Parameter(value, free=True, lower=0.0) for name, value in PENDULUM.items()}
    return Custom(
        dynamics=dynamics, state_names=("q", "w"), own_channels=PENDULUM_CHANNELS, table=table, title="pendulum"
    )


def pendulum_problem(experiments: int = 8, samples: int = 1000) -> OtherProblem:
    """Three parameters, known starts, 200 Hz, one step a sample."""
    inputs = _levels(np.random.default_rng(3), 1.0, experiments, samples, 50, 1)
    return _problem(pendulum(), inputs, np.array([0.005, 0.05]), "known", 0.005, 1, 4)
