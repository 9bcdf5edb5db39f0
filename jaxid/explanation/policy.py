"""What counts, and how much is tried: the numbers by which an explanation decides, in one place."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from functools import wraps
from typing import Any, ParamSpec, TypeVar


@dataclass(frozen=True)
class Policy:
    """The numbers by which `explain` decides, beside the level of false alarms (`level.py`).

    What counts as an answer:

    - `separated`: standard errors of the likelihood difference beyond which two models are told apart (Vuong, Econometrica 57,
      1989; Wald's 2).
    - `same_motion`: RMS difference, times the noise, of two models of one delay that may be due to interpolation.
    - `negligible`: normalised RMS below which a gap is too small to matter, whatever its significance: parameters whose
      predictions are off by a tenth of the noise.
    - `small`: normalised RMS up to which what remains under a name is left to the imprecision of the effect that was added.
    - `many`: normalised RMS above which what was added is no answer, whatever it brought.
    - `least_gain`: share of a gap that an effect must close; `least_of_first` the share of the first gap that a further effect
      must.
    - `unexplained`: share of a gap that may remain under a name; what leaves no more has explained it, on however few
      stretches.
    - `coarse_law`, `coarse_curve`: normalised RMS that an added formula, or curve, may have left of its own, so that a further
      effect must bring more; at most `coarse_share` and twice `coarse_share` of the first gap.

    What is tried, which costs time:

    - `most_refits`: candidates of different direction that are refitted, and `first_refits` of them always.
    - `alike`: cosine between two candidates' changes from which only one of them is refitted at first.
    - `promising`: share of the first candidate's promise below which others are not refitted beyond these.
    - `rival`: the same where the best has left only noise.
    - `formula`: share of the promise of a mechanism's best law from which another formula is tried.
    - `in_the_running`: share of the best one's gain that a candidate may lack after a few steps and still be refitted to the
      end.
    - `most_laws`, `most_mechanisms`: further laws of a mechanism, and mechanisms whose further laws are refitted.

    `python -m benchmarks.policy` finds which verdicts change when each is half as large again, or smaller by that.
    """

    separated: float = 2.0
    same_motion: float = 0.1
    negligible: float = 1.005
    small: float = 1.03
    many: float = 2.0
    least_gain: float = 0.05
    least_of_first: float = 0.02
    unexplained: float = 0.15
    coarse_law: float = 1.08
    coarse_curve: float = 1.15
    coarse_share: float = 0.05
    most_refits: int = 5
    first_refits: int = 3
    alike: float = 0.9
    promising: float = 0.2
    rival: float = 0.5
    formula: float = 0.55
    in_the_running: float = 0.1
    most_laws: int = 3
    most_mechanisms: int = 3

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            if not (isinstance(value, int | float) and 0 < value < float("inf")):
                raise ValueError(f"Policy.{entry.name} is {value!r:.60}; give a number above zero.")


_policy: ContextVar[Policy] = ContextVar("policy", default=Policy())  # noqa: B039 - frozen
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def current_policy() -> Policy:
    """The numbers that hold here."""
    return _policy.get()


@contextmanager
def at_policy(policy: Policy) -> Iterator[None]:
    """Within, explanations decide by `policy`."""
    token = _policy.set(policy)
    try:
        yield
    finally:
        _policy.reset(token)


def keeps_policy(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """The function, run `at_policy` of its keyword argument `policy` where one is given."""

    @wraps(function)
    def run(*arguments: _Arguments.args, **options: _Arguments.kwargs) -> _Result:
        policy: Any = options.get("policy")
        with at_policy(policy or current_policy()):
            return function(*arguments, **options)

    return run
