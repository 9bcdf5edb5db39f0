"""How explanations are shown (`explanation.display.show_with`); what draws is imported when something is drawn."""

from pathlib import Path

from ..explanation.explanation import Explanation


class Page:
    """Text on a terminal, a page with pictures in a notebook and in a file."""

    def text(self, found: Explanation) -> str:
        from .explanation_tables import text

        return text(found)

    def body(self, found: Explanation) -> str:
        from .explanation_page import body

        return body(found)

    def save(self, found: Explanation, folder: Path) -> list[Path]:
        from .explanation_page import save

        return save(found, folder)
