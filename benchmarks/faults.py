"""Deliberate faults for `benchmarks.mutation`: replacements of which any one must make the default tests fail."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A replacement that must match exactly once, and the tests that should fail with it."""

    what: str
    file: str
    old: str
    new: str
    tests: str


EQUATIONS, PIONEER = "jaxid/papers/pioneer/equations.py", "jaxid/robots/pioneer.py"
NEGLECTED, JUDGE = "jaxid/estimate/output_error/neglected.py", "jaxid/estimate/judge.py"

ROBOTS = (
    Fault(
        "a sign in the paper's S(q)",
        EQUATIONS,
        '(-s / p["d"], -(p["d"] + p["l1"] * c) / p["d"])',
        '(-s / p["d"], (p["d"] + p["l1"] * c) / p["d"])',
        "tests/papers/pioneer/test_equations.py",
    ),
    Fault(
        "a sign in the S(q) that rollouts and linear equations are made of",
        PIONEER,
        '(-sin_b / p["d"], -(p["d"] + p["l1"] * cos_b) / p["d"])',
        '(-sin_b / p["d"], -(p["d"] - p["l1"] * cos_b) / p["d"])',
        "tests/robots/test_pioneer.py",
    ),
    Fault(
        "a sign in the Coriolis terms in closed form",
        "jaxid/robots/pioneer_closed_form.py",
        "sin_b * along - cos_b * across - lever * eta2,",
        "sin_b * along - cos_b * across + lever * eta2,",
        "tests/robots/test_pioneer_closed_form.py",
    ),
    Fault(
        "a part of the Coriolis matrix transposed",
        EQUATIONS,
        'jnp.einsum("jki,k->ij", slope, qdot)',
        'jnp.einsum("jki,k->ji", slope, qdot)',
        "tests/papers/pioneer/test_equations.py",
    ),
    Fault(
        "the gear counted once in the back-EMF and not in the motor",
        PIONEER,
        'emf = p["KE"] * p["tr"]',
        'emf = p["KE"]',
        "tests/robots/test_pioneer.py",
    ),
    Fault(
        "the gear's efficiency forgotten",
        PIONEER,
        'p["tr"] * p["mu"] * p["KT"] * i',
        'p["tr"] * p["KT"] * i',
        "tests/robots/test_pioneer.py",
    ),
    Fault(
        "swapped sides of the omni",
        "jaxid/robots/omni.py",
        "return Vn + spin, -V + spin, -Vn + spin, V + spin",
        "return Vn + spin, V + spin, -Vn + spin, -V + spin",
        "tests/robots/test_omni.py",
    ),
    Fault(
        "a sign of the turning frame",
        "jaxid/robots/omni.py",
        "Q[1] - carried * W * (c * V - yc * W)",
        "Q[1] + carried * W * (c * V - yc * W)",
        "tests/robots/test_omni.py",
    ),
    Fault(
        "the axis's offset pushes instead of resisting",
        "jaxid/robots/axis.py",
        'return (-p["offset"],)',
        'return (p["offset"],)',
        "tests/robots/test_axis.py",
    ),
    Fault(
        "a delay off by one sample",
        "jaxid/effects/earlier.py",
        "stamps_before(time, then) - 1, 0,",
        "stamps_before(time, then), 0,",
        "tests/effects/test_irregular_stamps.py",
    ),
)

MACHINE_CODE = (
    Fault(
        "the kernel's rollout takes the first sub-step's input in all of them",
        "jaxid/kernel/rollout_kernel.py",
        'self.row = build.select(build.icmp_signed("==", self.R, ir.Constant(INDEX, 1)), zero, step)',
        "self.row = zero",
        "tests/effects/test_irregular_stamps.py",
    ),
    Fault(
        "the kernel's sensitivities run on through states that are prescribed",
        "jaxid/kernel/rollout_kernel.py",
        "build.store(writer.constant(0.0), self._tangent(i, k))",
        "build.store(writer.constant(1.0), self._tangent(i, k))",
        "tests/kernel/test_call.py",
    ),
    Fault(
        "a sign in a derivative of the kernel's",
        "jaxid/kernel/tangents.py",
        "(x[1], graph.neg(graph.div(x[0], square)))",
        "(x[1], graph.div(x[0], square))",
        "tests/kernel/test_expressions.py",
    ),
    Fault(
        "friction of the other direction in the linear equations",
        "jaxid/estimate/linear/balance.py",
        "graph.mul(graph.select(w, b, f), s)",
        "graph.mul(graph.select(w, f, b), s)",
        "tests/estimate/linear/test_integrals.py",
    ),
    Fault(
        "the mass matrix of the linear equations with its sign lost",
        "jaxid/estimate/linear/balance.py",
        "K = [[graph.neg(x) for x in row]",
        "K = [[x for x in row]",
        "tests/estimate/linear/test_integrals.py",
    ),
    Fault(
        "a sign in how inputs move with what acts on commands",
        "jaxid/estimate/output_error/direct.py",
        "dy[:, :, :, [s + j for j in before]] += input_tangents(",
        "dy[:, :, :, [s + j for j in before]] -= input_tangents(",
        "tests/estimate/output_error/test_direct.py",
    ),
    Fault(
        "sensors whose own parameters have no sensitivities",
        "jaxid/estimate/output_error/direct.py",
        "steps = np.concatenate([np.zeros((s, len(d.numbers))), moved])",
        "steps = np.concatenate([np.zeros((s, len(d.numbers))), 0.0 * moved])",
        "tests/estimate/output_error/test_direct.py",
    ),
)

ESTIMATORS = (
    Fault(
        "the dropped mask of the cost",
        "jaxid/estimate/output_error/problem.py",
        "residual = jnp.where(problem.mask, (y - problem.outputs) / problem.sigma, 0.0)",
        "residual = jnp.nan_to_num((y - problem.outputs) / problem.sigma)",
        "tests/estimate/output_error/test_problem.py",
    ),
    Fault(
        "the dropped mask of the sensitivities",
        "jaxid/estimate/output_error/problem.py",
        "jnp.where(mask[..., None], tangents * weight[..., None] * columns, 0.0)",
        "tangents / problem.sigma[..., None] * columns",
        "tests/estimate/output_error/test_problem.py",
    ),
    Fault(
        "degrees of freedom not accounted for",
        "jaxid/estimate/output_error/from_optimum.py",
        "counts * (1.0 - unknown_count / xp.maximum(counts.sum(), 1))",
        "counts * 1.0",
        "tests/estimate/output_error/test_channel_noise.py",
    ),
    Fault(
        "linear equations across gaps that are too long",
        "jaxid/estimate/linear/log_rows.py",
        "whole &= inside & (known[after] - known[np.maximum(before, 0)] <= _LONGEST_GAP)",
        "whole &= inside",
        "tests/estimate/linear/test_integral_least_squares.py -k long_gap",
    ),
    Fault(
        "measured regressors as their own instruments",
        "jaxid/estimate/linear/instrumental_variables.py",
        "F, Z, y = columns[:, :n], columns[:, n : 2 * n], columns[:, -1]",
        "F, Z, y = columns[:, :n], columns[:, :n], columns[:, -1]",
        "tests/estimate/linear/test_instrumental_variables.py",
    ),
    Fault(
        "a tenth of the sensor's noise missing in the variance of innovations",
        "jaxid/estimate/prediction_error/cubature.py",
        "variance = jnp.sum(c * along) + noise[i] ** 2",
        "variance = jnp.sum(c * along) + 0.9 * noise[i] ** 2",
        "tests/estimate/prediction_error/test_likelihood.py",
    ),
)

JUDGEMENT = (
    Fault(
        "the score test without what the fitted parameters take up",
        NEGLECTED,
        "forces -= columns @ onto",
        "forces -= 0.0 * (columns @ onto)",
        "tests/estimate/output_error/test_neglected.py",
    ),
    Fault(
        "the score test's shift not in units of the force",
        NEGLECTED,
        "d.onto[:, best] * scores[best] / d.lengths[best]",
        "d.onto[:, best] * scores[best]",
        "tests/estimate/output_error/test_neglected.py",
    ),
    Fault(
        "the score test in coloured noise as if it were white",
        NEGLECTED,
        "covariance = d.found.T @ d.found if white else _by_chance(problem, d)",
        "covariance = d.found.T @ d.found",
        "tests/estimate/output_error/test_neglected.py",
    ),
    Fault(
        "bursts of a residual overlooked",
        JUDGE,
        "min(bursts(series[c]), uneven(series[c])) < limit",
        "uneven(series[c]) < limit",
        "tests/estimate/test_judgement.py -k uneven",
    ),
    Fault(
        "a residual uneven over the logs overlooked",
        JUDGE,
        "min(bursts(series[c]), uneven(series[c])) < limit",
        "bursts(series[c]) < limit",
        "tests/estimate/test_judgement.py -k uneven",
    ),
    Fault(
        "half the degrees of freedom in the test for whiteness",
        "jaxid/estimate/residual_tests.py",
        "np.sum(rho[used] ** 2 / pairs[used])), len(used)",
        "np.sum(rho[used] ** 2 / pairs[used])), len(used) // 2",
        "tests/estimate/confidence/test_agreement.py",
    ),
    Fault(
        "the noise of third differences with another gain",
        "jaxid/logs/noise.py",
        "/ np.sqrt(np.sum(shares**2, axis=0))",
        "/ np.sqrt(np.max(shares**2, axis=0))",
        "tests/logs/test_noise.py",
    ),
)

PREFLIGHT = (
    Fault(
        "a wiring whose sign nobody looks at",
        "jaxid/checks/signs.py",
        "shares = np.sign(product) * product**2",
        "shares = product**2",
        "tests/checks/test_preflight.py -k wrong_sign_is_named",
    ),
    Fault(
        "a position that has to be zero at rest",
        "jaxid/checks/sensors.py",
        "values = speed(log, name)\n        there",
        "values = log.output(name)\n        there",
        "tests/checks/test_preflight.py -k rests_anywhere",
    ),
    Fault(
        "input held one sample late in the windows",
        "jaxid/checks/windows.py",
        "np.cumsum(rates[:-1] * steps, axis=0)",
        "np.cumsum(rates[1:] * steps, axis=0)",
        "tests/checks/test_windows.py",
    ),
)

FAULTS = (*ROBOTS, *MACHINE_CODE, *ESTIMATORS, *JUDGEMENT, *PREFLIGHT)
