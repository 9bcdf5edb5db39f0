"""fit.json and model.toml: the results of a fit for other programs. `docs/files.md` describes every key.

Numbers are SI and written to the last digit; what is not a finite number (the standard error of a fixed parameter) is
null. Files are complete or not there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .._json import plain, write_json
from ..estimate.confidence.agreement import Agreement
from ..estimate.result import Fit
from ..model_file import write_model


def _prediction(found: Agreement | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        # A number that leaves logs out must not pass for one that does not.
        "normalised_rms": None if found.diverged else found.normalised_rms,
        "fit_percent": dict(found.fit_percent),
    } | ({"diverged": list(found.diverged)} if found.diverged else {})


def fit_document(
    fits: Sequence[Fit],
    held_out: Mapping[str, Agreement] | None = None,
    ahead: Mapping[str, Mapping[int, Agreement]] | None = None,
) -> dict[str, Any]:
    """What fit.json holds: every method's parameters, combinations and prediction of the held-out logs.

    `held_out` is by method, `ahead` by method and samples ahead; "check", the name that other programs read it by, is None
    for a method without (no logs were held out). Raises `ValueError` for no fits.
    """
    if not fits:
        raise ValueError("There are no fits to write; give at least one.")
    methods: dict[str, Any] = {}
    for fit in fits:
        methods[fit.method] = {
            "judgement": fit.judgement.to_dict() if fit.judgement else None,
            "standard_errors": fit.standard_errors,
            "parameters": {name: estimate.to_dict() for name, estimate in fit.parameters.items()},
            "combinations": {name: estimate.to_dict() for name, estimate in fit.combinations.items()},
            "check": _prediction((held_out or {}).get(fit.method)),
        }
        if fit.remarks:
            methods[fit.method]["notes"] = list(fit.remarks)
        horizons = (ahead or {}).get(fit.method)
        if horizons is not None:
            methods[fit.method]["check"] |= {"samples_ahead": {str(k): v.normalised_rms for k, v in horizons.items()}}
        if fit.disturbance is not None:
            methods[fit.method] |= {
                "converged": fit.converged,
                "iterations": fit.iterations,
                "logs": fit.log_status,
                "disturbance": fit.disturbance.to_dict(),
            }
        if fit.method == "output_error":
            methods[fit.method] |= {
                "converged": fit.converged,
                "iterations": fit.iterations,
                "logs": fit.log_status,
                "clock_offsets": {name: offset.to_dict() for name, offset in fit.clock_offsets.items()},
                "outliers": [asdict(outlier) for outlier in fit.outliers],
            }
    return plain({"robot": fits[0].robot.name, "methods": methods})


def write_fit(
    folder: str | Path,
    fits: Sequence[Fit],
    held_out: Mapping[str, Agreement] | None = None,
    ahead: Mapping[str, Mapping[int, Agreement]] | None = None,
) -> None:
    """Write `folder`/fit.json, and `folder`/model.toml with the last fit's robot.

    Raises `OSError` if the folder cannot be written and `ValueError` for no fits.
    """
    folder = Path(folder)
    write_json(folder / "fit.json", fit_document(fits, held_out, ahead))
    last = fits[-1]
    errors = {name: estimate.std_error for name, estimate in last.parameters.items()}
    doubted = last.judgement is not None and last.judgement.verdict in ("poor", "failed")
    remark = last.judgement.sentence if last.judgement is not None and doubted else ""
    write_model(folder / "model.toml", last.robot.alone, errors, last.method, remark)
