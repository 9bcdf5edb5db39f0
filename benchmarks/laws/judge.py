"""What counts as right: mechanisms, and the sets of names that stand for one and the same."""

from typing import Any

from reference.law_table import LAWS

Entry = dict[str, Any]

SAME = {
    "asymmetric_friction/with_viscous": {"asymmetric_viscous_friction"},  # both are hidden
    "sublinear_viscous_friction/cubic": {"quadratic_drag"},  # faster than linear: laws.md has both in one row
    "quadratic_drag/cubic": {"sublinear_viscous_friction"},
    "motor_lag/drawn": {"input_delay"},  # a step response without a formula
    "sensor_lag/moving_average": {"sensor_delay"},
    "sensor_lag/drawn": {"sensor_delay"},
    "freewheeling_driver/below": {"actuator_dead_zone"},  # the command map near zero
}
"""Names beside the mechanism's own that are right for a law."""
ROWS = (
    {"asymmetric_friction", "asymmetric_viscous_friction"},
    {"sublinear_viscous_friction", "quadratic_drag"},
    {"actuator_dead_zone", "voltage_saturation", "freewheeling_driver"},
    {"motor_lag", "input_delay", "sensor_lag", "sensor_delay"},
    {"ground_slope", "surface_change"},
    {"sensor_bias", "sensor_scale", "sensor_cross_talk"},
    {"stribeck_friction", "load_dependent_friction"},
)
"""Neighbours: names that lead to the right place of the robot, if not to the right part."""
WORDS = {
    "root": ("root", "exponential"),
    "one_wheel": ("wheel", "axis"),
    "one_motor": ("motor",),
    "drawn": ("shape",),
    "by_current": ("current",),
}
"""Words in the name of a law that tell it, where it is not the law's own."""


def accepted(law: str) -> set[str]:
    """Names that are right for a hidden law."""
    return {law.split("/")[0]} | SAME.get(law, set())


def answers(entry: Entry) -> list[set[str]]:
    """For every named effect the set of ids it was declared as."""
    return [{name, *entry["equivalent"].get(name, [])} for name in entry["named"]]


def names_right(entry: Entry) -> bool:
    """Every hidden law has a name, and every name a hidden law."""
    found = answers(entry)
    wanted = [accepted(law) for law in entry["hidden"]]
    return (
        bool(found)
        and all(any(ids & right for ids in found) for right in wanted)
        and all(any(ids & right for right in wanted) for ids in found)
    )


def right(entry: Entry) -> bool:
    """The names are right and believed; nothing hidden: adequate."""
    if not entry["hidden"]:
        return entry["verdict"] == "adequate"
    return entry["verdict"] in ("named", "ambiguous") and names_right(entry)


def wrong_as_fact(entry: Entry) -> bool:
    """A believed name that is no hidden mechanism's."""
    everything = set().union(*(accepted(law) for law in entry["hidden"]), set())
    return entry["verdict"] in ("named", "ambiguous") and not all(ids & everything for ids in answers(entry))


def near(entry: Entry) -> bool:
    """A believed wrong name that is a neighbour of a hidden mechanism."""
    rows = [row for law in entry["hidden"] for row in ROWS if law.split("/")[0] in row]
    everything = set().union(*(accepted(law) for law in entry["hidden"]), *rows, set())
    return wrong_as_fact(entry) and all(ids & everything for ids in answers(entry))


def visible(entry: Entry) -> bool:
    """Whether what is hidden shows on the held-out logs."""
    return entry["before"] > 1.1


def closed(entry: Entry) -> float:
    """Share of the gap between baseline and noise that the answer closed."""
    return (entry["before"] - entry["after"]) / (entry["before"] - 1.0)


def law_right(entry: Entry) -> bool | None:
    """Whether the law told is the hidden one; None where no law is told or the mechanism is wrong."""
    told = [law for law in entry["laws"].values() if law]
    if not told or not names_right(entry) or len(entry["hidden"]) != 1:
        return None
    word = next(iter(entry["hidden"])).split("/")[1]
    return any(each in law.replace(" ", "_").lower() for law in told for each in WORDS.get(word, (word,)))


def outcome(entry: Entry) -> str:
    """A case in a word."""
    if "error" in entry or "unseen" in entry:
        return "error" if "error" in entry else "does not show"
    if right(entry):
        return "right"
    if wrong_as_fact(entry):
        return "neighbour named" if near(entry) else "wrong name"
    if entry["hidden"] and names_right(entry):
        return "right, not believed"
    if entry["hidden"] and any(ids & accepted(law) for ids in answers(entry) for law in entry["hidden"]):
        return "right among others"
    return entry["verdict"]


assert set(SAME) <= set(LAWS)
