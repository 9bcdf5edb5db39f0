"""What the numbers of a model stand for: a parameter by what its table says, an effect's by the law it stands in."""

from .effect import in_words
from .robot import Robot


def meanings_of(robot: Robot) -> dict[str, str]:
    """Every parameter that has a meaning, by name; of an effect's the effect and its formula."""
    laws = {effect.key(""): f"{in_words(effect.id)}: {effect.formula}" for effect in robot.effects if effect.formula}
    found = {}
    for name, parameter in robot.parameters.items():
        law = next((said for start, said in laws.items() if name.startswith(start)), "")
        if parameter.meaning or law:
            found[name] = parameter.meaning or law
    return found
