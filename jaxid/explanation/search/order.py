"""In which order the names of a step stand, where their scores alone do not say it."""

from collections.abc import Sequence

from ...effects.curve import Curve
from ..refits.refit import Trial


def rather_first(
    trials: Sequence[Trial], equivalent: Sequence[str], rather: str
) -> tuple[list[Trial], tuple[str, ...]]:
    """The trials and the names that are not told apart from the first: of these, the one whose curve it is `rather` comes
    before a curve that is not its mechanism's, and so does one whose curve is its own before several that are alike, such as
    friction by direction that is the same both ways. Where the first is its own mechanism's, a curve of the same formula that
    bends as that one, and not as its own, is no other name."""
    best = trials[0]
    if not isinstance(best.effect, Curve):
        return [*trials], (*equivalent,)
    if best.effect.agrees(best.robot):
        bending = {t.id for t in trials[1:] if _bends_as(t, best.effect)}
        return [*trials], tuple(name for name in equivalent if name not in bending)
    same = [trial for trial in trials[1:] if trial.id in equivalent]
    others = [trial for trial in same if trial.id == rather]
    if not others and len(best.effect.kinds) > 1:
        others = [t for t in same if not isinstance(t.effect, Curve) or t.effect.agrees(t.robot)]
    if not others:
        return [*trials], (*equivalent,)
    ranked = [others[0], *(trial for trial in trials if trial is not others[0])]
    return ranked, (best.id, *(name for name in equivalent if name != others[0].id))


def _bends_as(trial: Trial, curve: Curve) -> bool:
    """Whether a trial's curve has the formula of another mechanism's `curve` and does not bend as its own mechanism's does."""
    effect = trial.effect
    if not isinstance(effect, Curve) or effect.id == curve.id or effect.formula != curve.formula:
        return False
    return not effect.agrees(trial.robot)


def with_more(ranked: Sequence[Trial], more: Sequence[Trial]) -> list[Trial]:
    """`ranked` trials, whose order is not that of their scores alone, with `more` at their places; first only what is best."""
    found = [*ranked]
    for trial in more:
        better = [k for k, other in enumerate(found) if other.score <= trial.score]
        found.insert(better[-1] + 1 if better else 0, trial)
    return found


def by_what_holds(mechanisms: Sequence[list[Trial]], base: Trial) -> list[list[Trial]]:
    """The mechanisms, in their order, each by the best law by which it predicts held-out logs better than without it: a curve
    that follows the fitted logs may lead anywhere on others, and hides no law that holds there. Those that get another law so
    are where their score puts them."""
    nothing, kept, moved = base.held_out.normalised_rms, [], []
    for laws in mechanisms:
        holding = (t for t in laws if t.held_out.normalised_rms < nothing and not t.held_out.diverged)
        first = next(holding, laws[0])
        (kept if first is laws[0] else moved).append([first, *(trial for trial in laws if trial is not first)])
    for own in moved:
        place = next((k for k, other in enumerate(kept) if other[0].score > own[0].score), len(kept))
        kept.insert(place, own)
    return kept
