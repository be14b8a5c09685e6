"""Several tracings at once: what they ask of the rays is asked together, so that every call of the engine has many.

A tracing is a generator that yields what it finds, and questions, whose answers are sent back into it. Bodies that are
seen over several mirrors, straight, there and back, are as many tracings of a few thousand tubes each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Hashable, Iterator, Sequence
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


Tracing = Generator[Question | FoundT, Any, None]


class _Run(Generic[FoundT]):
    """One tracing, and what it waits for."""

    def __init__(self, tracing: Tracing[FoundT]) -> None:
        self.tracing = tracing
        self.waits: Question | None = None

    def go_on(self, answer: object) -> Iterator[FoundT]:
        """Yield what is found until there is a question, or the end."""
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
    runs: dict[int, _Run[FoundT]] = {}

    def on(number: int, answer: object) -> Iterator[tuple[int, FoundT | None]]:
        for found in runs[number].go_on(answer):
            yield number, found
        if runs[number].waits is None:
            del runs[number]
            yield number, None

    while True:
        while sum(len(run.waits) for run in runs.values() if run.waits is not None) < most:
            following = next(rest, None)
            if following is None:
                break
            number, tracing = following
            runs[number] = _Run(tracing)
            yield from on(number, None)
        asked = {number: run.waits for number, run in runs.items() if run.waits is not None}
        if not asked:
            return
        first = min(asked.values(), key=lambda question: question.place)
        group = {number: question for number, question in asked.items() if question.key == first.key}
        for number, answer in zip(group, type(first).answered(list(group.values())), strict=True):
            yield from on(number, answer)
