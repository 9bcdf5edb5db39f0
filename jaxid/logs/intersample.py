"""What the inputs do between two samples: held, as a computer commands them, or linear, as a sensor of a current sees them.

Simulations hold an input from one sample to the next. An input that runs linearly has, over each interval, the mean of the
interval's two ends; held at that mean it gives the same impulse in every interval (first-order hold; Ljung, System
Identification, 1999, section 13.3). Half a sample of difference matters wherever friction or inertia is sought to a percent
from samples that the motion is not slow to.
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from .log import Log, LogSet

Intersample = Literal["hold", "linear"]


def _linear(log: Log) -> Log:
    later = np.concatenate([log.inputs[1:], log.inputs[-1:]])
    return replace(log, inputs=0.5 * (log.inputs + later))


def between_samples(logs: LogSet, intersample: Intersample) -> LogSet:
    """The logs with inputs that hold, from each sample to the next, the mean that the input has in between.

    "hold" changes nothing. Raises `ValueError` for any other word.
    """
    if intersample not in ("hold", "linear"):
        raise ValueError(f"inputs cannot be {intersample!r} between samples; use 'hold' or 'linear'.")
    return logs if intersample == "hold" else LogSet(_linear(log) for log in logs)
