"""The examples in the docstrings of public names print what they say."""

import doctest
import sys

import pytest

import jaxid


def examples():
    """Docstrings with examples by name: of public names, their methods and properties."""
    found = []
    for name in jaxid.__all__:
        thing = getattr(jaxid, name)
        module = sys.modules.get(getattr(thing, "__module__", ""))
        found += doctest.DocTestFinder().find(thing, name, module=module, globs={}) if module else []
    return {test.name: test for test in found if test.examples}


EXAMPLES = examples()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_print_what_they_say(name):
    said = []
    result = doctest.DocTestRunner(verbose=False).run(EXAMPLES[name], out=said.append)
    assert result.attempted and not result.failed, "".join(said)


def test_there_are_examples():
    assert {"Log.from_arrays", "LogSet.split", "ParameterTable", "Channels", "catalogue", "simulate", "save"} <= {
        *EXAMPLES
    }
