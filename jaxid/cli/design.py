"""`jaxid design`: the experiment to drive next, as a file with time and inputs, and what it is worth."""

from pathlib import Path

from .._atomic import write_text
from .._json import as_json
from ..design import Design, DesignError, design_experiment
from ..logs import LogSet, read_logs
from ..report.design_page import design_page
from ..report.document import write_page
from ..robots import Robot
from .arguments import UnusableInput, load_effects
from .cache import keep_compiled_programs
from .console import say, show, step
from .findings import warn_of_findings
from .fit import identifiable
from .folder import results_in


def _by_channel(pairs: list[str], flag: str) -> dict[str, float]:
    """`["eta1=0.01", ...]` as numbers by channel. Raises `UnusableInput`."""
    found = {}
    for pair in pairs:
        name, equals, number = pair.partition("=")
        try:
            found[name] = float(number)
        except ValueError:
            equals = ""
        if not equals:
            raise UnusableInput(f"{flag} {pair} is not a channel and a number; write for example {flag} eta1=0.01.")
    return found


def _document(design: Design, files: list[Path]) -> str:
    """What design.json holds."""
    content = {
        "robot": design.robot,
        "sentence": design.sentence,
        "runs": [
            {"file": file.name, "description": run.description, "limited_by": list(run.limited_by)}
            for run, file in zip(design.runs, files, strict=True)
        ],
        "reference": design.reference,
        "parameters": {
            name: {
                "value": value,
                "unit": design.units[name],
                "std_error": design.std_errors[name],
                "reference_std_error": design.reference_std_errors[name],
            }
            for name, value in design.values.items()
        },
    }
    return as_json(content)


def run_design(
    spec: str, model: Path | None, out: Path, limit: list[float], seconds: float | None, interval: float | None,
    noise: list[str], speed: list[str], floor: list[float], radius: float | None, already: list[str],
    experiments: int, doubt: float, rounds: int, seed: int, mapping: Path | None, overwrite: bool = False,
    own_effects: str | None = None,
) -> None:  # fmt: skip
    """Write experiment.csv (or experiment_1.csv ...), design.json and report.html to `out` and print the design."""
    keep_compiled_programs()
    robot: Robot = identifiable(spec, model, already, mapping, load_effects(own_effects))
    levels, speeds = _by_channel(noise, "--noise"), _by_channel(speed, "--speed")
    if len(floor) not in (0, 2):
        raise UnusableInput(f"--floor got {len(floor)} numbers; give two, the extents of the floor in metres.")
    with results_in(out, "design", robot.name, overwrite):
        logs: LogSet | None = read_logs(already, robot, mapping=mapping) if already else None
        warn_of_findings(logs)
        with step("Design") as report:
            try:
                design = design_experiment(
                    robot, limit=limit[0] if len(limit) == 1 else limit, seconds=seconds, interval=interval,
                    noise=levels or None, already=logs, speeds=speeds, rectangle=(floor[0], floor[1]) if floor else None,
                    radius=radius, experiments=experiments, doubt=doubt, rounds=rounds, seed=seed, report=report,
                )  # fmt: skip
            except DesignError as error:
                raise UnusableInput(str(error)) from None
        files = design.save(out / "experiment.csv")
        write_text(out / "design.json", _document(design, files))
        write_page(out / "report.html", design_page(design, tuple(file.name for file in files)))
    show(repr(design))
    say(f"{out}: {', '.join(file.name for file in files)}, design.json, report.html")
