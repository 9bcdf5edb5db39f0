"""How long an explanation takes: `python -m benchmarks.naming_seconds`.

One hidden case of medium strength for every robot (six logs to fit and three held out, 25 s at 50 Hz) is explained on the
command line, page included, in a process of its own: first with an empty cache of compiled programs, then again with that
cache filled. Writes `benchmarks/results/naming_seconds.json`; `python -m benchmarks.naming --report` shows it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .hidden.cases import make
from .naming import RESULTS, plans

HIDDEN = {"axis": "stribeck_friction", "omni": "actuator_dead_zone", "pioneer": "stribeck_friction"}
WRITTEN = RESULTS / "naming_seconds.json"


def seconds(robot: str, folder: Path, cache: Path) -> tuple[float, str]:
    """Elapsed seconds of `jaxid explain` on the case in `folder`, and its verdict."""
    out = folder / "out"
    command = [
        *(sys.executable, "-m", "jaxid.cli", "explain", robot),
        *("--fit", str(folder / "fit_*.csv"), "--held-out", str(folder / "check_*.csv")),
        *("--model", str(folder / "nominal.toml"), "--out", str(out)),
    ]
    begin = time.perf_counter()
    subprocess.run(
        command, check=True, capture_output=True, env={**os.environ, "JAX_COMPILATION_CACHE_DIR": str(cache)}
    )
    took = time.perf_counter() - begin
    found = json.loads((out / "explanation.json").read_text(encoding="utf-8"))
    return took, " ".join([found["verdict"], *(effect["id"] for effect in found["effects"])])


def main() -> None:
    """Time every robot's case and write the figures."""
    argparse.ArgumentParser(description="Seconds of an explanation, with an empty and a filled cache.").parse_args()
    figures = {}
    for robot, hidden in HIDDEN.items():
        (plan,) = [p for p in plans("main") if f"{robot}/single/{hidden}/medium/" in p.name]
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            make(plan.robot, plan.effects, plan.seed).write(folder)
            first, verdict = seconds(robot, folder, folder / "cache")
            again, _ = seconds(robot, folder, folder / "cache")
        figures[plan.name] = {"first": round(first, 1), "cache filled": round(again, 1), "said": verdict}
        print(f"{plan.name}: {first:.1f} s, with a filled cache {again:.1f} s ({verdict})", flush=True)
        WRITTEN.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
