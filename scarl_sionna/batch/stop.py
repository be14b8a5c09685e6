"""Ctrl-C and SIGTERM stop an export as a whole: they are never taken for a frame that failed."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class ExportStopped(KeyboardInterrupt):
    """A signal stopped the export; finished frames are kept.

    Attributes
    ----------
    signal_number : int
        A command ends with exit code 128 + this: 130 for Ctrl-C (SIGINT), 143 for SIGTERM.
    """

    def __init__(self, signal_number: int) -> None:
        self.signal_number = int(signal_number)
        super().__init__(f"by {signal.Signals(signal_number).name}; finished frames are kept, the same command goes on")


class _Asked:
    """The signal that came, if one did."""

    number: int | None = None


_asked = _Asked()


@contextmanager
def stoppable() -> Iterator[None]:
    """Turn SIGINT and SIGTERM into :class:`ExportStopped`, raised at once in the main thread.

    In the middle of a render the exception may come out of the engine as another one, or be swallowed by it: so the
    signal is kept, `check` tells of it, and whatever leaves the block after it leaves as `ExportStopped`. Handlers of a
    signal that is ignored stay; outside of the main thread, where Python delivers no signals, nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before: dict[int, Any] = {}

    def stop(number: int, frame: FrameType | None) -> None:
        _asked.number = number
        previous = before[number]
        if callable(previous) and previous is not signal.default_int_handler:
            previous(number, frame)
        raise ExportStopped(number)

    try:
        for number in _SIGNALS:
            if signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.getsignal(number)
                signal.signal(number, stop)
        yield
    except ExportStopped:
        raise
    except BaseException as error:
        check(error)
        raise
    finally:
        for item, handler in before.items():
            signal.signal(item, handler)
        _asked.number = None


def check(error: BaseException | None = None) -> None:
    """Raise if a signal has come, or if an error is what became of Ctrl-C on its way through other code.

    Raises
    ------
    ExportStopped
    """
    if _asked.number is not None:
        raise ExportStopped(_asked.number) from error
    seen: set[int] = set()
    cause = error
    while cause is not None and id(cause) not in seen:
        if isinstance(cause, KeyboardInterrupt):
            raise ExportStopped(signal.SIGINT) from error
        seen.add(id(cause))
        cause = cause.__cause__ or cause.__context__
