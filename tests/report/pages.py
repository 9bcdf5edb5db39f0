"""What a page must be whatever it reports: read with Python's own parser, without a browser."""

import re
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "path", "rect", "use", "line", "circle", "link"}


class Structure(HTMLParser):
    """Open tags, headings, sources and alternative texts of a page; complains about tags that do not close."""

    def __init__(self, page: str):
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.sources: list[str] = []
        self.headings: list[tuple[int, str]] = []
        self.tags: set[str] = set()
        self.images: list[dict[str, str | None]] = []
        self.styles = ""
        self._inside = 0
        self.feed(page)
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        own = dict(attrs)
        self.sources += [value for key, value in attrs if key in ("src", "href", "action", "data") and value]
        if tag == "img" or own.get("role") == "img":
            self.images.append(own)
        if re.fullmatch("h[1-6]", tag):
            self.headings.append((int(tag[1]), ""))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if self.open and re.fullmatch("h[1-6]", self.open[-1]):
            level, text = self.headings[-1]
            self.headings[-1] = level, text + data
        if "style" in self.open:
            self.styles += data

    @property
    def sections(self) -> list[str]:
        """The headings of the first two levels."""
        return [text for level, text in self.headings if level <= 2]


def luminance(colour: str) -> float:
    """Relative luminance of "#rrggbb" (WCAG 2)."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    """Contrast of two colours, 1 to 21 (WCAG 2)."""
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def check(page: str) -> Structure:
    """Assert what every page must be, and return its structure: nothing from elsewhere, alternative texts, headings in order,
    both schemes."""
    read = Structure(page)
    local = [source for source in read.sources if not source.startswith(("#", "data:"))]
    assert not local, local
    assert not re.search(r"""https?://|(?:src|href)\s*=\s*["']//|@import|url\((?!#|["']?data:)""", page)
    assert not read.tags & {"link", "iframe", "object", "embed", "base", "form"}
    for image in read.images:
        said = image.get("alt") or image.get("aria-label") or ""
        assert len(said) > 15 and "nan" not in said.split(), said
    levels = [level for level, _ in read.headings]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(b <= a + 1 for a, b in zip(levels, levels[1:], strict=False)), levels
    assert read.sections[-1] == "What next?"
    assert not re.search(r"(^|\})\s*\*\s*\{", read.styles), "a style for everything on the page"
    assert "prefers-color-scheme: dark" in read.styles and "@media print" in read.styles
    return read
