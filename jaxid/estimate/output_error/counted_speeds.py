"""Speeds that are differences of counts: estimates from them are biased, from the counts themselves they are not."""

from ...logs import LogSet
from ...simulation.summed_speeds import as_positions, in_a_mapping
from ..result import Fit
from .feedback import fed_back


def counted_speeds(fit: Fit, logs: LogSet) -> str:
    """A sentence on that, with the remedy; empty where the speeds are no differences of counts."""
    if as_positions(fit.robot, logs) is None:
        return ""
    remedy = f"fit the counts, or what the speeds add up to, with the mapping {in_a_mapping(fit.robot)}"
    # A sensor whose speeds are rounded reads whole numbers of steps, too.
    unless = "Unless its sensor rounds it" if len(logs.channels.outputs) == 1 else "Unless their sensors round them"
    return f"{unless}, {biased_by_counts(logs, closed=fed_back(fit, logs).closed)}; {remedy}."


def biased_by_counts(logs: LogSet, closed: bool) -> str:
    """What is wrong with the speeds of such logs, in a `closed` loop or an open one, in a sentence without full stop."""
    names = logs.channels.outputs
    are = "are differences" if len(names) > 1 else "is a difference"
    late = "they are late" if len(names) > 1 else "it is late"
    why = "a controller makes commands of the rounding" if closed else f"{late} by half a row"
    return f"{' and '.join(names)} {are} of an encoder's counts, and {why}, which biases the estimates"
