"""The number of threads."""

from __future__ import annotations

from typing import Optional

from . import _core
from ._arguments import whole


def set_threads(n: Optional[int]) -> None:
    """Sets the number of threads of all later calls; results do not depend on it.

    Parameters
    ----------
    n : int or None
        Threads, 1 or more; None for all cores, as at the start.

    Raises
    ------
    ArgumentError
        If `n` is not above 0, or so many threads cannot be started.
    """
    _core.set_threads(None if n is None else whole("n", n, 1))
