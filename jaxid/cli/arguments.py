"""What stands on the command line: values of flags that take many, flags that go together, and the robot."""

import importlib
import re
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from ..robots import Effect, Robot
    from ..robots.closed_loop import Controller, Law


class UnusableInput(ValueError):
    """Input that cannot be used. The message is one sentence that ends with the remedy."""


def repeat_flags(argv: Sequence[str], many: Sequence[str]) -> list[str]:
    """`--fit a b --out c` as `--fit a --fit b --out c` for the flags in `many`.

    Options of the command-line parser take a fixed number of values; people and shells write one flag and then a list.
    The list ends at the next flag or at `--`.
    """
    arguments: list[str] = []
    flag = None
    for position, argument in enumerate(argv):
        if argument == "--":
            return arguments + list(argv[position:])
        if argument.startswith("-"):
            name, equals, _ = argument.partition("=")
            flag = name if name in many else None
            # The flag itself goes before each value; one without any stays, so that the parser can complain.
            if flag is None or equals:
                arguments.append(argument)
            elif position + 1 == len(argv) or argv[position + 1].startswith("-"):
                arguments.append(argument)
        elif flag is not None:
            arguments += [flag, argument]
        else:
            arguments.append(argument)
    return arguments


def window_option(text: str) -> float | str | None:
    """`--windows`: "auto", None for "none", or seconds. Raises `typer.BadParameter` (exit status 2) for anything else."""
    if text in ("auto", "none"):
        return None if text == "none" else text
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds < float("inf"):
        raise typer.BadParameter(f"--windows {text!r} is no length; give seconds, such as 0.5, or auto, or none.")
    return seconds


def _users_place(error: Exception) -> traceback.FrameSummary:
    """Where a user's code failed: the last line of the traceback that is in no installed package, which may have raised the
    error about what it was given."""
    every, own = traceback.extract_tb(error.__traceback__), str(Path(__file__).parents[1])
    theirs = [p for p in every if not p.filename.startswith((own, "<")) and "site-packages" not in p.filename]
    return theirs[-1] if theirs else every[-1]


def _import(module: str, spec: str, what: str) -> object:
    """A user's module; the current directory is searched first."""
    if module.endswith(".py") or "/" in module or "\\" in module:
        name = re.split(r"[/\\]", module)[-1].removesuffix(".py")
        own = f"{name}:{spec.rpartition(':')[2]}"
        raise typer.BadParameter(
            f"{what.capitalize()} {spec!r} names a file; give its module, {own}, and start from the folder of {name}.py."
        )
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not (module == error.name or module.startswith(f"{error.name}.")):
            raise UnusableInput(f"{module} imports {error.name}, which is not installed; install it.") from None
        raise typer.BadParameter(
            f"There is no module {error.name!r} for {what} {spec!r}; check the name, and start from its folder."
        ) from None
    except Exception as error:
        place = _users_place(error)
        line = error.lineno if isinstance(error, SyntaxError) else place.lineno
        file = error.filename if isinstance(error, SyntaxError) else place.filename
        raise UnusableInput(
            f"Importing {module} fails at {file}:{line} ({type(error).__name__}: {error}); correct it there."
        ) from None


def _named(spec: str, what: str, unnamed: str, wanted: str) -> object:
    """What `package.module:attribute` names. Raises `typer.BadParameter` (exit status 2) if that is nothing: `unnamed` where
    `spec` has another form; `what` it should be, and `wanted` is what the remedy asks for."""
    from ..logs.log import did_you_mean

    module, colon, attribute = spec.partition(":")
    if not (colon and module and attribute):
        raise typer.BadParameter(unnamed)
    found = _import(module, spec, what)
    for part in attribute.split("."):
        if not hasattr(found, part):
            raise typer.BadParameter(f"{module} has no {attribute!r}{did_you_mean(part, dir(found))}; name {wanted}.")
        found = getattr(found, part)
    return found


def load_controller(spec: str) -> "Controller | Law":
    """The controller that `--controller module:attribute` names: a `Controller`, or a law.

    Raises `typer.BadParameter` (exit status 2) if it names nothing and `UnusableInput` if that is no controller.
    """
    from ..robots.given import controller_of

    unnamed = f"--controller {spec!r} is no package.module:attribute; name a Controller or a function."
    found = _named(spec, "the controller", unnamed, "a controller")
    try:
        return controller_of(found, spec)
    except TypeError as error:
        raise UnusableInput(str(error)) from None


def load_effects(spec: str | None) -> "tuple[Effect, ...]":
    """The user's own effects that `--effects module:attribute` names; none for None.

    Raises `typer.BadParameter` (exit status 2) if it names nothing and `UnusableInput` for what is no effect.
    """
    if spec is None:
        return ()
    from ..robots.given import effects_of

    unnamed = f"--effects {spec!r} is no package.module:attribute; name an Effect, a list of them, or a function."
    found = _named(spec, "the effects", unnamed, "an Effect or a list of them")
    try:
        return effects_of(found, spec)
    except TypeError as error:
        raise UnusableInput(str(error)) from None


def check_effects(effects: "Sequence[Effect]", robot: "Robot") -> None:
    """Raise `UnusableInput` for effects that the robot cannot have, and for those that the catalogue has."""
    from ..effects.catalogue import ALL
    from ..robots import EffectError

    listed = {effect.id for effect in ALL}
    for effect in effects:
        if effect.id in listed:
            raise UnusableInput(
                f"The effect {effect.id!r} of --effects has the id of one of the catalogue; give it another."
            )
        if effect.id in [own.id for own in robot.effects]:
            continue  # the model has it already, and it is not looked for again
        try:
            _ = robot + effect
        except EffectError as error:
            raise UnusableInput(
                f"The effect {effect.id!r} of --effects does not suit {robot.name!r}: {error}."
            ) from None
        except Exception as error:
            place = _users_place(error)
            raise UnusableInput(
                f"The effect {effect.id!r} of --effects fails at {place.filename}:{place.lineno} ({type(error).__name__}: "
                f"{error}); correct it there."
            ) from None


def load_robot(spec: str) -> "Robot":
    """The robot that ROBOT on the command line names: a built-in one, a robot's file, or a user's `package.module:attribute`.

    The attribute is a `Robot` or something callable without arguments that returns one. Raises `typer.BadParameter`
    (exit status 2) if it names nothing and `UnusableInput` if what it names is no robot.
    """
    from ..logs.log import did_you_mean
    from ..robots import BUILT_IN
    from ..robots.given import robot_of

    if spec in BUILT_IN:
        return BUILT_IN[spec]()
    if spec.endswith(".toml"):
        from ..robot_file import RobotFileError, read_robot

        try:
            return read_robot(spec)
        except RobotFileError as error:
            raise UnusableInput(str(error)) from None
    unnamed = (
        f"There is no robot {spec!r}{did_you_mean(spec, BUILT_IN)}; use {', '.join(BUILT_IN)}, a file such as my_robot.toml, "
        "or package.module:attribute for your own."
    )
    found = _named(spec, "the robot", unnamed, "a Robot or a function that returns one")
    try:
        return robot_of(found, spec)
    except TypeError as error:
        raise UnusableInput(str(error)) from None


def for_logs(robot: "Robot", paths: Sequence[str], mapping: Path | None) -> "Robot":
    """The robot that measures what the mapping names, or else what the first log's columns hold beside that. An unreadable log
    says so later."""
    from .._toml import read_toml
    from ..logs.read import first_columns

    if not paths:
        return robot
    try:
        renamed = tuple(read_toml(mapping)) if mapping is not None else ()
        named = robot.for_columns(renamed)
        return named if named != robot else robot.for_columns((*first_columns(paths), *renamed))
    except (OSError, ValueError):
        return robot


def check_named(own_effects: str | None, model: Path | None) -> None:
    """Raise `typer.BadParameter` (exit status 2) for effects of the user's own and no model that could name them."""
    if own_effects is not None and model is None:
        raise typer.BadParameter(
            "--effects are those that a --model names; give that, or look for them by jaxid explain."
        )


def check_loop(controller: str | None, intersample: str) -> None:
    """Raise `typer.BadParameter` (exit status 2) for a controller and inputs that are not held."""
    if controller is not None and intersample != "hold":
        raise typer.BadParameter("--intersample linear is for measured inputs; a --controller holds its commands.")


def print_version(wanted: bool) -> bool:
    """What `--version` does, before anything else is read."""
    if wanted:
        from .. import __version__

        typer.echo(f"jaxid {__version__}")
        raise typer.Exit
    return wanted
