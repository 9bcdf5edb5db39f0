"""Deliberate faults, one at a time, in a copy of the checkout: do the tests that stand nearby notice?

    python -m benchmarks.mutation            apply each fault, run its tests, report those that survive (exit status 1)
    python -m benchmarks.mutation --match    only look whether every fault still matches the code exactly once (seconds)
    python -m benchmarks.mutation 3 7        those faults only

Compiled programs are kept between faults where JAX_COMPILATION_CACHE_DIR says so.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.faults import FAULTS, Fault

ROOT = Path(__file__).parents[1]


def matches(fault: Fault, root: Path = ROOT) -> int:
    """How often the fault's text stands in its file."""
    path = root / fault.file
    return path.read_text(encoding="utf-8").count(fault.old) if path.exists() else 0


def noticed(fault: Fault, copy: Path) -> bool:
    """Whether the fault's tests fail with it."""
    path = copy / fault.file
    good = path.read_text(encoding="utf-8")
    path.write_text(good.replace(fault.old, fault.new), encoding="utf-8")
    try:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *fault.tests.split()]
        run = subprocess.run(command, cwd=copy, capture_output=True, text=True, env=_environment(copy))
    finally:
        path.write_text(good, encoding="utf-8")
    if run.returncode not in (0, 1):
        raise RuntimeError(f"{fault.tests} did not run:\n{run.stdout}{run.stderr}")
    return run.returncode == 1


def _environment(copy: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(copy)}


def main(arguments: list[str]) -> int:
    """Exit status: 0 if every fault was noticed (or, with --match, matches exactly once)."""
    wrong = [fault for fault in FAULTS if matches(fault) != 1]
    for fault in wrong:
        print(f"{fault.what}: its text stands {matches(fault)} times in {fault.file}; write the fault anew")
    if wrong or "--match" in arguments:
        return 1 if wrong else 0
    chosen = [FAULTS[int(number) - 1] for number in arguments] or list(FAULTS)
    survived = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        kept = shutil.ignore_patterns(".git", ".venv", ".pytest_cache", "__pycache__")
        shutil.copytree(ROOT, copy, ignore=kept)
        for fault in chosen:
            began = time.perf_counter()
            found = noticed(fault, copy)
            survived += not found
            print(
                f"{'noticed ' if found else 'SURVIVED'}  {time.perf_counter() - began:5.0f} s  {fault.what}", flush=True
            )
    print(f"{len(chosen) - survived} of {len(chosen)} faults noticed")
    return 1 if survived else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
