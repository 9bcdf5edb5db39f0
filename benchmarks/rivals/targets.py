"""What was to be reached, and whether a run's results reach it: computed, never stated."""

from typing import Any, NamedTuple

Row = dict[str, Any]
_WARM = (
    ("SciPy trf, structured differences, numba", 10),
    ("SciPy trf, dense differences, numba", 25),
    ("CasADi generated C, SciPy trf", 5),
    ("optimistix as it comes", 100),
)
"""How many times jaxid's seconds a rival's warm fit was to take."""
_FASTER, _OF_SIMD, _SMALL, _FLAT = 4.0, 1.2, 3.0, 1.3


class Met(NamedTuple):
    """One figure: what was asked for, what was found, and whether that is it."""

    figure: str
    target: str
    found: str
    verdict: str


def _verdict(met: bool) -> str:
    return "met" if met else "not met"


def _linearisations(rows: list[Row]) -> list[Met]:
    found = []
    for row in rows:
        if row["robot"] != "pioneer" or len(row["ways"]) < 3:
            continue
        own, scalar, simd = (row["ways"][way]["processor_ms"] for way in ("jaxid", "C++, scalar", "C++, simd"))
        what = f"linearisation, {row['experiments']} experiments"
        faster, share = scalar / own, own / simd
        found.append(Met(f"{what}, against scalar C++", "≥ 4 × faster", f"{faster:.1f} ×", _verdict(faster >= _FASTER)))
        found.append(
            Met(
                f"{what}, against C++ in eight lanes", "≤ 1.2 × its time", f"{share:.2f} ×", _verdict(share <= _OF_SIMD)
            )
        )
    return found


def _warm(rows: list[Row], same: float) -> list[Met]:
    by_name = {row["name"]: row for row in rows}
    own, found = by_name["jaxid"], []
    for name, target in _WARM:
        row = by_name.get(name)
        if row is None:
            continue
        seconds = f"{row['ratio']:.1f} ×"
        if row["cost"] > own["cost"] + same:
            verdict = f"not compared: it stopped at cost {row['cost']:.2f}, jaxid at {own['cost']:.2f}"
        elif own["cost"] > row["cost"] + same:
            verdict = f"not met: jaxid stopped at cost {own['cost']:.2f}, above its {row['cost']:.2f}"
        else:
            verdict = _verdict(row["ratio"] >= target)
        found.append(Met(f"warm fit, against {name}", f"≥ {target} × faster", seconds, verdict))
    return found


def _small(rows: list[Row]) -> list[Met]:
    rate = {row["way"]: row["fits_per_processor_second"] for row in rows}
    if not {"jaxid", "C++, scalar"} <= set(rate):
        return []
    found = rate["jaxid"] / rate["C++, scalar"]
    what = f"{rows[0]['fits']:,} small fits, fits a second against scalar C++"
    return [Met(what, "≥ 3 ×", f"{found:.2f} ×", _verdict(found >= _SMALL))]


def _flat(rows: list[Row]) -> list[Met]:
    filled = [row["us_per_experiment_sample"] for row in rows if row["experiments"] >= 8]
    if not filled:
        return []
    found = max(filled) / min(filled)
    what = "cost per experiment × sample from eight experiments on, largest over least"
    return [Met(what, "≤ 1.3", f"{found:.2f}", _verdict(found <= _FLAT))]


def targets(results: dict[str, Any], same: float) -> list[Met]:
    """All that these results allow to compute; costs within `same` are the same optimum."""
    return [
        *_linearisations(results.get("linearisations", [])),
        *_warm(results["rows"], same),
        *_small(results.get("small_fits", [])),
        *_flat(results.get("scaling", [])),
    ]
