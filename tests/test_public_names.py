"""Every public name says what it is, and every array in its signature and fields which shape it has."""

import ast
import inspect
import re
import typing
from pathlib import Path

import pytest

import jaxid

NAMES = [name for name in jaxid.__all__ if callable(getattr(jaxid, name))]
SHAPED = re.compile(r"\w+\[(Array|np\.ndarray|NDArray), ['\"][^'\"]*['\"]\]")


def bare(said: str) -> bool:
    """Whether an annotation has an array without a shape: one outside `Float[Array, "T ny"]` and its like."""
    return bool(re.search(r"\b(Array|ndarray|NDArray)\b", SHAPED.sub("", said)))


def annotations(thing) -> dict[str, str]:
    """Annotations of a function, or of a class's fields and public methods, as they are written."""
    found = {}
    functions = [thing] if inspect.isfunction(thing) else []
    if inspect.isclass(thing):
        source = re.sub(r'"""(.|\n)*?"""', "", inspect.getsource(thing))
        found |= dict(re.findall(r"^    ([a-z]\w*): (.+?)(?: = .*)?$", source, flags=re.M))
        members = [getattr(member, "__func__", member) for name, member in vars(thing).items() if name[0] != "_"]
        members = [member.fget if isinstance(member, property) else member for member in members]
        functions = [inspect.unwrap(member) for member in members if inspect.isfunction(inspect.unwrap(member))]
    for function in functions:
        source = inspect.getsource(inspect.unwrap(function))
        stated = re.search(r"def (.|\n)*?\)( -> [^:]+)?:", source)
        assert stated, function.__name__
        found[function.__name__] = stated.group()
    return found


@pytest.mark.parametrize("name", NAMES)
def test_public_names_have_docstrings(name):
    thing = getattr(jaxid, name)
    said = thing.__doc__ or ""
    assert len(said) >= 20 and not said.startswith(f"{name}("), "a docstring of its own"  # a dataclass makes one up
    if inspect.isclass(thing):
        for own, member in vars(thing).items():
            if own[0] != "_" and isinstance(member, property) or inspect.isfunction(member) and own[0] != "_":
                inherited = [vars(base)[own] for base in thing.__mro__ if own in vars(base)]
                assert any(one.__doc__ for one in inherited), own


@pytest.mark.parametrize("name", NAMES)
def test_public_arrays_have_shapes(name):
    assert not {own: said for own, said in annotations(getattr(jaxid, name)).items() if bare(said)}


def test_an_array_without_a_shape_would_be_seen():
    for said in ("time: Array", "list[NDArray[np.float64]]", "Callable[[Array], None]", "x: np.ndarray"):
        assert bare(said), said
    for said in ('Float[Array, "T ny"]', 'list[Float[np.ndarray, "_T ny"]]', "ArrayLike", "Int[Array, ''] | int"):
        assert not bare(said), said
    assert "time" in annotations(jaxid.Log) and "-> LogSet" in str(annotations(jaxid.read_logs))
    assert typing.get_type_hints(jaxid.Log)["time"].dims[0].name == "T"


def test_the_stub_that_type_checkers_read_has_the_same_names():
    tree = ast.parse((Path(jaxid.__file__).parent / "__init__.pyi").read_text())
    (listed,) = (node.value for node in tree.body if isinstance(node, ast.Assign))
    imported = {
        alias.name for node in tree.body if isinstance(node, ast.ImportFrom) if node.module for alias in node.names
    }
    assert sorted(ast.literal_eval(listed)) == sorted(jaxid.__all__) == sorted(imported)
    assert (Path(jaxid.__file__).parent / "py.typed").exists()


def test_names_are_completed_and_what_is_not_there_is_said():
    assert set(jaxid.__all__) | {"checks", "robots", "__version__"} <= set(dir(jaxid))
    assert jaxid.checks.preflight and jaxid.logs.read_logs is jaxid.read_logs
    with pytest.raises(AttributeError, match="'jaxid' has no attribute 'Pionere'"):
        jaxid.Pionere  # noqa: B018
    with pytest.raises(ImportError):
        exec("from jaxid import Pionere")
