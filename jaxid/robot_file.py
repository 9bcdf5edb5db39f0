"""A robot on wheels as a file: where its wheels stand, how they roll, and what is known of it.

    name = "kiwi"

    [parameters]                   # what stands here is known; mass, inertia and friction that do not are estimated
    M = 5.2
    r = 0.05
    K = 0.025                      # the motors' constants: commands are volts (without them torques)
    Ra = 0.6
    gear = 12.0
    supply = 12.0

    [wheels]
    front = { at = [0.20, 0.0], rolls = 90, kind = "omni" }
    left = { at = [-0.10, 0.173], rolls = 210, kind = "omni" }
    right = { at = [-0.10, -0.173], rolls = 330, kind = "omni" }

`docs/files.md` describes each key, `jaxid.Wheeled` what is made of it.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

from ._toml import read_toml, shown
from .logs.log import did_you_mean
from .model_file import ModelFileError, overridden
from .robots.wheeled import Wheeled
from .robots.wheels import KINDS, LayoutError, Wheel

_TOP = ("name", "parameters", "wheels")
_OF_WHEEL = ("at", "rolls", "kind", "rollers", "command")
_OF_MOTORS = ("K", "Ra", "gear", "supply")
_LARGEST_RADIUS, _FARTHEST = 3.0, 30.0
"""Metres beyond which no robot's wheel is that large, or stands so far from its origin: then they are no metres."""


class RobotFileError(ValueError):
    """A robot's file that cannot be used. The message is one sentence with file, key and remedy."""


def read_robot(path: str | Path) -> Wheeled:
    """The robot on wheels that a file describes.

    Parameters that stand in the file are known, as plain numbers or with `free = true` start values; of the others mass,
    inertia and friction are estimated.

    Raises `RobotFileError`, one sentence with file, key and remedy: a file that cannot be opened or is not TOML, unknown keys
    and parameters, wheels that cannot move the robot, a wheel radius or constants of motors that are missing.

    >>> import jaxid, pathlib, tempfile
    >>> cart = 'name = "cart"\\n[parameters]\\nr = 0.05\\n[wheels]\\nright = { at = [0, -0.2] }\\nleft = { at = [0, 0.2] }'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "cart.toml"
    ...     _ = path.write_text(cart)
    ...     jaxid.read_robot(path).velocities
    ('v', 'w')
    """
    path = Path(path)
    document = _read(path)
    name, entries = document.get("name", path.stem), _table(document, "parameters", path)
    if not isinstance(name, str) or not name.strip():
        raise RobotFileError(f"{path}: name = {shown(name)} is no name; give the robot one in quotes.")
    wheels = _table(document, "wheels", path)
    if not wheels:
        raise RobotFileError(
            f"{path}: there are no wheels; write [wheels] and a line for each, such as left = {{ at = [0.0, 0.2] }}."
        )
    motors = any(key in entries for key in _OF_MOTORS)
    for key in ("r", *(_OF_MOTORS if motors else ())):
        if key not in entries:
            whose = (
                "the wheels' radius in m" if key == "r" else "with K, Ra, gear and supply commands are volts of motors"
            )
            raise RobotFileError(f"{path}: parameters.{key} is missing ({whose}); put it under [parameters].")
    try:
        placed = tuple(_wheel(called, entry, path) for called, entry in wheels.items())
        robot = Wheeled(wheels=placed, title=name, motors=motors)
    except LayoutError as error:
        raise RobotFileError(f"{path}: {error}.") from None
    known = {
        key: entry if isinstance(entry, Mapping) else {"value": entry, "free": False} for key, entry in entries.items()
    }
    for key in ("r", *(_OF_MOTORS if motors else ())):
        value = known[key].get("value")
        if _is_number(value) and not value > 0:
            raise RobotFileError(f"{path}: parameters.{key} = {shown(value)}; give it a value above zero.")
    _in_metres(known["r"].get("value"), placed, path)
    try:
        return robot.with_parameters(overridden(robot, known, path).parameters)
    except ModelFileError as error:
        raise RobotFileError(str(error)) from None


def _in_metres(radius: Any, wheels: tuple[Wheel, ...], path: Path) -> None:
    """Raise `RobotFileError` for lengths that are no robot's in metres."""
    if _is_number(radius) and radius > _LARGEST_RADIUS:
        raise RobotFileError(
            f"{path}: parameters.r = {shown(radius)} is no wheel's radius in metres; millimetres are 0.001 of them."
        )
    for wheel in wheels:
        if max(map(abs, wheel.at)) > _FARTHEST:
            raise RobotFileError(
                f"{path}: wheels.{wheel.name}.at = {shown(list(wheel.at))} is too far from the origin for metres; millimetres "
                "are 0.001 of them."
            )


def _read(path: Path) -> dict[str, Any]:
    try:
        document = read_toml(path)
    except OSError as error:
        raise RobotFileError(f"The robot {path} cannot be opened ({error.strerror}); check the path.") from None
    except ValueError as error:
        raise RobotFileError(f'The robot {path} is not TOML ({error}); write lines like name = "kiwi".') from None
    for key in document:
        if key not in _TOP:
            near = did_you_mean(key, _TOP)
            raise RobotFileError(
                f"{path}: there is no key {shown(key)} in a robot's file{near}; use {', '.join(_TOP)}, and put numbers under "
                "[parameters]."
            )
    return document


def _table(document: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    found = document.get(key, {})
    if not isinstance(found, Mapping):
        raise RobotFileError(f"{path}: {key} = {shown(found)} is no table; write [{key}] and lines below it.")
    return found


def _wheel(name: str, entry: Any, path: Path) -> Wheel:
    """A wheel as the file has it. Raises `RobotFileError` and `LayoutError`."""
    if not isinstance(entry, Mapping):
        raise RobotFileError(f"{path}: wheels.{name} = {shown(entry)} is no wheel; write {{ at = [x, y] }}.")
    for key in entry:
        if key not in _OF_WHEEL:
            near = did_you_mean(key, _OF_WHEEL)
            raise RobotFileError(
                f"{path}: wheels.{name} has an unknown key {shown(key)}{near}; use {', '.join(_OF_WHEEL)}."
            )
    at = entry.get("at")
    if not isinstance(at, list) or len(at) != 2 or not all(_is_number(number) for number in at):
        raise RobotFileError(
            f"{path}: wheels.{name}.at = {shown(at)} is no place; give [x ahead, y to the left] in metres from the origin."
        )
    for key in ("rolls", "rollers"):
        if key in entry and not _is_number(entry[key]):
            raise RobotFileError(
                f"{path}: wheels.{name}.{key} = {shown(entry[key])} is no angle; give degrees to the left from ahead."
            )
    for key in ("kind", "command"):
        if not isinstance(entry.get(key, ""), str):
            raise RobotFileError(f"{path}: wheels.{name}.{key} = {shown(entry[key])} is no word; put it in quotes.")
    kind = entry.get("kind", "standard")
    if kind not in KINDS:
        raise RobotFileError(
            f"{path}: wheels.{name}.kind = {shown(kind)}{did_you_mean(kind, KINDS)}; use one of {', '.join(KINDS)}."
        )
    rollers = entry.get("rollers")
    return Wheel(
        name,
        (float(at[0]), float(at[1])),
        float(entry.get("rolls", 0.0)),
        kind,
        None if rollers is None else float(rollers),
        entry.get("command", ""),
    )


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6
