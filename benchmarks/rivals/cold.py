"""Six demonstration logs fitted both ways from a cold process, stage by stage: `python -m benchmarks.rivals.cold`.

Prints one JSON line: wall and processor seconds of each stage, and what JAX spent inside it on tracing, lowering and
compiling, with the number of programs compiled.
"""

import json
import time
from pathlib import Path


class Stages:
    """Wall and processor time of named stages, with JAX's own account of its compiling."""

    def __init__(self) -> None:
        self.rows: list[dict[str, float | str]] = []
        self._events: list[tuple[str, float]] = []

    def listen(self) -> None:
        """Collect JAX's durations from now on."""
        import jax

        jax.monitoring.register_event_duration_secs_listener(lambda event, s, **_: self._events.append((event, s)))

    def run(self, name: str, work):
        """Do `work()` and note what it took."""
        self._events.clear()
        wall, processor = time.perf_counter(), time.process_time()
        result = work()
        row: dict[str, float | str] = {
            "stage": name,
            "seconds": time.perf_counter() - wall,
            "processor_seconds": time.process_time() - processor,
        }
        kinds = {"trace": "jaxpr_trace", "lower": "jaxpr_to_mlir", "compile": "backend_compile"}
        for label, event in kinds.items():
            durations = [s for name, s in self._events if event in name]
            row[label] = sum(durations)
            if label == "compile":
                row["programs"] = len(durations)
        self.rows.append(row)
        return result


def main() -> None:
    stages = Stages()
    jaxid = stages.run("import jaxid", lambda: __import__("jaxid"))
    stages.listen()
    folder = Path(jaxid.__file__).parent / "demo_logs" / "pioneer"
    logs = stages.run("read six logs", lambda: jaxid.read_logs(folder / "fit_*.csv", robot="pioneer"))
    robot = jaxid.Pioneer()
    linear = stages.run("integral least squares", lambda: jaxid.integral_least_squares(robot, logs))
    fit = stages.run("output error, compiling", lambda: jaxid.output_error(robot, logs, start=linear))
    stages.run("output error again, warm", lambda: jaxid.output_error(robot, logs, start=linear))
    cold = stages.rows[:4]
    total = {key: sum(row[key] for row in cold) for key in ("seconds", "processor_seconds")}
    print(json.dumps({"stages": stages.rows, "total": total, "iterations": fit.iterations, "converged": fit.converged}))


if __name__ == "__main__":
    main()
