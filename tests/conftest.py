"""What several test files share. Double precision is asked for by a fixture, never by JAX's global flag."""

import gc
import os
from importlib.metadata import version
from pathlib import Path

# Both test processes, the notebooks' kernels and the command line share what one of them has compiled, small programs too.
# Set before JAX is imported.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache/compiled"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
# Most of the tests' time is compiling, for programs that run on a few hundred samples: as little of it as possible.
HASTY = ["--xla_backend_optimization_level=0", "--xla_llvm_disable_expensive_passes=true"]
if tuple(map(int, version("jaxlib").split(".")[:2])) < (0, 12):
    HASTY.append("--xla_cpu_use_fusion_emitters=false")  # XLA refuses to start with an option that it does not know
os.environ["XLA_FLAGS"] = " ".join([*HASTY, os.environ.get("XLA_FLAGS", "")])

if os.environ.get("JAXID_CHECK_ANNOTATIONS"):
    # Every annotation of jaxid, shapes of arrays included, is checked at every call. Before jaxid is imported.
    import jaxtyping

    import tests.annotations  # noqa: F401

    jaxtyping.install_import_hook("jaxid", "tests.annotations.checked")

# One thread for a program, as on the command line: two test processes fill two cores.
os.environ.setdefault("PJRT_NPROC", "1")
# Threads of linear algebra on small matrices mostly wait for one another: with two of them on two busy cores a least-squares
# test took thirty times as long. Before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import pytest  # noqa: E402
import threadpoolctl  # noqa: E402

# jaxid itself is imported where it is used: the process that only hands out the tests starts sooner.

# What the tests start in processes of their own (notebooks, command lines) reads modules that one of them has compiled.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# NumPy may have been imported by a plugin of pytest's.
threadpoolctl.threadpool_limits(1, user_api="blas")

# Tracing makes millions of small objects; going through them again and again takes a fifth of the time.
gc.set_threshold(50_000, 20, 50)

DEMO = Path(__file__).parents[1] / "jaxid/demo_logs"


SHARED = (
    "test_explanation.py",
    "test_explanation_page.py",
    "test_pages.py",
    "test_cli_explain.py",
    "test_explained_fleet.py",
    "test_saved_results.py",
    "test_cli_fleet.py",
    "test_verdict.py",
)
"""Files that share the explanation `explained`."""
LONGEST = (
    "tests/reference/test_laws",
    "tests/kernel",
    "test_notebooks",
    "tests/explanation",
    "tests/estimate",
    "test_cli",
    "tests/papers",
    "tests/fuzz",
)
"""What is begun first: while one process compiles the reference simulator, which takes half a minute, the other does what needs
none of it, and finds it compiled; then what is long, so that no process is left with one of them at the end."""


def pytest_collection_modifyitems(items):
    gc.freeze()  # what all test files have imported stays

    def turn(item):
        return next((k for k, part in enumerate(LONGEST) if part in item.nodeid), len(LONGEST))

    items.sort(key=turn)
    if os.environ.get("JAXID_CHECK_ANNOTATIONS"):
        for item in items:
            if item.get_closest_marker("wrong_types"):
                item.add_marker(pytest.mark.skip(reason="hands over wrong types on purpose"))


LEFT_OUT = pytest.StashKey[set[str]]()
"""Slow tests that this run does not run: its end names them."""


def pytest_configure(config):
    # Most logs of the tests are short or have a fault on purpose; the tests of warnings ask for them.
    config.addinivalue_line("filterwarnings", "ignore::jaxid.logs.finding.LogWarning")
    config.stash[LEFT_OUT] = set()


def pytest_deselected(items):
    slow = {item.nodeid for item in items if item.get_closest_marker("slow")}
    items[0].config.stash[LEFT_OUT] |= slow


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):  # one of several processes
        session.config.workeroutput["left_out"] = sorted(session.config.stash[LEFT_OUT])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    node.config.stash[LEFT_OUT] |= set(getattr(node, "workeroutput", {}).get("left_out", ()))


def pytest_terminal_summary(terminalreporter, config):
    for name in sorted(config.stash[LEFT_OUT]):
        terminalreporter.write_line(f"LEFT OUT (slow, run it with `pytest -m slow`) {name}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The tests of a file run in one process, which makes and traces what they share once; every notebook for itself."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.split("::")[0]
            if "test_notebooks" in file:
                return nodeid
            return "explained" if file.rsplit("/", 1)[-1] in SHARED else file

    config.option.loadscopereorder = False
    return ByFile(config, log)


@pytest.fixture
def double_precision():
    """Double precision for one test, as inside jaxid's public functions."""
    from jaxid import float64

    with float64():
        yield


@pytest.fixture
def jaxid(capsys):
    """Run a command line: (exit status, stdout, stderr)."""
    from jaxid.cli import main

    def run(*argv):
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in argv])
        said = capsys.readouterr()
        return end.value.code or 0, said.out, said.err

    return run


@pytest.fixture(scope="session")
def demo_logs():
    """`demo_logs("pioneer", "fit_*")`: logs of the independent simulator."""
    from jaxid import read_logs

    def read(robot, pattern="fit_*"):
        return read_logs(DEMO / robot / f"{pattern}.csv", robot=robot)

    return read


@pytest.fixture(scope="session")
def demo_truth():
    """`demo_truth("pioneer")`: the parameters behind the demonstration logs."""
    import tomllib

    return lambda robot: tomllib.loads((DEMO / robot / "truth.toml").read_text())


@pytest.fixture(scope="session")
def axis_law():
    """Drive axis in closed form, sample by sample: input held, back-EMF zero, true sticking.

    Within a stretch of constant sliding direction v approaches (u - offset - Fc sgn v) / Fv exponentially; at a zero of
    v the axis stops and stays or reverses. No integration, and nothing of jaxid.
    """

    def run(inputs, dt, M=1.0, Fv=2.0, Fc=0.5, offset=0.0, v=0.0, q=0.0):
        speeds, positions = [], []
        for u, interval in zip(inputs, np.broadcast_to(dt, len(inputs)), strict=True):
            speeds.append(v)
            positions.append(q)
            left, pull, tau = interval, u - offset, M / Fv
            while left > 0:
                direction = np.sign(v) if v != 0 else np.sign(pull) * (abs(pull) > Fc)
                if direction == 0:
                    break
                final = (pull - direction * Fc) / Fv
                stop = tau * np.log((v - final) / -final) if v != 0 and v * final < 0 else np.inf
                span = min(left, stop)
                decay = np.exp(-span / tau)
                q += final * span + (v - final) * tau * (1 - decay)
                v = 0.0 if stop <= left else final + (v - final) * decay
                left -= span
        return np.array(speeds), np.array(positions)

    return run


@pytest.fixture(scope="session")
def axis_log(axis_law):
    """`axis_log(name, inputs, noise, seed, dt, **parameters)`: a measured axis, speed and position."""

    def measured(name, inputs, noise=0.0, seed=0, dt=0.02, position=True, **parameters):
        inputs = np.asarray(inputs, dtype=float)
        intervals = np.broadcast_to(dt, len(inputs))
        time = np.concatenate([[0.0], np.cumsum(intervals)[:-1]])
        v, q = axis_law(inputs, intervals, **parameters)
        rng = np.random.default_rng(seed)
        outputs = {"v": v + noise * rng.normal(size=v.shape)}
        if position:
            outputs["q"] = q + noise * rng.normal(size=v.shape)
        from jaxid import AXIS, Log

        return Log.from_arrays(name, time, inputs[:, None], outputs, AXIS)

    return measured


@pytest.fixture(scope="session")
def hidden_drag(tmp_path_factory):
    """Folder of short CSV logs `fit_*` and `check_*` of an axis with 1.5 N s²/m² of quadratic drag, by the independent
    simulator; noise 0.01 m/s."""
    pytest.importorskip("numba", reason="the independent simulator needs numba")
    from reference import excitation
    from reference.axis import AXIS as axis
    from reference.logs import simulate_log

    folder = tmp_path_factory.mktemp("hidden")
    drag = {"quadratic_drag": {"coefficient": 1.5}}
    plan = [("fit", kind) for kind in ("multilevel", "prbs_reversing", "crawl")]
    for seed, (role, kind) in enumerate([*plan, ("check", "multilevel"), ("check", "crawl")], start=31):
        inputs = excitation.experiment("axis", kind, 500, seed)
        table = simulate_log(axis, inputs, 0.02, 0.01, seed, drag)
        table[["t", "u", "v"]].to_csv(folder / f"{role}_{kind}.csv", index=False)
    return folder


@pytest.fixture(scope="session")
def explained(hidden_drag):
    """The explanation of `hidden_drag`, its held-out logs with it."""
    from jaxid import Axis, explain, integral_least_squares, output_error, read_logs

    logs, held_out = (read_logs(hidden_drag / f"{role}_*.csv", "axis") for role in ("fit", "check"))
    start = integral_least_squares(Axis(), logs)
    return explain(output_error(Axis(), logs, start=start), logs, held_out)
