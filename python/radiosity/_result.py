"""The base class of results, with their warnings and files."""

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
    """A result of a call, with its warnings, which can be saved."""

    def __init__(self, core: C) -> None:
        self._core = core

    @property
    def warnings(self) -> list[str]:
        """The warnings of the call that made it."""
        return self._core.warnings

    def save(self, path: Union[str, os.PathLike[str]]) -> None:
        """Writes the result in the format of the ending of `path`; the class lists the formats.

        Parameters
        ----------
        path : path
            The file, which is replaced atomically.

        Raises
        ------
        ArgumentError, FileError, RenderError
            If the ending names no format, or the file cannot be written.
        """
        self._core.save(path_of("path", path))
