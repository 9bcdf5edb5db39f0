"""Pictures of pages are laid out as ever, and drawn coarsely: what these tests look at are words, tables and files."""

import pytest

from jaxid.report import comparison, explanation_page


@pytest.fixture(autouse=True)
def coarse_pictures(monkeypatch):
    """Fewer dots an inch."""
    for module in (comparison, explanation_page):
        monkeypatch.setattr(module, "_DPI", 20)
