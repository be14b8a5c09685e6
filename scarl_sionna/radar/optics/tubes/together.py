"""Several tracings at once: what they ask of the rays is asked together, so that every call of the engine has many.

A tracing is a generator that yields what it finds, and questions, whose answers are sent back into it, and branches,
which go on beside it. Bodies that are seen over several mirrors are as many tracings of a few thousand tubes each, with
a branch for each receiver at each bounce.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Generator, Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

FoundT = TypeVar("FoundT")


class Question(ABC):
    """What a tracing asks of the rays; those with equal keys are asked together.

    Attributes
    ----------
    place : tuple of int
        How far the tracing has come: those behind are asked first.
    """

    place: tuple[int, ...]

    @property
    @abstractmethod
    def key(self) -> Hashable:
        """What questions have in common that can be asked together."""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of tubes."""

    @classmethod
    @abstractmethod
    def answered(cls, questions: Sequence[Any]) -> list[Any]:
        """Return the answers to questions with the same key."""


@dataclass(frozen=True, eq=False)
class Branch(Generic[FoundT]):
    """A part of a tracing that goes on beside the rest of it: what it finds is found by the whole."""

    tracing: Tracing[FoundT]


Tracing = Generator[Question | Branch[FoundT] | FoundT, Any, None]


class _Run(Generic[FoundT]):
    """One tracing, or a branch of it, and what it waits for."""

    def __init__(self, number: int, tracing: Tracing[FoundT]) -> None:
        self.number, self.tracing = number, tracing
        self.waits: Question | None = None

    def go_on(self, answer: object) -> Iterator[FoundT | Branch[FoundT]]:
        """Yield what is found and branches, until there is a question, or the end."""
        self.waits = None
        while True:
            try:
                step = self.tracing.send(answer)
            except StopIteration:
                return
            answer = None
            if isinstance(step, Question):
                self.waits = step
                return
            yield step


def together(tracings: Sequence[Tracing[FoundT]], most: int) -> Iterator[tuple[int, FoundT | None]]:
    """Yield what tracings find, each with the number of the tracing, and None at the end of each.

    Parameters
    ----------
    tracings : sequence of generators
    most : int
        No further one begins while those that run ask about so many tubes: bounds the memory.
    """
    rest = iter(enumerate(tracings))
    runs: list[_Run[FoundT]] = []
    running: Counter[int] = Counter()

    def on(run: _Run[FoundT], answer: object) -> Iterator[tuple[int, FoundT | None]]:
        for step in run.go_on(answer):
            if isinstance(step, Branch):
                yield from begun(run.number, step.tracing)
            else:
                yield run.number, step
        if run.waits is None:
            runs.remove(run)
            running[run.number] -= 1
            if not running[run.number]:
                yield run.number, None

    def begun(number: int, tracing: Tracing[FoundT]) -> Iterator[tuple[int, FoundT | None]]:
        run = _Run(number, tracing)
        runs.append(run)
        running[number] += 1
        yield from on(run, None)

    while True:
        while sum(len(run.waits) for run in runs if run.waits is not None) < most:
            following = next(rest, None)
            if following is None:
                break
            yield from begun(*following)
        if not runs:
            return
        asked = [(run, run.waits) for run in runs if run.waits is not None]
        first = min((question for _, question in asked), key=lambda question: question.place)
        group = [(run, question) for run, question in asked if question.key == first.key]
        answers = type(first).answered([question for _, question in group])
        for (run, _), answer in zip(group, answers, strict=True):
            yield from on(run, answer)
