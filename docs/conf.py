"""The documentation site: `sphinx-build -W --keep-going -c docs . build/site`, in an environment with the extra `docs`.

The source is the repository itself, so that links between pages, notebooks and files are the same on a code host and here.
"""

import re

project = "jaxid"
copyright = "the authors of jaxid"
root_doc = "docs/index"
extensions = ["myst_nb", "sphinx.ext.autodoc"]
include_patterns = [
    "docs/**",
    "notebooks/*.ipynb",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "benchmarks/README.md",
]
exclude_patterns = ["**/.ipynb_checkpoints"]

html_theme = "furo"
html_title = "jaxid"
html_additional_pages = {"index": "to_the_first_page.html"}  # the site's root, which is above docs/
templates_path = ["templates"]
html_static_path = ["static"]
html_css_files = ["site.css"]

nb_execution_mode = "off"  # notebooks are shown as they were committed
nb_merge_streams = True
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
maximum_signature_line_length = 88


_ARRAY_LIKE = re.compile(r"(?:~?[\w.]+\.)?_Buffer \| .*?complex \| bytes \| str \| .*?complex \| bytes \| str\]")


def _in_rest(text: str) -> str:
    """One docstring's line, written in Markdown, as reStructuredText."""
    parts = re.split(r"(`[^`]+`)", text)
    for k, part in enumerate(parts):
        if k % 2:
            parts[k] = f"``{part.strip('`')}``"
        else:
            parts[k] = re.sub(r"([|\\])|(?<!\*)\*(?!\*)|(?<=\w)_(?!\w)", lambda hit: "\\" + hit[0], part)
    return "".join(parts)


def _docstring(app, what, name, obj, options, lines: list[str]) -> None:
    """Docstrings are Markdown with a few bullets; a code block that is indented stays as it is."""
    written, before, example = [], "", False
    for line in lines:
        example = line.lstrip().startswith(">>>") or (example and line.strip() != "")
        if example:  # a doctest, up to the next blank line, is code
            written.append(line)
            before = line
            continue
        bullet = line.lstrip().startswith("- ")
        if bullet and before.strip() and not before.lstrip().startswith("- ") and before[:1] != " ":
            written.append("")
        elif before[:1] == " " and line[:1] not in (" ", "", "-"):
            written.append("")
        written.append(_in_rest(line))
        before = line
    lines[:] = written


def _signature(app, what, name, obj, options, signature, returns):
    """NumPy's ArrayLike by its name, and defaults that are made anew as `...`, so that Sphinx lays the rest out."""
    short = [text and _ARRAY_LIKE.sub("ArrayLike", text).replace("<factory>", "...") for text in (signature, returns)]
    return short[0], short[1]


def setup(app) -> None:
    app.connect("autodoc-process-docstring", _docstring)
    app.connect("autodoc-process-signature", _signature)
