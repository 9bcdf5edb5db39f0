"""`docs/foreign.md` from the stored results."""

import textwrap
from collections import Counter
from typing import Any

HEAD = """# Logs that another physics engine made

Written by `python -m benchmarks.foreign` (MuJoCo {mujoco}, JAX {jax}); all numbers are in `benchmarks/results/foreign.json`.

MuJoCo drives a Pioneer of rigid bodies in three dimensions: a body on a free joint, two driven wheels, a caster's fork and
wheel, held up and moved by contacts with the floor. Nothing rolls by constraint: the wheels roll because friction holds
them. Every case draws its constants anew (15 %), drives six logs to fit and three held out (25 s at 50 Hz, about
{level:g} V, noise 0.01 m/s and 0.02 rad/s), and gives `jaxid.explain` the CSV files and the nominal model.
"""

AGREE = """## Nothing hidden: the two agree

On a floor with much grip (contact friction {grip:g}) and with a low body, the steady motion under constant voltage is
jaxid's to {steady:.2f} % (forward speed and yaw rate), and whole experiments without noise differ by {least:.3f} to
{most:.3f} standard deviations of the noise. Part of what remains is the contacts' softness: a reversing experiment differs by
{base}, with half the engine's step by {half}, with half the contacts' time constant as well by
{firmer} (forward speed, yaw rate). At 8 V in place of {level:g} V it differs by {high}: the wheels slip at
reversals. With contact friction 10 they hold at 8 V too, and it differs by {held}.
"""

HEADER = """| hidden | name | verdict | named | held-out error | a wheel slips (share of time; most) | seconds | judged |
| --- | --- | --- | --- | --- | --- | --- | --- |"""

WHY = """## What to make of it

Slip counts from 0.01 m/s at either driving wheel. Sizes are given with one standard error. One case of each kind was run
({nothing} with nothing hidden), so these are examples, not rates. Judged: {judged}.

- **Nothing hidden.** The residuals are white with p = {white}; an alarm is raised below 0.005.
- **Sizes.** Of {sizes} hidden sizes that were named as the first of their set, {near} are within two standard errors.
- **What the engine has and the catalogue lacks**: a friction in which the two wheels differ (a user's own effect for it is
  `benchmarks/foreign/uneven_friction.py`), a limit of the drive force that depends on each wheel's load and sideways force,
  with a speed of its own for a wheel that slips (`traction_limit` is a constant cut-off), a resistance to turning as such, and
  contacts that give way.
"""


def judged(entry: dict[str, Any]) -> str:
    """Whether the verdict is right: `right`, `unexplained`, `missed` or `wrong name`."""
    sets = [{name, *entry["equivalent"][name]} for name in entry["named"]]
    if entry["told"].startswith("nothing"):
        return "right" if entry["verdict"] == "adequate" else "false alarm"
    if entry["verdict"] == "adequate":
        return "missed"
    if entry["verdict"] == "unexplained":
        return "honestly unexplained" if entry["answer"] is None else "unexplained, though it has a name"
    known = [entry["answer"] in ids for ids in sets]
    if all(known):
        return "right" if entry["verdict"] == "named" else "right, in a set"
    return "right, and one too many" if any(known) else "wrong names"


def _names(entry: dict[str, Any]) -> str:
    told = []
    for name in entry["named"]:
        others = entry["equivalent"][name]
        told.append(name + (f" (or {', '.join(others)})" if others else ""))
    return "; ".join(told) or "-"


def _row(entry: dict[str, Any]) -> str:
    error = f"{entry['before']:.2f} → {entry['after']:.3f}"
    return (
        f"| {entry['told']} | {entry['answer'] or '-'} | {entry['verdict']} | {_names(entry)} | {error} "
        f"| {100 * entry['slipping']:.2f} %; {entry['largest_slip']:.2g} m/s | {entry['seconds']:.0f} | {judged(entry)} |"
    )


def _sizes(entry: dict[str, Any]) -> str:
    """Named parameters beside the hidden ones."""
    parts = []
    for key, (value, error) in entry["parameters"].items():
        true = entry["true"].get(key.split(".")[1]) if key.split(".")[0] == entry["answer"] else None
        told = f" (hidden: {true:g})" if true is not None else ""
        parts.append(f"{key} {value:.4g} ± {error:.1g}{told}")
    return "; ".join(parts)


def _near(entry: dict[str, Any]) -> list[bool]:
    """Of every hidden size that was named: whether it is within two standard errors."""
    found = []
    for key, (value, error) in entry["parameters"].items():
        effect, name = key.split(".")[:2]
        if effect == entry["answer"] and name in entry["true"]:
            found.append(abs(value - entry["true"][name]) <= 2 * error)
    return found


def _paragraph(entry: dict[str, Any]) -> str:
    sizes = _sizes(entry)
    text = f"- **{entry['told']}.** {entry['sentence']} {entry['where']} {sizes + '.' if sizes else ''}"
    return textwrap.fill(" ".join(text.split()), 120, subsequent_indent="  ")


def _pair(values: list[float]) -> str:
    return f"{values[0]:.3f} and {values[1]:.3f}"


def page(stored: dict[str, Any]) -> str:
    """The page's Markdown."""
    from .cases import FIRM, LEVEL

    agreement, cases = stored["agreement"], stored["cases"]
    off = [
        abs(m / j - 1)
        for row in agreement["steady"]
        for m, j in zip(row["mujoco"], row["jaxid"], strict=True)
        if abs(j) > 1e-9
    ]
    near = [each for entry in cases.values() for each in _near(entry)]
    rms = [value for both in agreement["rms_in_noise"].values() for value in both]
    parts = [
        HEAD.format(**stored["versions"], level=LEVEL),
        AGREE.format(
            steady=100 * max(off),
            least=min(rms),
            most=max(rms),
            grip=FIRM["grip"],
            level=LEVEL,
            base=_pair(agreement["rms_in_noise"]["prbs_reversing"]),
            half=_pair(agreement["half_step"]),
            firmer=_pair(agreement["half_step_and_contact_time"]),
            high=_pair(agreement["at_8_V"]),
            held=_pair(agreement["at_8_V_grip_10"]),
        ),
        "## What was said\n\n" + HEADER + "\n" + "\n".join(map(_row, cases.values())) + "\n",
        "\n".join(_paragraph(entry) for entry in cases.values() if not entry["told"].startswith("nothing")) + "\n",
        WHY.format(
            judged="; ".join(f"{count} {what}" for what, count in Counter(map(judged, cases.values())).items()),
            nothing=sum(entry["told"].startswith("nothing") for entry in cases.values()),
            sizes=len(near),
            near=sum(near),
            white=", ".join(f"{e['p_white_after']:.2g}" for e in cases.values() if e["told"].startswith("nothing")),
        ),
    ]
    return "\n".join(parts)
