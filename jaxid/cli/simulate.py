"""`jaxid simulate`: a log's inputs through a model, predicted outputs into a file."""

from pathlib import Path

import numpy as np
import pandas as pd

from .._atomic import replacing
from ..estimate.output_error.predictability import predictability
from ..logs import LogSet, read_logs
from ..logs.files import named_files
from ..logs.read import read_planned
from ..model_file import read_model
from ..parameters import ParameterError
from ..simulation.simulate import simulate as simulate_logs
from .arguments import UnusableInput, for_logs, load_effects, load_robot
from .cache import keep_compiled_programs
from .console import say
from .findings import warn_of_findings


def run_simulate(
    spec: str, log: str, model: Path, mapping: Path | None, out: Path, own_effects: str | None = None
) -> None:
    """Write t, the inputs and the predicted outputs under their standard names, one row for each row of the log, which may be a
    planned one without outputs, such as a designed experiment."""
    keep_compiled_programs()
    for given in (Path(log), model, *([mapping] if mapping else [])):
        if out.exists() and given.exists() and out.samefile(given):
            raise UnusableInput(f"--out {out} is a file that is read, and would be written over; give another name.")
    robot = read_model(model, for_logs(load_robot(spec), [log], mapping), load_effects(own_effects))
    files = named_files(log)
    if len(files) > 1:
        raise UnusableInput(f"{log} matches {len(files)} files; give one log, and simulate each on its own.")
    planned = read_planned(log, robot, mapping)
    logs = LogSet([planned]) if planned is not None else read_logs(log, robot, mapping=mapping)
    if planned is None:
        warn_of_findings(logs)
    only = logs[0]
    try:
        (outputs,) = simulate_logs(robot, logs)
    except ParameterError as error:
        raise UnusableInput(f"{only.name} cannot be simulated with {model}: {error}") from error
    bad = np.argwhere(~np.isfinite(outputs))
    if len(bad):
        k, j = bad[0]
        raise UnusableInput(
            f"The simulation of {only.name} diverges ({only.channels.measured[j]!r} at sample {k}); check the numbers "
            f"in {model}."
        )
    foretold = predictability(robot, logs) if planned is None else None
    if foretold is not None and foretold.kind == "unstable" and foretold.horizon < only.duration:
        say(f"warning: {foretold.sentence}. What is written is that free simulation.", "yellow")
    columns = {"t": only.time} | {name: only.input(name) for name in only.channels.inputs}
    columns |= {name: outputs[:, j] for j, name in enumerate(only.channels.measured)}
    with replacing(out) as temporary:
        pd.DataFrame(columns).to_csv(temporary, index=False)
    say(f"{out}: {len(only)} rows of {', '.join(columns)}")
