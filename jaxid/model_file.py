"""model.toml: what is known about one robot's parameters, as data.

    robot = "pioneer"

    longest_step = 0.005           # s, where the fit found that longer integration steps would change it

    [parameters]
    M = 16.2                       # a known constant: the value alone

    [parameters.Cs]
    value = 0.31
    free = true
    lower = 0.0
    upper = 2.0
    prior = [0.3, 0.1]             # mean, standard deviation

    [[effects]]                    # added from the catalogue, at zero unless the file says otherwise
    id = "stribeck_friction"
    law = "gaussian"               # which of the mechanism's laws; the usual one where none is named

    [parameters."stribeck_friction.amplitude"]
    value = 0.1

Every entry overrides the robot's own; what is not mentioned stays as it is. The same file is written after a fit, with
the estimates as values. `docs/files.md` describes each key.
"""

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ._atomic import write_text
from ._toml import read_toml, shown
from .effects import catalogue, effect_by_id, laws_of
from .effects.curve import Curve
from .effects.table_constants import TableConstants
from .logs.log import did_you_mean
from .parameters import Parameter, ParameterError, ParameterTable
from .robots import Effect, EffectError, Robot

_TOP = ("robot", "method", "longest_step", "parameters", "effects")
_READ = ("value", "free", "lower", "upper", "prior")
_WRITTEN = ("unit", "std_error", "meaning")
"""Keys that say something to the reader and change nothing (`unit` must be the robot's own)."""
_DENSEST = 7
"""Most points that a curve may have between two of its usual ones."""
_SIZES = (1e-100, 1e30)
"""Sizes of numbers that are not zero; an estimate may end next to zero."""

_WIDTH = 110
"""Characters of a line of remarks."""


class ModelFileError(ValueError):
    """A model file that cannot be used. The message is one sentence with file, key and remedy."""


def _number(entry: Any, key: str, path: Path, *, infinite: bool = False) -> float:
    if isinstance(entry, int | float) and not isinstance(entry, bool):
        try:
            number = float(entry)
        except OverflowError:
            number = math.inf
        if math.isinf(number) and infinite:
            return number
        if math.isfinite(number):
            if number != 0 and not _SIZES[0] <= abs(number) <= _SIZES[1]:
                raise ModelFileError(f"{path}: {key} = {number:g} is beyond any physical size; give it in SI units.")
            return number
    raise ModelFileError(f"{path}: {key} = {entry!r:.60} is not a finite number; give one in SI units.")


def _prior(entry: Any, key: str, path: Path) -> tuple[float, float]:
    if not isinstance(entry, list) or len(entry) != 2:
        raise ModelFileError(f"{path}: {key} = {entry!r:.60} is no prior; give [mean, standard deviation].")
    mean, deviation = (_number(value, key, path) for value in entry)
    if deviation <= 0:
        raise ModelFileError(f"{path}: {key} = {entry!r} has no positive standard deviation; give one above zero.")
    return mean, deviation


def _override(name: str, entry: Any, own: Parameter, path: Path) -> Parameter:
    """The robot's `own` parameter with what the file says about it."""
    if not isinstance(entry, Mapping):
        entry = {"value": entry}
    key = f"parameters.{name}"
    for other in entry:
        if other not in (*_READ, *_WRITTEN):
            raise ModelFileError(
                f"{path}: {key} has an unknown key {other!r:.60}{did_you_mean(other, _READ)}; use {', '.join(_READ)}."
            )
    unit = entry.get("unit", own.unit)
    if not isinstance(unit, str) or (own.unit and unit != own.unit):
        raise ModelFileError(f"{path}: {key}.unit = {unit!r:.60}, but {name} is in {own.unit!r}; convert the numbers.")
    fields: dict[str, Any] = {}
    if "value" in entry:
        fields["value"] = _number(entry["value"], f"{key}.value", path)
    if "free" in entry:
        if not isinstance(entry["free"], bool):
            raise ModelFileError(
                f"{path}: {key}.free = {entry['free']!r:.60} is neither true nor false; give one of them."
            )
        fields["free"] = entry["free"]
    for bound in ("lower", "upper"):
        if bound in entry:
            fields[bound] = _number(entry[bound], f"{key}.{bound}", path, infinite=True)
    if "prior" in entry:
        fields["prior"] = _prior(entry["prior"], f"{key}.prior", path)
    parameter = replace(own, **fields)
    if own.lower >= 0 and min(parameter.lower, parameter.value) < 0:
        which = "value" if parameter.value < 0 else "lower"
        raise ModelFileError(
            f"{path}: {key}.{which} = {fields[which]:g} is negative, which {name} cannot be; give zero or more."
        )
    try:
        parameter.check(name)
    except ParameterError as error:
        raise ModelFileError(f"{path}: {error}.") from None
    return parameter


def _moves(robot: Robot) -> bool:
    """Whether the accelerations are finite in a state without symmetry."""
    numbers = {name: np.float64(value) for name, value in robot.parameters.numbers.items()}
    state = {name: np.float64(0.1) for name in robot.states}
    try:
        with np.errstate(all="ignore"):
            axes = robot.rubbing(state, numbers)
            inputs = tuple(np.float64(1.0) for _ in robot.channels.inputs)
            rates = robot.rates(state, inputs, tuple(np.float64(0.0) for _ in axes), numbers)
    except ZeroDivisionError:
        return False
    return bool(np.all([np.all(np.isfinite(np.asarray(rate))) for rate in rates.values()]))


def _check_zeros(robot: Robot, own: ParameterTable, path: Path) -> None:
    """A mass, radius or resistance of zero lies within its bounds and still makes no model."""
    for name, parameter in robot.parameters.items():
        if parameter.value == 0 and own[name].value != 0 and not _moves(robot):
            if _moves(robot.with_parameters(robot.parameters.change(name, value=own[name].value))):
                raise ModelFileError(
                    f"{path}: parameters.{name}.value = 0 makes the accelerations infinite; give it a value above zero."
                )


def _names_effect(entry: Any) -> bool:
    """Whether an entry of `effects` is a table with an id and at most a law, in words, and how dense a curve of it is."""
    words = isinstance(entry, dict) and isinstance(entry.get("id"), str) and isinstance(entry.get("law", ""), str)
    words = words and isinstance(entry.get("apart", False), bool)
    return words and type(entry.get("between", 0)) is int and 0 <= entry.get("between", 0) <= _DENSEST


def _with_effects(document: Mapping[str, Any], robot: Robot, path: Path, given: Sequence[Effect]) -> Robot:
    """The robot with the effects that the file names and the robot does not have, of those `given` or of the catalogue."""
    effects = document.get("effects", [])
    if not isinstance(effects, list) or not all(_names_effect(entry) for entry in effects):
        raise ModelFileError(
            f"{path}: effects is no list of tables with an id (and a law) in words, and for a curve the number of points "
            f"between its usual ones (between, 0 to {_DENSEST}) and whether each axis has its own (apart, true or false); "
            'write [[effects]] and id = "...".'
        )
    named = [effect["id"] for effect in effects]
    own = [effect.id for effect in robot.effects]
    if named and named[: len(own)] != own:
        raise ModelFileError(
            f"{path}: effects names {shown(', '.join(named))}, but the robot {robot.name!r} has {', '.join(own) or 'none'}; "
            "give the robot with these effects (package.module:attribute) or take them out of the file."
        )
    for entry in effects[len(own) :]:
        identifier, law = entry["id"], entry.get("law", "")
        points = {"between": entry.get("between", 0), "apart": entry.get("apart", False)}
        if identifier in [effect.id for effect in robot.effects]:
            raise ModelFileError(f"{path}: effects names {identifier} twice; take one of them out.")
        mine = next((effect for effect in given if (effect.id, effect.law) == (identifier, law)), None)
        try:
            effect = mine or effect_by_id(robot, identifier, law)
            robot = robot + (replace(effect, **points) if isinstance(effect, Curve) else effect)
        except EffectError as error:
            raise ModelFileError(f"{path}: effects names {identifier}, but {error}; take it out.") from None
        except KeyError:
            possible = [effect.law for effect in laws_of(robot, identifier)]
            if possible and law not in possible:
                raise ModelFileError(
                    f"{path}: effects names {identifier} with law = {shown(law)}, which it has not"
                    f"{did_you_mean(law, possible)}; use {', '.join(possible)}."
                ) from None
            near = did_you_mean(identifier, [effect.id for effect in catalogue(robot)])
            raise ModelFileError(
                f"{path}: effects names {identifier!r:.60}, which no effect of the catalogue for {robot.name!r} is{near}; "
                f"correct it, give your own effect (--effects package.module:attribute), or take it out of the file."
            ) from None
    return robot


def read_model(path: str | Path, robot: Robot, effects: Sequence[Effect] = ()) -> Robot:
    """The robot with the effects, numbers, free parameters, bounds and priors of a model file, which may name effects of
    the catalogue and the user's own `effects`.

    Raises `ModelFileError`, one sentence with file, key and remedy: a file that cannot be opened or is not TOML, another
    robot's file, unknown keys and parameters, values that are no finite numbers, impossible bounds and priors, negative
    values of what cannot be negative, effects that neither the robot nor the catalogue has.
    """
    path = Path(path)
    try:
        document = read_toml(path)
    except OSError as error:
        raise ModelFileError(f"The model {path} cannot be opened ({error.strerror}); check the path.") from None
    except ValueError as error:
        raise ModelFileError(
            f"The model {path} is not TOML ({error}); write lines like Cs = 0.3 under [parameters]."
        ) from None
    for key in document:
        if key not in _TOP:
            near = did_you_mean(key, _TOP)
            remedy = f"put it under [parameters] if {key} is a parameter" if key in robot.parameters else "take it out"
            raise ModelFileError(f"{path}: there is no key {key!r:.60} in a model{near}; {remedy}.")
    named = document.get("robot", robot.name)
    if named != robot.name:
        raise ModelFileError(
            f"{path}: robot = {named!r:.60}, but the robot given is {robot.name!r}; give the model of this robot."
        )
    entries = document.get("parameters", {})
    if not isinstance(entries, Mapping):
        raise ModelFileError(
            f"{path}: parameters = {entries!r:.60} is no table; write [parameters] and lines below it."
        )
    # Which effects and laws it can have, and their sizes, hang on the robot's numbers: its own come first.
    mine = {name: entry for name, entry in entries.items() if name in robot.parameters}
    robot = _with_effects(document, overridden(robot, mine, path), path, effects)
    if "longest_step" in document:
        step = _number(document["longest_step"], "longest_step", path)
        if step <= 0:
            raise ModelFileError(
                f"{path}: longest_step = {step:g} is no integration step; give seconds above zero, or take it out."
            )
        robot = replace(robot, longest_step=step)
    return overridden(robot, entries, path)


def overridden(robot: Robot, entries: Mapping[str, Any], path: Path) -> Robot:
    """The robot with what the file's `entries` say of its parameters."""
    table = dict(robot.parameters)
    for name, entry in entries.items():
        if name not in table:
            near = did_you_mean(name, table)
            raise ModelFileError(
                f"{path}: parameters.{shown(name)} is no parameter of the robot {robot.name!r}{near}; use {', '.join(table)}."
            )
        table[name] = _override(name, entry, table[name], path)
    changed = robot.with_parameters(ParameterTable(table))
    _check_zeros(changed, robot.parameters, path)
    return changed


def _effect_entry(effect: Effect) -> dict[str, Any]:
    """What a file says of an effect besides its parameters."""
    entry: dict[str, Any] = {"id": effect.id} | ({"law": effect.law} if effect.law else {})
    points = {"between": effect.between, "apart": effect.apart} if isinstance(effect, Curve) else {}
    return entry | {name: value for name, value in points.items() if value}


def model_text(robot: Robot, std_errors: Mapping[str, float] | None = None, method: str = "", remark: str = "") -> str:
    """The robot's parameters as the text of a model file, numbers to the last digit.

    `std_errors` [SI units] by symbol, NaN where there is none, the `method` they came from and a `remark`, such as why they are
    not to be trusted, stand there for whoever reads the file; `read_model` ignores them.
    """
    defaults = robot.defaults()
    parameters: dict[str, Any] = {}
    for name, p in robot.parameters.items():
        entry: dict[str, Any] = {"value": float(p.value), "free": p.free}
        own = defaults[name] if name in defaults else Parameter(0.0)
        for bound in ("lower", "upper"):
            number = float(getattr(p, bound))
            # An absent bound means the robot's own.
            if number != getattr(own, bound) or (p.free and math.isfinite(number)):
                entry[bound] = number
        if p.prior is not None:
            entry["prior"] = [float(value) for value in p.prior]
        if p.unit:
            entry["unit"] = p.unit
        std_error = float((std_errors or {}).get(name, math.nan))
        if math.isfinite(std_error):
            entry["std_error"] = std_error
        if p.meaning:
            entry["meaning"] = p.meaning
        parameters[name] = entry
    document: dict[str, Any] = {"robot": robot.name}
    if method:
        document["method"] = method
    if math.isfinite(robot.longest_step):
        document["longest_step"] = float(robot.longest_step)
    # Constants that were estimated after all say so below, as parameters.
    effects = [effect for effect in robot.effects if not isinstance(effect, TableConstants)]
    if effects:
        document["effects"] = [_effect_entry(effect) for effect in effects]
    comment = "".join(f"# {line}\n" for line in textwrap.wrap(remark, _WIDTH))
    return comment + tomli_w.dumps({**document, "parameters": parameters})


def write_model(
    path: str | Path,
    robot: Robot,
    std_errors: Mapping[str, float] | None = None,
    method: str = "",
    remark: str = "",
) -> None:
    """Write `model_text` to a file, all of it or nothing. Raises `OSError` if the folder cannot be written."""
    write_text(path, model_text(robot, std_errors, method, remark))
