"""One rival in a process of its own: `python -m benchmarks.rivals.worker NAME`.

Reads one JSON request a line ({"problem": file} or {"problem": file, "path": true}), answers with one JSON line. One
processor core, one thread, no persistent compilation cache.
"""

import importlib
import json
import os
import sys
import time
from pathlib import Path

RIVALS = {
    "jaxid": ("jaxid_fit", "core"),
    "jaxid.output_error, initial states estimated": ("jaxid_fit", "public_estimate"),
    "jaxid.output_error, known start": ("jaxid_fit", "public_known"),
    "SciPy trf, dense differences, numba": ("scipy_fit", "dense"),
    "SciPy trf, structured differences, numba": ("scipy_fit", "structured"),
    "optimistix as it comes": ("optimistix_fit", "plain"),
}
ENVIRONMENT = {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "JAX_ENABLE_COMPILATION_CACHE": "false",
    "JAX_PLATFORMS": "cpu",
}


def main() -> None:
    """Serve fits until the input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever a library prints is not an answer
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    wall, processor = time.perf_counter(), time.process_time()
    module_name, function = RIVALS[sys.argv[1]]
    module = importlib.import_module(f"benchmarks.rivals.{module_name}")
    from benchmarks.rivals.pioneer_problem import FitProblem

    imported = {"seconds": time.perf_counter() - wall, "processor_seconds": time.process_time() - processor}
    for line in sys.stdin:
        request = json.loads(line)
        problem = FitProblem.load(Path(request["problem"]))
        if "path" in request:
            answer = {"path": module.path(problem)}
        else:
            wall, processor = time.perf_counter(), time.process_time()
            reached = getattr(module, function)(problem)
            answer = {
                "seconds": time.perf_counter() - wall,
                "processor_seconds": time.process_time() - processor,
                "linearisations": reached.linearisations,
                "reason": reached.reason,
                "path": reached.path,
                "x": [float(v) for v in reached.x],
                "import": imported,
            }
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
