"""CasADi on the Pioneer: its generated C under SciPy's solvers, and IPOPT's multiple shooting.

The step is jaxid's (`pioneer_numba` says how), as CasADi's SX expressions. Generated C (compiled with gcc) runs one sample
with forward sensitivities for the three initial states and seven parameters, accumulated over the record by CasADi; the
Jacobian is assembled in NumPy. IPOPT sees what CasADi's own example of system identification (`sysid.py`) shows it: a state
at every sample, defects as equality constraints, the Gauss-Newton Hessian.
"""

import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from .pioneer_problem import BETA_SPREAD, FREE, SAMPLING, SIGMA, STATE_SCALE, SUBSTEPS, FitProblem
from .reached import Clock, Reached

FIXED = tuple("m1 R1 Ip1 d M m R xm ym Ip L l1 tr mu KT Ra KE tau_fr".split())
_TINY = 1e-30
_LEAST = 0.01
"""Least value of a parameter over its published one."""
MOST_SECONDS = 20.0
"""Processor time after which IPOPT gives up."""


def _substep():
    """x, p, c, u -> x an integration step later, in SX."""
    import casadi as ca

    x, p, c, u = (ca.SX.sym(name, size) for name, size in (("x", 3), ("p", 7), ("c", len(FIXED)), ("u", 2)))
    k = dict(zip((*FREE, *FIXED), (*ca.vertsplit(p), *ca.vertsplit(c)), strict=True))
    h = SAMPLING / SUBSTEPS
    wheels = 2 * (k["m"] + k["Ir"] / k["R"] ** 2)
    rolling, swivelling = k["m1"] + k["Ir1"] / k["R1"] ** 2, k["Ip1"] / k["d"] ** 2
    j11, coupling, lever = k["M"] + wheels, k["M"] * k["xm"], k["M"] * k["ym"]
    j22 = k["M"] * (k["xm"] ** 2 + k["ym"] ** 2) + k["I0"] + 2 * k["Ip"] + wheels * k["L"] ** 2
    per_volt, emf, l1, d = k["tr"] * k["mu"] * k["KT"] / k["Ra"], k["KE"] * k["tr"], k["l1"], k["d"]
    b1, b2 = 1 / k["R"], k["L"] / k["R"]
    levels = (k["Cs"] + k["tr"] * k["mu"] * k["tau_fr"],) * 2 + (k["Cs1"],)

    def inverse(s, cb):
        a, b = j11 + rolling * cb**2 + swivelling * s**2, coupling + (swivelling - rolling) * l1 * s * cb
        e = j22 + l1**2 * (rolling * s**2 + swivelling * cb**2)
        scale = 1 / (a * e - b * b)
        return e * scale, -b * scale, a * scale

    def rates(at, dry):
        s, cb, e1, e2 = ca.sin(at[0]), ca.cos(at[0]), at[1], at[2]
        i11, i12, i22 = inverse(s, cb)
        c1, c2 = -s / d, -(d + l1 * cb) / d
        spins, turn = (b1 * e1 + b2 * e2, b1 * e1 - b2 * e2), c1 * e1 + c2 * e2
        right, left = (per_volt * (u[i] - emf * spin) - k["Cv"] * spin - dry[i] for i, spin in enumerate(spins))
        caster = -k["Cv1"] * turn - dry[2]
        across, along = rolling * turn * (s * e1 + cb * l1 * e2), swivelling * turn * (cb * e1 - s * l1 * e2)
        force = b1 * (right + left) + c1 * caster - (s * along - cb * across - lever * e2 * e2)
        moment = b2 * (right - left) + c2 * caster - (l1 * (s * across + cb * along) + lever * e2 * e1)
        return ca.vertcat(turn, i11 * force + i12 * moment, i12 * force + i22 * moment)

    def clip(v, low, high):
        return ca.fmin(ca.fmax(v, low), high)

    def held(at):
        s, cb = ca.sin(at[0]), ca.cos(at[0])
        i11, i12, i22 = inverse(s, cb)
        rows = ((b1, b2), (b1, -b2), (-s / d, -(d + l1 * cb) / d))
        free = rates(at, (0.0, 0.0, 0.0))
        speed = [r[0] * at[1] + r[1] * at[2] for r in rows]
        slip = [v + h * (r[0] * free[1] + r[1] * free[2]) for v, r in zip(speed, rows, strict=True)]
        moved = [(i11 * r[0] + i12 * r[1], i12 * r[0] + i22 * r[1]) for r in rows]
        compliance = [[r[0] * m[0] + r[1] * m[1] for m in moved] for r in rows]
        dry = [ca.SX(0.0)] * 3
        for _ in range(2):
            for i, level in enumerate(levels):
                own = compliance[i][i]
                end = slip[i] + h * own * dry[i]
                pull = (end - speed[i]) / h
                turned = clip(-speed[i] / (h * ca.fmax(pull + own * level, _TINY)), 0, 1)
                most = level - 2 * level * turned
                turned = clip(speed[i] / (h * ca.fmax(own * level - pull, _TINY)), 0, 1)
                least = -level + 2 * level * turned
                change = clip(end / (h * own), least, most) - dry[i]
                dry[i] = dry[i] + change
                slip = [slip[j] - h * compliance[j][i] * change for j in range(3)]
        return dry

    dry = held(x)
    first = rates(x, dry)
    second = rates(x + h / 2 * first, dry)
    third = rates(x + h / 2 * second, dry)
    fourth = rates(x + h * third, dry)
    return ca.Function("substep", [x, p, c, u], [x + h / 6 * (first + 2 * second + 2 * third + fourth)])


def _functions():
    """The substep; a record's simulation; a record's simulation with sensitivities [3, 10] at every sample."""
    import casadi as ca

    substep = _substep()
    x, p, c, u = (ca.SX.sym(name, size) for name, size in (("x", 3), ("p", 7), ("c", len(FIXED)), ("u", 2)))
    after = substep(x, p, c, u)
    slopes = ca.Function("slopes", [x, p, c, u], [after, ca.densify(ca.jacobian(after, ca.vertcat(x, p)))])
    at, by = x, ca.SX.sym("by", 3, 10)
    plain, moved = at, by
    for _ in range(SUBSTEPS):
        plain = substep(plain, p, c, u)
    for _ in range(SUBSTEPS):
        at, slope = slopes(at, p, c, u)
        moved = slope[:, :3] @ moved + ca.horzcat(ca.SX(3, 3), slope[:, 3:])
    simulate = ca.Function("simulate", [x, p, c, u], [plain])
    # One vector: CasADi accumulates the first argument.
    stacked = ca.SX.sym("stacked", 33)
    inner = ca.Function("inner", [x, by, p, c, u], [at, moved])
    new_x, new_by = inner(stacked[:3], ca.reshape(stacked[3:], 3, 10), p, c, u)
    both = ca.Function("both", [stacked, p, c, u], [ca.vertcat(new_x, ca.reshape(new_by, 30, 1))])
    return substep, simulate, both


@cache
def generated():
    """CasADi's C, compiled: one sample's simulation, and with sensitivities. Raises `CalledProcessError`."""
    import casadi as ca

    _, simulate, both = _functions()
    folder = Path(tempfile.mkdtemp(prefix="jaxid_casadi_"))
    code = ca.CodeGenerator("sample.c")
    code.add(simulate)
    code.add(both)
    code.generate(f"{folder}/")
    target = folder / "sample.so"
    command = ["gcc", "-O3", "-march=native", "-fPIC", "-shared", "-o", str(target), str(folder / "sample.c"), "-lm"]
    subprocess.run(command, check=True)
    return tuple(ca.external(name, str(target)) for name in ("simulate", "both"))


@cache
def _records(samples: int):
    """Both, accumulated over a record."""
    return tuple(f.mapaccum(samples - 1) for f in generated())


def _run(function, start: np.ndarray, free: np.ndarray, problem: FitProblem, e: int) -> np.ndarray:
    constants = np.array([problem.numbers[name] for name in FIXED])
    found = np.array(function(start, free, constants, problem.inputs[e, :-1].T))
    return np.vstack([start, found.T])


def residual(problem: FitProblem, x: np.ndarray) -> np.ndarray:
    """Weighted residuals and priors, as `pioneer_numba.residual`."""
    free, starts = problem.split(x)
    run = _records(problem.inputs.shape[1])[0]
    y = np.stack([_run(run, starts[e], free, problem, e)[:, 1:] for e in range(problem.experiments)])
    return np.concatenate([((y - problem.outputs) / SIGMA).ravel(), x[7::3] * (STATE_SCALE / BETA_SPREAD)])


def jacobian(problem: FitProblem, x: np.ndarray) -> np.ndarray:
    """Its derivatives, [2 E T + E, 7 + 3 E]."""
    free, starts = problem.split(x)
    E, T = problem.inputs.shape[:2]
    run = _records(T)[1]
    found = np.zeros((2 * E * T + E, len(x)))
    begin = np.hstack([STATE_SCALE * np.eye(3), np.zeros((3, 7))]).ravel(order="F")
    unit = np.concatenate([np.ones(3), problem.scale])[:, None]
    for e in range(E):
        by = _run(run, np.concatenate([starts[e], begin]), free, problem, e)[:, 3:].reshape(T, 10, 3)
        rows = (by * unit)[:, :, 1:].transpose(0, 2, 1) / SIGMA[:, None]
        rows = rows.reshape(2 * T, 10)
        place = slice(2 * T * e, 2 * T * (e + 1))
        found[place, :7], found[place, 7 + 3 * e : 10 + 3 * e] = rows[:, 3:], rows[:, :3]
        found[2 * E * T + e, 7 + 3 * e] = STATE_SCALE / BETA_SPREAD
    return found


def _solve(problem: FitProblem, method: str) -> Reached:
    clock = Clock()
    noting = {"callback": lambda intermediate_result: clock.note(intermediate_result.cost)} if method == "trf" else {}
    result = least_squares(
        lambda x: residual(problem, x),
        problem.start_point,
        jac=lambda x: jacobian(problem, np.asarray(x)),
        method=method,
        max_nfev=200,
        **noting,
    )
    return Reached(result.x, int(result.njev or 0), result.message, clock.seen)


def lm(problem: FitProblem) -> Reached:
    """SciPy's `lm` (MINPACK) on the generated C."""
    return _solve(problem, "lm")


def trf(problem: FitProblem) -> Reached:
    """SciPy's `trf` on the generated C."""
    return _solve(problem, "trf")


def multiple_shooting(problem: FitProblem, most: int = 60) -> Reached:
    """IPOPT with a state at every sample."""
    import casadi as ca

    E, T = problem.inputs.shape[:2]
    _, simulate, _ = _functions()
    constants = np.array([problem.numbers[name] for name in FIXED])
    step, free = simulate.map(T - 1), ca.MX.sym("free", 7)
    states = [ca.MX.sym(f"x{e}", 3, T) for e in range(E)]
    unknown = ca.vertcat(free, *(ca.vec(x) for x in states))
    p = free * problem.scale
    defects, residuals = [], []
    for e, x in enumerate(states):
        after = step(
            x[:, :-1] * STATE_SCALE,
            ca.repmat(p, 1, T - 1),
            np.tile(constants[:, None], (1, T - 1)),
            problem.inputs[e, :-1].T,
        )
        defects.append(ca.vec(after / STATE_SCALE - x[:, 1:]))
        residuals.append(ca.vec((x[1:, :] * STATE_SCALE - problem.outputs[e].T) / SIGMA[:, None]))
        residuals.append(x[0, 0] * (STATE_SCALE / BETA_SPREAD))
    r = ca.vertcat(*residuals)
    slope = ca.jacobian(r, unknown)
    weight, dual = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", sum(d.numel() for d in defects))
    hessian = ca.Function(
        "nlp_hess_l",
        {
            "x": unknown,
            "lam_f": weight,
            "lam_g": dual,
            "hess_gamma_x_x": weight * ca.triu(ca.mtimes(slope.T, slope)),
        },
        ["x", "p", "lam_f", "lam_g"],
        ["hess_gamma_x_x"],
    )
    nlp = {"x": unknown, "f": 0.5 * ca.dot(r, r), "g": ca.vertcat(*defects)}
    options = {
        "hess_lag": hessian,
        "ipopt": {"max_iter": most, "print_level": 0, "tol": 1e-8, "max_cpu_time": MOST_SECONDS},
        "print_time": False,
    }
    solver = ca.nlpsol("solver", "ipopt", nlp, options)
    first = np.zeros((E, 3, T))
    first[:, 1:] = problem.outputs.transpose(0, 2, 1) / STATE_SCALE  # speeds as measured, casters trailing
    guess = np.concatenate([problem.start / problem.scale, *(x.ravel(order="F") for x in first)])
    lower = np.full(len(guess), -np.inf)
    lower[:7] = _LEAST
    found = solver(x0=guess, lbx=lower, lbg=0, ubg=0)
    x = np.array(found["x"]).ravel()
    starts = x[7:].reshape(E, T, 3)[:, 0]
    stats = solver.stats()
    reason = stats["return_status"] if stats["success"] else f"not converged: {stats['return_status']}"
    return Reached(np.concatenate([x[:7], starts.ravel()]), int(stats["iter_count"]), reason)
