"""Many fits in one batch, each written as if it were alone.

Every fit runs as a coroutine. Where it asks for a linearisation, the costs of steps or, where simulations take XLA, for one
of the operations below, it waits; when all fits wait, what they ask for is computed together, and they go on. So a member of
a fleet takes exactly the decisions that it takes alone (other starts, outliers, logs left out), and the work is done in
batch.

Only one coroutine runs at a time, and so many are begun that another takes the place of each that ends. Members with fewer
or shorter logs are padded with samples that do not count.
"""

import threading
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, NamedTuple

import jax
import numpy as np

from ..._arrays import array
from ..._float64 import float64
from .problem import Problem, Structure, Unknowns

_LANES = 64
"""Fits computed at a time: more would not fit into the processor's cache."""
BY_LOG = ("dt", "inputs", "outputs", "mask", "start", "state_free", "prescribed", "weight")
"""Fields of a problem that have one row for every log; those but the ones of initial states have one for every sample."""
_BY_SAMPLE = ("dt", "inputs", "outputs", "mask", "prescribed", "weight")


class Operation(NamedTuple):
    """Something a fit asks for: `compute(structure, static, problems, unknowns, others)` over a leading axis of lanes, and
    how a lane's result is cut to E logs of T samples."""

    name: str
    compute: Callable[..., Any]
    cut: Callable[[Any, int, int], Any]


class _Question(NamedTuple):
    """To a compiled program."""

    operation: Operation
    structure: Structure
    static: Any
    problem: Problem
    unknowns: Unknowns
    others: Any


class _Request(NamedTuple):
    """To a function that answers all requests of one kind."""

    answered: Callable[[list[Any]], list[Any]]
    kind: Hashable
    value: Any


class _Failed(NamedTuple):
    """In place of an answer: what computing it raised, and where."""

    failure: Exception
    where: Any


@dataclass
class _Member:
    """A fit between two questions."""

    run: Callable[[], Any]
    go: threading.Event = field(default_factory=threading.Event)
    waits: threading.Event = field(default_factory=threading.Event)
    question: _Question | _Request | None = None
    answer: Any = None
    result: Any = None
    failure: BaseException | None = None
    done: bool = False


_here = threading.local()


def in_batch() -> bool:
    """Whether this is one of many fits in a batch."""
    return getattr(_here, "member", None) is not None


def ask(
    operation: Operation, structure: Structure, static: Any, problem: Problem, unknowns: Unknowns, others: Any = ()
):
    """The operation's result for one fit, or None where no batch is being fitted: then compute it yourself."""
    return _waited_for(_Question(operation, structure, static, problem, unknowns, others))


def ask_together(answered: Callable[[list[Any]], list[Any]], kind: Hashable, value: Any) -> Any:
    """This fit's part of `answered(values)`, called once with what all fits ask that ask for the same `kind`; None where no
    batch is being fitted: then compute it yourself."""
    return _waited_for(_Request(answered, kind, value))


def _waited_for(question: _Question | _Request) -> Any:
    member: _Member | None = getattr(_here, "member", None)
    if member is None:
        return None
    member.question = question
    member.go.clear()
    member.waits.set()
    member.go.wait()
    answer, member.answer = member.answer, None
    if isinstance(answer, _Failed):
        # One exception is raised in many fits: the frames of the others are not this one's.
        raise answer.failure.with_traceback(answer.where)
    return answer


def padded(problem: Problem, unknowns: Unknowns, logs: int, samples: int) -> tuple[Problem, Unknowns]:
    """The same problem, as NumPy's arrays, with more logs and samples, none of which counts."""
    E, T = problem.dt.shape

    def grown(path: Any, leaf: Any):
        name, leaf = path[0].name, np.asarray(leaf)
        if name not in BY_LOG:
            return leaf
        quiet = name in ("mask", "state_free", "outputs", "inputs")
        widths = [(0, logs - E), *([(0, samples - T)] if name in _BY_SAMPLE else [])]
        widths += [(0, 0)] * (leaf.ndim - len(widths))
        return np.pad(leaf, widths) if quiet else np.pad(leaf, widths, mode="edge")

    states = np.asarray(unknowns.states)
    padded = jax.tree.map_with_path(grown, problem)
    return padded, unknowns._replace(states=np.pad(states, [(0, logs - E), (0, 0)]))


def _key(question: _Question | _Request) -> Any:
    if isinstance(question, _Request):
        return question.answered, question.kind
    tree = jax.tree.structure((question.problem, question.unknowns, question.others))
    widths = question.problem.inputs.shape[-1], question.problem.outputs.shape[-1]
    E, T = question.problem.dt.shape
    size = int(np.log(E) / np.log(16.0)), int(np.log(T) / np.log(4.0))  # what is alike enough to be padded to one
    return question.operation.name, question.structure, question.static, tree, widths, size


def _answered(questions: list[Any], sizes: dict[Any, tuple[int, int, int]]) -> list[Any]:
    """Answers to questions of one kind."""
    if isinstance(questions[0], _Request):
        return questions[0].answered([question.value for question in questions])
    key, first = _key(questions[0]), questions[0]
    known = sizes.get(key, (0, 0, min(len(questions), _LANES)))
    logs, samples = (max(known[i], *(q.problem.dt.shape[i] for q in questions)) for i in (0, 1))
    lanes = known[2]
    sizes[key] = logs, samples, lanes
    rows = [(*padded(q.problem, q.unknowns, logs, samples), q.others) for q in questions]
    rows = [
        (*row[:2], jax.tree.map(lambda leaf, E=q.problem.dt.shape[0]: _widened(leaf, E, logs), row[2]))
        for row, q in zip(rows, questions, strict=True)
    ]
    answers: list[Any] = []
    for begin in range(0, len(rows), lanes):
        part = rows[begin : begin + lanes]
        part = part + [part[-1]] * (lanes - len(part))
        stacked = jax.tree.map(lambda *leaves: array(np.stack(leaves)), *part)
        found = jax.tree.map(np.asarray, first.operation.compute(first.structure, first.static, *stacked))
        for lane, question in enumerate(questions[begin : begin + lanes]):
            one = jax.tree.map(lambda leaf, lane=lane: leaf[lane], found)
            answers.append(first.operation.cut(one, *question.problem.dt.shape))
    return answers


def _widened(leaf: Any, E: int, logs: int):
    """Another argument, whose last axis is that of the logs where it has two axes."""
    leaf = np.asarray(leaf)
    return np.pad(leaf, [(0, 0), (0, logs - E)], mode="edge") if leaf.ndim == 2 else leaf


def in_lanes(jobs: Mapping[str, Callable[[], Any]]) -> tuple[dict[str, Any], dict[str, Exception]]:
    """Run all jobs; their operations are computed together. Results by name, and what those raised that failed."""
    members = {name: _Member(run) for name, run in jobs.items()}

    def live(member: _Member) -> None:
        member.go.wait()
        _here.member = member
        try:
            with float64():
                member.result = member.run()
        except BaseException as failure:  # handed to whoever waits for it
            member.failure = failure
        member.done = True
        member.waits.set()

    sizes: dict[Any, tuple[int, int, int]] = {}
    waiting: list[_Member] = []
    later = iter(members.values())
    while True:
        ready = list(waiting)
        for member in islice(later, _LANES - len(ready)):
            threading.Thread(target=live, args=(member,), daemon=True).start()
            ready.append(member)
        if not ready:
            break
        for member in ready:
            member.question = None
            member.waits.clear()
            member.go.set()
            member.waits.wait()
        waiting = [member for member in ready if not member.done]
        kinds: dict[Any, list[_Member]] = {}
        for member in waiting:
            assert member.question is not None
            kinds.setdefault(_key(member.question), []).append(member)
        for group in kinds.values():
            try:
                answers = _answered([m.question for m in group], sizes)
            except Exception as failure:  # belongs to those that asked
                answers = [_Failed(failure, failure.__traceback__)] * len(group)
            for member, answer in zip(group, answers, strict=True):
                member.answer = answer
    for member in members.values():
        if member.failure is not None and not isinstance(member.failure, Exception):
            raise member.failure
    found = {name: member.result for name, member in members.items() if member.failure is None}
    failed = {name: member.failure for name, member in members.items() if isinstance(member.failure, Exception)}
    return found, failed


def all_in_lanes(jobs: Mapping[str, Callable[[], Any]]) -> list[Any]:
    """The results of all jobs, run by `in_lanes`, in their order. Raises the first failure."""
    found, failed = in_lanes(jobs)
    for failure in failed.values():
        raise failure
    return list(found.values())
