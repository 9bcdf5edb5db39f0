"""jaxid under a type checker that looks at every call: every module imports, and journeys run, shapes of arrays included.

In a process of its own, since the checker has to be there before jaxid is imported. `JAXID_CHECK_ANNOTATIONS=1 pytest` checks
whatever else the tests do (those that hand over wrong types on purpose fail with it).
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("beartype", reason="annotations are checked by beartype (extra `test`)")
ROOT = Path(__file__).parents[1]
JOURNEY = """
import importlib, pkgutil
import jaxtyping
import tests.annotations
jaxtyping.install_import_hook("jaxid", "tests.annotations.checked")
import jaxid
modules = [m.name for m in pkgutil.walk_packages(jaxid.__path__, "jaxid.") if not m.name.endswith("__main__")]
for name in modules:
    importlib.import_module(name)
assert len(modules) > 150
import jax.numpy as jnp
import numpy as np
from jaxid import Axis, Channels, Custom, Integrator, Log, LogSet, Parameter
from jaxid import compare, integral_least_squares, output_error, simulate

rng = np.random.default_rng(1)
time, u = 0.02 * np.arange(300), np.repeat(rng.uniform(-3, 3, 15), 20)
def recorded(name, robot, outputs):
    still = Log.from_arrays(name, time, u, np.zeros((300, outputs)), robot.channels)
    clean = simulate(robot, LogSet([still]), integrator=Integrator(2))[0]
    return Log.from_arrays(name, time, u, clean + 0.01 * rng.normal(size=clean.shape), robot.channels)

logs = LogSet([recorded(name, Axis(), 2) for name in "ab"])
linear = integral_least_squares(Axis(), logs[:1])
fit = output_error(Axis(), logs[:1], start=linear, integrator=Integrator(2))
found = compare(linear, fit, held_out=logs[1:])
repr(found), repr(fit), fit._repr_html_(), logs.preflight()

def pendulum(x, u, p, dry):
    return {"q": x["w"], "w": u["u"] - p["g"] * jnp.sin(x["q"]) - dry["pivot"]}

own = Custom(
    dynamics=pendulum,
    state_names=("q", "w"),
    own_channels=Channels(("u",), ("q",), units={"u": "N m", "q": "rad"}),
    table={"g": Parameter(9.0, "1/s^2", free=True, lower=0.0), "c": Parameter(0.1, "1/s^2", free=True, lower=0.0)},
    dry_friction={"pivot": ("w", "c")},
)
assert output_error(own, LogSet([recorded("own", own, 1)]), integrator=Integrator(2)).free_names == ("g", "c")
"""


@pytest.mark.slow
def test_every_module_imports_and_fits_run_under_the_checker():
    search = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = subprocess.run(
        [sys.executable, "-c", JOURNEY],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": search},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr[-3000:]
