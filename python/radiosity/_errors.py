"""The exceptions and the warning of the package."""

from __future__ import annotations


class RadiosityError(Exception):
    """Base of all exceptions of this package."""


class ArgumentError(RadiosityError, ValueError):
    """An argument has a wrong shape or value, or does not fit another one; the message names it."""


class SceneError(RadiosityError):
    """A scene cannot be read or used; the message names the file with its line, or the face."""


class FormFactorError(RadiosityError):
    """A form-factor method refused its settings or its input."""


class SolverError(RadiosityError):
    """A solver refused its settings, or the system has no finite solution."""


class HeatError(RadiosityError):
    """Boundary conditions do not fit the scene, or determine no temperature."""


class RenderError(RadiosityError):
    """An image cannot be made or written."""


class FileError(RadiosityError):
    """A file of results cannot be read or written, or belongs to another geometry."""


class MemoryLimitError(RadiosityError, MemoryError):
    """The work exceeds the memory limit."""


class RadiosityWarning(UserWarning):
    """A warning about a result: it is valid, but perhaps not as intended, or less accurate than requested."""
