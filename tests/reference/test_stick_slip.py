"""The event-accurate integrator against closed forms and against SciPy's integrator with events."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

from reference.axis import AXIS
from reference.effects import complete, kernel_vector
from reference.excitation import crawl, experiment
from reference.logs import simulate
from reference.pioneer import PIONEER
from reference.robot import Robot


def axis_exact(u, sampling, c):
    """Piecewise solution of J v' = k u - Cv v - Cs sgn v + offset with sticking, at the samples."""
    v, out = 0.0, [0.0]
    rate = c["Cv"] / c["J"]
    for force in c["k"] * u[:-1] + c["offset"]:
        left = sampling
        while left > 0:
            if v == 0 and abs(force) <= c["Cs"]:
                break
            direction = np.sign(v) if v != 0 else np.sign(force)
            final = (force - direction * c["Cs"]) / c["Cv"]
            stop = np.log((v - final) / -final) / rate if v != 0 and final * v <= 0 and final != 0 else np.inf
            if stop < left:
                v, left = 0.0, left - stop
            else:
                v, left = final + (v - final) * np.exp(-rate * left), 0.0
        out.append(v)
    return np.array(out)


@pytest.mark.parametrize("offset", [0.0, 0.2])
def test_axis_follows_the_closed_form_through_stops_and_reversals(offset):
    u = crawl(1000, (5, 30), 0.5, np.random.default_rng(5)) * np.repeat([1.0, 2.0], 500)
    robot = AXIS.with_parameters(offset=offset, J=0.7)
    run = simulate(robot, u[:, None], 0.02)
    exact = axis_exact(u, 0.02, robot.parameters)
    np.testing.assert_allclose(run.speeds[:, 0], exact, atol=1e-8)
    assert np.array_equal(run.speeds[:, 0] == 0, exact == 0)
    assert (exact == 0).sum() > 50 and (exact < 0).any() and (exact > 0).any()


class Event:
    """An event of `solve_ivp` at the place where a margin gets below zero."""

    terminal, direction = True, -1

    def __init__(self, margin):
        self.margin = margin

    def __call__(self, t, x):
        return self.margin(x)


class Slow:
    """The same equations; modes from a bounded least-squares problem, integration by SciPy with event functions."""

    def __init__(self, robot: Robot):
        self.robot, self.e = robot, kernel_vector(complete(None, robot.name))
        self.p = np.array(list(robot.parameters.values()))
        self.v = slice(robot.first, robot.first + len(robot.speeds))

    def terms(self, x, u):
        n, a, v = self.robot.n_states, self.robot.n_axes, len(self.robot.speeds)
        xdot, G, B, bias, level = np.zeros(n), np.zeros((n, a)), np.zeros((a, v)), np.zeros(a), np.zeros((2, a))
        self.robot.dynamics(0.0, np.ascontiguousarray(x), u, self.p, self.e, xdot, G, B, bias, level)
        return xdot, G, B, bias, level

    def modes(self, x, u, sliding):
        """Rubbing accelerations of minimal friction power decide the modes; `sliding` holds +-1 for axes that move."""
        xdot, G, B, bias, level = self.terms(x, u)
        low, high = np.where(sliding > 0, level[0], -level[1]), np.where(sliding < 0, -level[1], level[0])
        moving = sliding != 0
        free = xdot.copy() - G[:, moving] @ low[moving]
        rest = ~moving
        if not rest.any():
            return sliding
        A = B @ G[self.v]
        values, vectors = np.linalg.eigh(A[np.ix_(rest, rest)])
        good = values > 1e-9 * values.max()
        root = (vectors[:, good] * np.sqrt(values[good])).T  # |root f - target|^2 / 2 = f A f / 2 - f w + constant
        w = (B @ free[self.v] + bias)[rest]
        target = (vectors[:, good] / np.sqrt(values[good])).T @ w
        f = lsq_linear(root, target, (low[rest], high[rest]), tol=1e-14, method="bvls").x
        acceleration = w - A[np.ix_(rest, rest)] @ f
        modes = sliding.copy()
        modes[rest] = np.where(np.abs(acceleration) > 1e-7, np.sign(acceleration), 0).astype(int)
        return modes

    def forces(self, x, u, modes):
        xdot, G, B, bias, level = self.terms(x, u)
        f = np.where(modes > 0, level[0], np.where(modes < 0, -level[1], 0.0))
        stuck = modes == 0
        A = B @ G[self.v]
        w = B @ xdot[self.v] + bias - A @ f
        f[stuck] = np.linalg.lstsq(A[np.ix_(stuck, stuck)], w[stuck], rcond=1e-9)[0]
        return xdot - G @ f, B @ x[self.v], f, level

    def crossing(self, axis, modes, u):
        """A sliding speed gets to zero; a start from rest is not a crossing."""
        return Event(lambda x: modes[axis] * self.forces(x, u, modes)[1][axis] + 1e-11)

    def breaking(self, modes, u):
        """A sticking axis gets to its level."""

        def slack(x):
            _, _, f, level = self.forces(x, u, modes)
            if np.linalg.matrix_rank(self.terms(x, u)[2][modes == 0], tol=1e-8) < (modes == 0).sum():
                return 1.0  # all speeds are zero and the input is constant: nothing can break away
            return np.min(np.where(modes == 0, np.minimum(level[0] - f, f + level[1]), 1.0)) + 1e-12

        return Event(slack)

    def run(self, inputs, sampling):
        x, sliding, out = np.zeros(self.robot.n_states), np.zeros(self.robot.n_axes, int), []
        for u in np.hstack((inputs, np.zeros((len(inputs), self.robot.n_forces)))):
            out.append(x)
            t = 0.0
            while t < sampling:
                modes = self.modes(x, u, sliding)
                solution = solve_ivp(
                    lambda t, x, modes=modes, u=u: self.forces(x, u, modes)[0],
                    (t, sampling),
                    x,
                    "DOP853",
                    rtol=1e-10,
                    atol=1e-12,
                    max_step=0.004,  # longer steps miss short reversals of the caster
                    events=[
                        *(self.crossing(axis, modes, u) for axis in np.flatnonzero(modes)),
                        self.breaking(modes, u),
                    ],
                )
                t, x = solution.t[-1], solution.y[:, -1]
                s = self.terms(x, u)[2] @ x[self.v]
                sliding = np.where(np.abs(s) < 1e-8, 0, modes)
                if not sliding.any():
                    x[self.v] = 0.0
                elif solution.t_events[-1].size:  # the axis at its level starts in the direction it is pushed
                    _, _, f, level = self.forces(x, u, modes)
                    slack = np.where(modes == 0, np.minimum(level[0] - f, f + level[1]), np.inf)
                    sliding[np.argmin(slack)] = np.sign(f[np.argmin(slack)])
        return np.array(out)


def test_axis_agrees_with_scipy():
    u = experiment("axis", "crawl", 400, seed=2)
    fast, slow = simulate(AXIS, u, 0.02), Slow(AXIS).run(u, 0.02)
    np.testing.assert_allclose(fast.states, slow, atol=1e-7)
    assert fast.events >= 3


@pytest.mark.parametrize("kind", ["crawl", "turning"])
def test_pioneer_agrees_with_scipy(kind):
    inputs = experiment("pioneer", kind, 200, seed=1)[55:]
    fast, slow = simulate(PIONEER, inputs, 0.02), Slow(PIONEER).run(inputs, 0.02)
    np.testing.assert_allclose(fast.states[:, :6], slow[:, :6], atol=2e-6)
    assert fast.events >= 3


def test_result_does_not_depend_on_the_step_length():
    inputs = experiment("pioneer", "multilevel", 600, seed=4)
    coarse, fine = (
        simulate(PIONEER, inputs, 0.02),
        simulate(PIONEER, inputs, 0.02, longest=0.001, rtol=1e-11, atol=1e-13),
    )
    np.testing.assert_allclose(coarse.speeds, fine.speeds, atol=1e-6)


def test_asymmetric_experiment_mirrors():
    """Exchanging the wheels mirrors the motion: eta2 and beta change sign."""
    inputs = experiment("pioneer", "turning", 500, seed=6)
    one, other = simulate(PIONEER, inputs, 0.02), simulate(PIONEER, inputs[:, ::-1], 0.02)
    np.testing.assert_allclose(one.states[:, [3, 4, 5]], other.states[:, [3, 4, 5]] * [-1, 1, -1], atol=1e-9)
