"""Pre-flight: look at a log before anything is fitted to it, and say in one sentence each what is doubtful.

Identifiers of the checks, by severity:

- error: `never_moved`.
- warning: `short_log`, `time_gap`, `clock_jitter`, `time_unit`, `unit`, `contradiction`, `idle`, `saturated`,
  `missing_samples`, `slow_sensor`, `frozen_sensor`, `repeated_value`, `repeated_stretch`, `spike`, `dead_sensor`,
  `moving_start`, `exchanged`,
  `sign_flipped`, `swapped`, `copied_input`, `frame_flipped`, `coarse_sampling`, `doubtful_clock`, `disturbed`, `turns`,
  `ahead_of_input`; of a set `copy`; and from the reader `repeated_row`, `truncated_row`, `held_input`, `infinite`,
  `empty_column`, `unused_column`, `differentiated`, `out_of_order`, `falling_supply`; of recordings `truncated`,
  `clocks_apart`, `cut_end`, `pose_at_start`.
- note: `constant_input`, `equal_inputs`, `quantisation`, `skipped_row`; of recordings `several_clocks`, `moved_samples`,
  `mean_commands`,
  `receive_stamps`, `cut_start`, `held_to_the_end`, `not_in_every_message`.

A time that does not increase never gets here: no `Log` is made of it (`LogError`).
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ..logs.finding import Finding, LogError
from ..logs.log import Log, did_you_mean
from .repeats import check_repeats, check_stretches
from .response import check_response
from .samples import check_samples
from .scale import check_scale
from .sensors import check_sensors

_ORDER = {"error": 0, "warning": 1, "note": 2}


def preflight(log: Log, also: Sequence[str] = ()) -> list[Finding]:
    """What to know about one log before fitting, most severe first; an empty list says that nothing is doubtful.

    `also` names numeric extra columns (such as a gyro that is no channel of the robot) to be looked at like the
    outputs. Nothing is changed. Raises `LogError` where `also` names a column that is absent or not numeric.
    """
    also = (also,) if isinstance(also, str) else tuple(also)
    for name in also:
        if name not in log.extra.columns:
            known = [str(column) for column in log.extra.columns]
            raise LogError(f"{log.name} has no extra column {name!r}{did_you_mean(name, known)}; it has {known}.")
        if not pd.api.types.is_numeric_dtype(log.extra[name]) or not np.isfinite(log.extra[name]).any():
            raise LogError(f"{log.name}: extra column {name!r} holds no numbers; leave it out of `also`.")
    findings = [
        *log.findings,
        *check_samples(log, also),
        *check_sensors(log, also),
        *check_scale(log),
        *check_stretches(log),
    ]
    held = {found.column for found in findings if found.check in ("slow_sensor", "frozen_sensor")}
    for name in log.measured:
        findings += check_repeats(log, name, log.output(name)) if name not in held else ()
    if not any(finding.severity == "error" for finding in findings):
        # Noise alone has no response worth naming.
        findings += check_response(log)
    return sorted(findings, key=lambda finding: _ORDER[finding.severity])
