"""Logs whose channels have clocks of their own: each looked at on the rows at which it was measured.

The rows of such a log are those of several sensors and of the commands, so that neither their intervals nor their empty cells
say anything of one sensor.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..logs.channels import Channels
from ..logs.finding import Finding
from ..logs.log import Log


def on_several_clocks(log: Log) -> bool:
    """Whether the reader put the log together from signals with clocks of their own."""
    return any(finding.check == "several_clocks" for finding in log.findings)


def as_measured(log: Log, name: str) -> tuple[Log, NDArray[np.int64]] | None:
    """The log of one output alone, at the rows at which it was measured, and these rows; None for fewer than two."""
    rows = np.flatnonzero(np.isfinite(log.output(name)))
    if len(rows) < 2:
        return None
    mixing = {name: log.channels.mixing[name]} if name in log.channels.mixing else {}
    channels = Channels(log.channels.inputs, (name,), units=log.channels.units, mixing=mixing)
    return Log(log.name, log.time[rows], log.inputs[rows], log.output(name)[rows, None], channels), rows


def nothing_else_changes(log: Log, name: str, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether no input and no other output changes between each of the `rows` and the next."""
    others = [log.output(other) for other in log.measured if other != name]
    latest = []
    for values in others:
        there = np.isfinite(values)
        last = np.maximum.accumulate(np.where(there, np.arange(len(values)), -1))
        latest.append(np.where(last >= 0, values[np.maximum(last, 0)], 0.0))
    everything = np.stack([*log.inputs.T, *latest], axis=1)[rows]
    return ~np.any(np.diff(everything, axis=0) != 0, axis=1)


def placed(findings: Iterable[Finding], rows: NDArray[np.int64], name: str) -> Iterator[Finding]:
    """Findings of `as_measured`, with the rows of the whole log; what is said of its clock is said of the channel's."""
    for finding in findings:
        column = name if finding.column == "t" else finding.column
        message = finding.message.replace("column 't'", f"clock of {name!r}", 1)
        if finding.sample is None:
            yield replace(finding, column=column, message=message)
            continue
        row = int(rows[finding.sample])
        message = message.replace(f"sample {finding.sample} (t", f"sample {row} (t", 1)
        yield replace(finding, column=column, sample=row, message=message)
