"""What a recorder wrote, channel by channel: every signal with its own time stamps, before anything is put on one clock."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from .times import TimeColumn


@dataclass(frozen=True, eq=False)
class Series:
    """One signal of a recording.

    **Fields:**

    - `name`: where it stands, such as `/joint_states.velocity[left_wheel]`; `topic`: the stream that it came in.
    - `values`: `[n]`, in the file's own unit.
    - `received`: `[n]` ns, when the recorder had it; `stamped`: `[n]` ns, when its sender says that it was measured, or
      `None` where the sender says nothing.
    - `unit`: SI unit that the format promises (empty: none), which `values` times `to_si` are in; `said`: how the file itself
      writes their unit, such as "Rotation per Second"; `frame`: what a pose or a rate is told in.
    - `fault`: why it cannot be used, a sentence without file name and full stop; empty where it can.
    """

    name: str
    topic: str
    values: Float[np.ndarray, " n"]
    received: Int[np.ndarray, " n"]
    stamped: Int[np.ndarray, " n"] | None = None
    unit: str = ""
    frame: str = ""
    fault: str = ""
    to_si: float = 1.0
    said: str = ""

    def __len__(self) -> int:
        return len(self.values)


class Topic(NamedTuple):
    """One stream of a recording: its type, how many messages it has, and what to know about it (`remark`)."""

    name: str
    kind: str
    messages: int
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Recording:
    """A file's signals by name, its streams by name, and `notes`, `(check, text)` of whatever was decided while reading."""

    series: dict[str, Series]
    topics: dict[str, Topic]
    notes: tuple[tuple[str, str], ...] = ()
    time: TimeColumn | None = None
    """The column of a table's times."""
    origin: float = 0.0
    """The time [s] that a table's first row has by its own clock."""


def nanoseconds(seconds: Float[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Times in seconds as whole nanoseconds. Raises `ValueError` for times that are not finite or beyond 290 years."""
    if not np.all(np.abs(seconds) < 9e9):
        raise ValueError("holds times that are not finite or beyond 290 years")
    return np.round(np.asarray(seconds, dtype=float) * 1e9).astype(np.int64)
