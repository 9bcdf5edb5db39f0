"""The posterior of an output-error fit by NUTS (Hoffman & Gelman, JMLR 15, 2014), through blackjax.

The likelihood is the one that `output_error` maximises (its noise taken as known); the prior is flat in every physical
parameter within its bounds, times the table's own priors. Chains run as lanes in coordinates in which the posterior around
the optimum is a unit ball, so that hardly anything needs to be tuned.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Bool, Float

from ..._compile import compiled
from ..._float64 import in_float64
from ..._labelled import labelled
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogSet
from ...robots.given import given_logs
from ...simulation.rollout import Integrator
from ..output_error.bounds import Unconstrained
from ..output_error.problem import Problem, Structure, Triangle, Unknowns, parameters_at, reduced_residual
from ..output_error.setup import InitialStates, at_fit
from ..output_error.solvers import minimise_compiled
from ..result import Fit, checked_fit
from .white_noise import not_white

if TYPE_CHECKING:
    import arviz
    import xarray

_STEP = 0.5
"""First step of the integrator, in standard deviations."""
_PULL = 1e-6
"""Precision, relative to the largest, that directions get which the data leaves free: chains need a scale there."""


_AGREE = 1.01
"""r_hat up to which chains agree (Vehtari et al., Bayesian Analysis 16, 2021)."""


@dataclass(frozen=True, repr=False)
class Posterior:
    """Draws of the parameters: `samples[name]` [chains, draws].

    `r_hat` compares the chains (near 1 when they agree) and `effective` is the number of independent draws that they are
    worth, both by parameter; `divergences` counts steps at which the integrator failed, and `diverging` [chains, draws] says
    which. `caveat` says where the fit's residual is not the white noise that the likelihood is of. `units` and `meanings` of
    the parameters by name.
    """

    samples: dict[str, Float[np.ndarray, "chains draws"]]
    r_hat: dict[str, float]
    effective: dict[str, float]
    divergences: int
    caveat: str = ""
    units: dict[str, str] = field(default_factory=dict)
    meanings: dict[str, str] = field(default_factory=dict)
    diverging: Bool[np.ndarray, "chains draws"] | None = None
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def sentence(self) -> str:
        """How many draws there are, and whether the chains agree."""
        chains, draws = next(iter(self.samples.values())).shape if self.samples else (0, 0)
        far = [name for name, ratio in self.r_hat.items() if not ratio < _AGREE]
        agree = f"the chains disagree on {', '.join(far)}: draw more" if far else "the chains agree"
        steps = f"{self.divergences} step{'s' * (self.divergences != 1)} of the integrator failed"
        return (
            f"Posterior: {chains} chains of {draws} draws; {agree}; {steps if self.divergences else 'no step failed'}."
        )

    def ci95(self, name: str) -> tuple[float, float]:
        """Central 95 % interval of a parameter."""
        low, high = np.quantile(self.samples[name], (0.025, 0.975))
        return float(low), float(high)

    def to_xarray(self) -> "xarray.Dataset":
        """The draws by parameter over `chain` and `draw`, each with its `units` and what it means (`long_name`). Needs xarray
        (`pip install jaxid-robots[xarray]`); raises `ImportError` without it."""
        chains, draws = next(iter(self.samples.values())).shape if self.samples else (0, 0)
        over = {"chain": np.arange(chains), "draw": np.arange(draws)}
        columns = {name: (tuple(over), values, self._labels(name)) for name, values in self.samples.items()}
        return labelled(over, columns, attributes={"inference_library": "jaxid"})

    def to_arviz(self) -> "arviz.InferenceData":
        """The draws as ArviZ has them: the group `posterior` by parameter, with units and meanings as attributes, and which
        steps failed in `sample_stats`. Needs ArviZ (`pip install jaxid-robots[arviz]`); raises `ImportError` without it."""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FutureWarning)  # once a day ArviZ announces its next version
                import arviz
        except ImportError:
            raise ImportError("to_arviz() needs ArviZ; install it with: pip install jaxid-robots[arviz]") from None
        groups: dict[str, Any] = {"posterior": self.to_xarray()}
        if self.diverging is not None:
            over = {name: groups["posterior"][name].to_numpy() for name in ("chain", "draw")}
            groups["sample_stats"] = labelled(over, {"diverging": (("chain", "draw"), self.diverging, {})})
        return arviz.InferenceData(**groups)

    def _labels(self, name: str) -> dict[str, str]:
        return {"units": self.units.get(name, ""), "long_name": self.meanings.get(name, "")}

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = [("", "mean", "2.5 %", "97.5 %", "r_hat", "effective")]
        for name, draws in self.samples.items():
            numbers = (f"{x:.5g}" for x in (draws.mean(), *self.ci95(name)))
            rows.append((name, *numbers, f"{self.r_hat[name]:.3f}", f"{self.effective[name]:.0f}"))
        return rows

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence, self.caveat])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence, self.caveat])


def _dense(triangle: Triangle) -> np.ndarray:
    """The arrow-shaped triangle as a matrix over (z, states)."""
    E, s = triangle.residual_local.shape
    n = triangle.shared.shape[0]
    R = np.zeros((n + E * s, n + E * s))
    R[:n, :n] = triangle.shared
    for e in range(E):
        rows = slice(n + e * s, n + (e + 1) * s)
        R[rows, :n], R[rows, rows] = triangle.crossed[e], triangle.local[e]
    return R


def _whitener(triangle: Triangle) -> np.ndarray:
    """Matrix W with W Wᵀ the covariance at the optimum."""
    R = _dense(triangle)
    values, vectors = np.linalg.eigh(R.T @ R)
    return vectors / np.sqrt(np.maximum(values, _PULL * values.max()))


@partial(compiled, static_argnames=("structure", "warmup", "draws"))
def _chains(structure: Structure, problem: Problem, centre: Unknowns, W, keys, *, warmup: int, draws: int):
    import blackjax

    residual = reduced_residual(structure, problem, centre)
    n = centre.z.size
    # NUTS knows no bounds; a parameter on its bound is drawn from within some standard errors of it.
    smooth = Unconstrained.around(problem.bounds, centre.z, jnp.linalg.norm(W, axis=1)[:n])
    flat, as_tree = ravel_pytree(centre._replace(z=smooth.from_z(centre.z)))
    steepness = smooth.slope(flat[:n])
    V = W.at[:n].divide(steepness[:, None])

    def at(position) -> tuple[Unknowns, Any]:
        q = as_tree(flat + V @ position)
        return q._replace(z=smooth.to_z(q.z)), smooth.slope(q.z)

    def log_density(position):
        unknowns, slope = at(position)
        parts, _ = residual(unknowns, problem)
        slope = jnp.where(problem.free, slope, 1.0)
        return -0.5 * sum(jnp.sum(part**2) for part in parts) + jnp.sum(jnp.log(jnp.abs(slope)))

    def chain(key):
        first, second, third = jax.random.split(key, 3)
        start = jax.random.normal(first, flat.shape)
        adapt: Any = blackjax.window_adaptation(blackjax.nuts, log_density, initial_step_size=_STEP)
        (state, settings), _ = adapt.run(second, start, warmup)
        kernel: Any = blackjax.nuts(log_density, **settings)

        def draw(state, key):
            state, info = kernel.step(key, state)
            return state, (parameters_at(problem, at(state.position)[0].z), info.is_divergent)

        return jax.lax.scan(draw, state, jax.random.split(third, draws))[1]

    return jax.vmap(chain)(keys)


@with_origin
@in_float64
def posterior(
    fit: Fit,
    logs: LogSet,
    *,
    draws: int = 500,
    chains: int = 4,
    warmup: int = 200,
    seed: int = 0,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    report: Callable[[str], None] = lambda message: None,
) -> Posterior:
    """Draw from the posterior of an output-error fit's free parameters and initial states.

    `logs`, `initial_states` and `integrator` are those of the fit. Needs blackjax (`pip install jaxid-robots[posterior]`);
    raises `ImportError` without it.
    """
    try:
        from blackjax.diagnostics import effective_sample_size, potential_scale_reduction
    except ImportError:
        raise ImportError("posterior() needs blackjax; install it with: pip install jaxid-robots[posterior]") from None
    logs = given_logs(checked_fit(fit).robot, logs)
    structure, problem, unknowns = at_fit(fit, logs, initial=initial_states, integrator=integrator)
    optimum = minimise_compiled(structure, problem, unknowns)
    W = jnp.asarray(_whitener(jax.tree.map(np.asarray, optimum.triangle)))
    keys = jax.random.split(jax.random.key(seed), chains)
    report(f"{chains} chains of {warmup} + {draws} draws")
    theta, divergent = _chains(structure, problem, optimum.unknowns, W, keys, warmup=warmup, draws=draws)
    samples = {name: np.asarray(theta[..., i]) for i, name in enumerate(structure.names)}
    reduction, effective = map(jax.jit, (potential_scale_reduction, effective_sample_size))
    return Posterior(
        samples=samples,
        r_hat={name: float(reduction(x)) for name, x in samples.items()},
        effective={name: float(effective(x)) for name, x in samples.items()},
        divergences=int(np.sum(divergent)),
        caveat=not_white(fit),
        units={name: fit.robot.parameters[name].unit for name in samples},
        meanings={name: fit.robot.parameters[name].meaning for name in samples},
        diverging=np.asarray(divergent),
    )
