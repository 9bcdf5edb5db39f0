"""How explanations are shown to people: by the package `report`, which is imported when the first one is shown."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from .explanation import Explanation


@runtime_checkable
class Display(Protocol):
    """How explanations are shown to people."""

    def text(self, found: "Explanation") -> str:
        """For a terminal."""
        ...

    def body(self, found: "Explanation") -> str:
        """HTML for a notebook."""
        ...

    def save(self, found: "Explanation", folder: Path) -> list[Path]:
        """Write the page and its pictures and return their paths."""
        ...


_shown_with: list[Display] = []


def displays() -> list[Display]:
    """How explanations are shown: by the package `report`, found when first needed, or by what `show_with` was given."""
    if not _shown_with:
        import_module("jaxid.report")
    return _shown_with


def show_with(display: Display) -> None:
    """Show explanations with `display`. The package `report` calls this, so that nothing here depends on drawing."""
    _shown_with[:] = [display]
