"""The warnings and the file that every result has."""

from __future__ import annotations

import os
from typing import Generic, Protocol, TypeVar, Union

from ._arguments import path as path_of


class Core(Protocol):
    """A result of the compiled part."""

    @property
    def warnings(self) -> list[str]: ...

    def save(self, path: str) -> None: ...


C = TypeVar("C", bound=Core)


class Result(Generic[C]):
    """A result of a call: its warnings, and a way into a file."""

    def __init__(self, core: C) -> None:
        self._core = core

    @property
    def warnings(self) -> list[str]:
        """The warnings of the call that made it."""
        return self._core.warnings

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the result in the format that the ending of `path` names; the class lists the formats.

        Parameters
        ----------
        path : path
            The file. It is written whole or not at all.

        Raises
        ------
        ArgumentError, FileError, RenderError
            If the ending names no format, or the file cannot be written.
        """
        self._core.save(path_of("path", path))
