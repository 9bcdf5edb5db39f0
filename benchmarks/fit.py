"""Speed beside other tools: one output-error fit, its linearisation, many small fits, scaling, and a cold process.

    python -m benchmarks.fit    # about fifteen minutes on two idle cores; --quick for a trial that writes nothing

needs the extras `test` and `rivals`, gcc and g++; what is missing is left out and said.

The problem is `benchmarks/rivals/pioneer_problem.py`: eight experiments, 16,000 residuals, 31 unknowns. Every rival
runs in a process of its own on one core; between fits it waits, so that the fits of all rivals alternate and share
whatever else the machine does. The first fit of a process compiles, the warm one is of new data of the same shape. Times
are also given in processor seconds, which other work on the machine disturbs least.

Costs are evaluated at the points reached by one and the same simulator (numba), and rivals are compared only where they
reach the same optimum. Writes `benchmarks/results/fit.json` and `docs/speed.md`.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.rivals import pioneer_numba  # noqa: E402
from benchmarks.rivals.page import page  # noqa: E402
from benchmarks.rivals.pioneer_problem import make_problem  # noqa: E402
from benchmarks.rivals.worker import ENVIRONMENT, RIVALS, absent  # noqa: E402

RESULTS = ROOT / "benchmarks/results/fit.json"
SEEDS = (1, 10)
"""Of the data of the first fit and of the warm one."""
ONCE = (
    "optimistix as it comes",
    "diffrax + optimistix as documented",
    "CasADi, IPOPT multiple shooting",
    "jaxid.output_error, initial states estimated",
)
WARM = str(len(SEEDS))
REPEATS = 2
"""Alternating warm fits, of which the least counts."""
SAME = 0.5
"""Costs within this are the same optimum: half chi-squared, so one standard error in one of the 31 directions."""
CLOSE = 0.1
"""A rival has arrived when its cost is within this of the best."""
COLD_RUNS = 1


class Rival:
    """A rival's process."""

    def __init__(self, name: str):
        self.name = name
        self.process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.rivals.worker", name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env={**os.environ, **ENVIRONMENT},
        )

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send a request and wait for its answer."""
        assert self.process.stdin and self.process.stdout
        print(json.dumps(request), file=self.process.stdin, flush=True)
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"the process of '{self.name}' ended before it answered; its message is above")
        return json.loads(line)

    def close(self) -> None:
        """Let the process end."""
        assert self.process.stdin
        self.process.stdin.close()
        self.process.wait()


def _compiler() -> str | None:
    if shutil.which("g++") is None:
        return None
    return subprocess.run(["g++", "-dumpfullversion"], capture_output=True, text=True, check=True).stdout.strip()


def machine() -> dict[str, Any]:
    """Processor, cores, load and versions."""
    processor = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
        processor = names[0] if names else processor
    packages = ("jax", "optimistix", "lineax", "equinox", "llvmlite", "scipy", "numba", "numpy")
    others = ("casadi", "diffrax", "mujoco")
    return {
        "processor": processor,
        "cores": os.cpu_count(),
        "load_at_start": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
        **{name: version(name) for name in others if find_spec(name)},
        "g++": _compiler(),
    }


def compare(samples: int, experiments: int, repeats: int, names: list[str]) -> dict[str, Any]:
    """First and warm fit of every rival."""
    with tempfile.TemporaryDirectory() as folder:
        problems = [make_problem(seed, samples, experiments) for seed in SEEDS]
        files = []
        for number, problem in enumerate(problems):
            files.append(Path(folder) / f"{number}.npz")
            problem.save(files[-1])

        def cost(answer: dict[str, Any], number: int) -> float:
            import numpy as np

            r = pioneer_numba.residual(problems[number], np.array(answer["x"]))
            return 0.5 * float(r @ r)

        rows: dict[str, Any] = {}
        rivals = {name: Rival(name) for name in names}
        try:
            for number in range(len(SEEDS)):
                last = number == len(SEEDS) - 1
                for repeat in range(repeats if last else 1):
                    for name, rival in rivals.items():
                        if repeat and name in ONCE:
                            continue
                        answer = rival.ask(problem=str(files[number]))
                        answer["cost"] = cost(answer, number)
                        rows.setdefault(name, {}).setdefault(str(number + 1), []).append(answer)
                        said = f"fit {number + 1:2d}  {name:<46} {answer['seconds']:7.2f} s"
                        print(
                            f"{said} ({answer['processor_seconds']:.2f} s processor), "
                            f"{answer['linearisations']} linearisations, cost {answer['cost']:.3f}",
                            flush=True,
                        )
            path = rivals["jaxid"].ask(problem=str(files[-1]), path=rows["jaxid"][WARM][0]["linearisations"])["path"]
        finally:
            for rival in rivals.values():
                rival.close()
    return {"fits": rows, "jaxid_path": path}


def summary(measured: dict[str, Any]) -> list[dict[str, Any]]:
    """One row a rival: first and warm fit, cost reached, and when it was within `SAME` of where it ended."""
    rows = []
    jaxid = measured["fits"]["jaxid"][WARM]
    free = [by_fit[WARM][0]["cost"] for name, by_fit in measured["fits"].items() if "known" not in name]
    best = min(free)
    for name, by_fit in measured["fits"].items():
        warm = by_fit[WARM]
        seconds = min([a["processor_seconds"] for a in warm])
        at = measured["jaxid_path"] if name == "jaxid" else warm[0]["path"]
        end = warm[0]["cost"]
        close = next((s for s, c in at if c < end + CLOSE), None)
        rows.append(
            {
                "name": name,
                "import_seconds": by_fit["1"][0]["import"]["processor_seconds"],
                "first_wall": by_fit["1"][0]["seconds"],
                "first": by_fit["1"][0]["processor_seconds"],
                "first_cost": by_fit["1"][0]["cost"],
                "warm_wall": min([a["seconds"] for a in warm]),
                "warm": seconds,
                "cost": end,
                "linearisations": warm[0]["linearisations"],
                "to_its_optimum": close,
                "to_best": next((s for s, c in at if c < best + CLOSE), None),
                "reason": warm[0]["reason"],
                "ratio": seconds / min([a["processor_seconds"] for a in jaxid]),
            }
        )
    return rows


def cold(runs: int) -> list[dict[str, Any]]:
    """Integral least squares and output error of the six demonstration logs, each time in a new process."""
    results = []
    for _ in range(runs):
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.rivals.cold"],
            cwd=ROOT,
            env={**os.environ, "JAX_ENABLE_COMPILATION_CACHE": "false"},
            capture_output=True,
            text=True,
            check=True,
        )
        results.append({**json.loads(done.stdout.splitlines()[-1]), "process_wall": time.perf_counter() - begin})
        print(f"cold process: {results[-1]['total']['seconds']:.1f} s", flush=True)
    return results


def sections(quick: bool) -> dict[str, Any]:
    """The other tables, from a process of their own on one core."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sections.json"
        command = [sys.executable, "-m", "benchmarks.rivals.sections", str(file), *(["--quick"] if quick else [])]
        subprocess.run(command, cwd=ROOT, env={**os.environ, **ENVIRONMENT}, check=True)
        return json.loads(file.read_text())


def _write(results: dict[str, Any]) -> None:
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    (ROOT / "docs/speed.md").write_text(page(results, SAME, CLOSE))


def main() -> None:
    """Run everything and write the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a trial of short logs that writes nothing")
    parser.add_argument("--only", nargs="*", choices=[*RIVALS, "cold"], help="these rivals only; writes nothing")
    parser.add_argument("--cold", action="store_true", help="measure the cold process anew; the fits stay as they are")
    parser.add_argument("--sections", action="store_true", help="measure all but whole fits and the cold process anew")
    options = parser.parse_args()
    if options.cold:
        known = json.loads(RESULTS.read_text())
        _write({**known, "cold": cold(COLD_RUNS)})
        return
    if options.sections:
        known = json.loads(RESULTS.read_text())
        _write({**known, **sections(False)})
        return
    names = [name for name in RIVALS if not options.only or name in options.only or name == "jaxid"]
    left_out = {name: why for name in names if (why := absent(name))}
    names = [name for name in names if name not in left_out]
    facts = machine()
    samples, experiments, repeats = (200, 3, 1) if options.quick else (1000, 8, REPEATS)
    measured = compare(samples, experiments, repeats, names)
    rows = summary(measured)
    others = sections(options.quick) if not options.only else {}
    runs = cold(1 if options.quick else COLD_RUNS)
    results = {"machine": facts, "rows": rows, "left_out": left_out, "cold": runs, **measured, **others}
    if options.quick or options.only:
        print(page(results, SAME, CLOSE))
        return
    _write(results)


if __name__ == "__main__":
    main()
