"""Progress of long calls: a callback of the user, or a bar in a terminal or notebook."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any, Callable, Optional, Union

#: `True`: a bar; `False`: none; `None`: a bar in a terminal or a notebook; a function: it is called as `f(stage, done, total)`.
Progress = Union[bool, None, Callable[[str, int, int], object]]

#: Calls that take less than this, in s, show no bar.
QUICK = 0.5


def _in_notebook() -> bool:
    try:
        shell = sys.modules["IPython"].get_ipython()
    except (KeyError, AttributeError):
        return False
    return type(shell).__name__ == "ZMQInteractiveShell"


class Bar:
    """A line on standard error, or the bar of tqdm if that is installed; a callback replaces both."""

    def __init__(self, progress: Progress) -> None:
        self._user = progress if callable(progress) else None
        shown = progress is True or (progress is None and (sys.stderr.isatty() or _in_notebook()))
        self._shown = shown and self._user is None
        self._begun = time.monotonic()
        self._bar: Any = None
        self._stage = ""
        self._width = 0

    @property
    def callback(self) -> Optional[Callable[[str, int, int], object]]:
        """The callback for the library."""
        return self._user or (self._tell if self._shown else None)

    def __enter__(self) -> Optional[Callable[[str, int, int], object]]:
        return self.callback

    def __exit__(
        self, kind: Optional[type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]
    ) -> None:
        if self._bar is not None:
            self._bar.close()
        elif self._width:
            print("\r" + " " * self._width + "\r", end="", file=sys.stderr, flush=True)

    def _tell(self, stage: str, done: int, total: int) -> None:
        if time.monotonic() - self._begun < QUICK:
            return
        try:
            from tqdm.auto import tqdm
        except ImportError:
            self._print(stage, done, total)
            return
        if self._bar is None:
            self._bar = tqdm(total=total or None, desc=stage, leave=False)
        if stage != self._stage or self._bar.total != (total or None):
            self._bar.reset(total=total or None)
            self._bar.set_description(stage)
            self._stage = stage
        self._bar.n = done
        self._bar.refresh()

    def _print(self, stage: str, done: int, total: int) -> None:
        share = f" {100 * done // total:3d} %" if total else ""
        line = f"{stage}{share}"
        print("\r" + line.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = max(self._width, len(line))
