"""What is said of constants of the table that are wrong, or that would do what a named effect does."""

from collections.abc import Sequence

from ...robots.effect import Effect, in_words
from ...robots.robot import Robot
from .constants_to_first_order import known_constants
from .table_constants import Shares


def by_how_much(name: str, share: float, robot: Robot) -> str:
    """By which share of its value in `robot` a constant is wrong."""
    value = robot.parameters[name].value
    return f"{100 * share:+.2g} %" if value else f"{100 * share:.2g} % of {robot.parts[name]} in place of none"


def _listed(found: Sequence[Shares], robot: Robot) -> str:
    """Sets of constants, each by how much it is wrong; of many that have one in common, that one and what goes with it."""

    def each(own: Shares, names: Sequence[str]) -> list[str]:
        return [f"{name} ({by_how_much(name, own[name], robot)})" for name in names]

    common = [name for name in found[0] if all(name in own for own in found)]
    if len(found) < 3 or len(common) != 1 or any(len(own) != 2 for own in found):
        return " or ".join(" and ".join(each(own, list(own))) for own in found)
    others = [each(own, [name for name in own if name not in common])[0] for own in found]
    return f"{each(found[0], common)[0]} and one of {', '.join(others)}"


def in_a_sentence(identifier: str, found: Sequence[Shares], robot: Robot) -> str:
    """A sentence that names those constants of the robot, and that they may be meant by the effect `identifier`."""
    listed = _listed(found, robot)
    wrong = "a wrong constant" if len(found[0]) == 1 else f"{len(found[0])} wrong constants"
    return (
        f"What is called {in_words(identifier)} here may as well be {wrong} in the table: {listed} would do the same, as far "
        "as these logs tell. Measure that first, or free it in a model file."
    )


def built_in(effects: Sequence[Effect], robot: Robot) -> tuple[str, ...]:
    """Sentences on those of the named `effects`, which no constant of the table does as well, that may be a constant which the
    model holds outside its table; none for a robot of this package, whose tables hold all of them."""
    if known_constants(robot) and not robot.declared:
        return ()
    return tuple(
        f"What is called {in_words(effect.id)} here may as well be {effect.otherwise}: no known constant in the model's table "
        "would do the same. Check those numbers in the model before the sensor is corrected: if one is wrong, so are the "
        "parameters found here."
        for effect in effects
        if effect.otherwise
    )


def found_wrong(wrong: Sequence[Shares], robot: Robot) -> str:
    """A sentence that says which constants of the robot's table the data contradicts, by how much; of several sets that do the
    same the first is in the model."""
    said = "No effect of the catalogue but a wrong table explains this best: these logs contradict the value of"
    first = " and ".join(f"{n} by {by_how_much(n, share, robot)}" for n, share in wrong[0].items())
    if len(wrong) == 1:
        return f"{said} {first}. Measure it, or keep the model as it is now."
    return (
        f"{said} {first}; or else of {_listed(wrong[1:], robot)}, which do the same as far as these logs tell. Measure them; "
        "the model has the first."
    )
