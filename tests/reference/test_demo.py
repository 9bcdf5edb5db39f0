"""The shipped demonstration logs are what the generator writes, small, and hold what the papers' methods need."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reference import demo
from reference.omni import PARAMETERS as OMNI
from reference.pioneer import PARAMETERS as PIONEER

SHIPPED = Path(__file__).parents[2] / "jaxid" / "demo_logs"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    demo.write_all(folder)
    return folder


@pytest.mark.slow
def test_shipped_logs_are_reproduced(written):
    names = sorted(path.relative_to(written) for path in written.rglob("*.csv"))
    assert names == sorted(path.relative_to(SHIPPED) for path in SHIPPED.rglob("*.csv")) and len(names) == 55
    for name in names:
        new, old = pd.read_csv(written / name), pd.read_csv(SHIPPED / name)
        assert list(new) == list(old)
        np.testing.assert_allclose(new.to_numpy(float), old.to_numpy(float), atol=1.1e-4)  # the last digit may round
    assert (written / "README.md").read_text() == (SHIPPED / "README.md").read_text()
    assert sum(path.stat().st_size for path in SHIPPED.rglob("*") if path.is_file()) < 2.5e6


@pytest.mark.parametrize(
    ("folder", "truth"), [("pioneer", PIONEER), ("omni", OMNI), ("pioneer_paper", PIONEER), ("omni_paper", OMNI)]
)
def test_truth_files_hold_the_constants(written, folder, truth):
    stored = tomllib.loads((written / folder / "truth.toml").read_text())
    assert stored == {name: value for name, value in truth.items() if value < 1e29}


def test_the_unknown_robots_truth_is_where_nobody_looks_by_accident(written):
    stored = tomllib.loads((written / "unknown" / "do_not_look_yet.toml").read_text())
    effects = stored.pop("effects")
    assert effects == demo.UNKNOWN_EFFECT and stored == demo.UNKNOWN.parameters
    shipped = SHIPPED / "unknown"
    assert (shipped / "do_not_look_yet.toml").read_text() == (written / "unknown" / "do_not_look_yet.toml").read_text()
    # Neither the file names nor the notes on the logs tell what is hidden.
    told = " ".join(path.name for path in shipped.iterdir()) + (SHIPPED / "README.md").read_text()
    assert not any(name.split("_")[0] in told for name in effects)


def test_hanging_robot_gives_its_inertia(written):
    for log in sorted((written / "omni_paper").glob("hanging_*.csv")):
        table = pd.read_csv(log)
        acceleration = 2 * np.polyfit(table.t, table.theta, 2)[0]
        assert table.mass[0] * 9.8 * 0.25 / acceleration == pytest.approx(OMNI["J"], rel=0.01)


def test_coast_down_starts_fast_and_stops_without_currents(written):
    for axis, speed in (("V", 1.4), ("Vn", 0.95), ("W", 1.9)):
        table = pd.read_csv(written / "omni_paper" / f"coast_{axis}.csv")
        seen, currents = table[axis].to_numpy(), table[["i1", "i2", "i3", "i4"]].to_numpy()
        assert seen[90:100].mean() == pytest.approx(speed, abs=0.03) and abs(seen[-10:].mean()) < 0.03
        assert np.abs(currents[100:]).max() < 0.25


def test_commanded_speeds_are_reached_within_the_current_limit(written):
    """Figures 2-4 and 10-12: speeds are commanded, and no motor draws more than 6 A (0.05 A of noise apart)."""
    paths = [path for kind in ("steady", "control") for path in sorted((written / "omni_paper").glob(f"{kind}_*.csv"))]
    assert len(paths) == 15
    for path in paths:
        _, axis, *speed = path.stem.split("_")
        wanted, table = float(speed[0] if speed else 1.0), pd.read_csv(path)
        motors = table[["i1", "i2", "i3", "i4"]].to_numpy()
        assert np.abs(motors).max() < 6.0 + 5 * 0.05
        assert np.abs(table[["u1", "u2", "u3", "u4"]].to_numpy()).max() <= 24.0
        late = table[table.t > 1.2]
        assert late[axis].mean() == pytest.approx(wanted, abs=0.02)
        # What friction takes at that speed is what the motors give, M dv/dt aside.
        lever = {"V": (0, -1, 0, 1), "Vn": (1, 0, -1, 0), "W": 4 * (OMNI["b"],)}[axis]
        force = (
            OMNI["l"] * OMNI["Kt"] / OMNI["r"] * np.mean(motors[table.t > 3.0] @ lever) if table.t.max() > 4 else None
        )
        if force is not None:
            viscous, coulomb = {"V": ("Bv", "Cv"), "Vn": ("Bvn", "Cvn"), "W": ("Bw", "Cw")}[axis]
            assert force == pytest.approx(OMNI[viscous] * wanted + OMNI[coulomb], rel=0.02)


def test_pioneer_logs_start_straight(written):
    for log in (written / "pioneer").glob("*.csv"):
        table = pd.read_csv(log)
        start = table[table.t < 1.2]
        assert (start.V2 == start.V3).all() and (start.V2 > 0).all() and len(table) == 1251
