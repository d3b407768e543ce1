"""Converts arguments to arrays of the shapes that the library requires; messages name the argument."""

from __future__ import annotations

import json
import operator
import os
from collections.abc import Mapping, Sequence
from typing import Any, Optional, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError

Floats = NDArray[np.float64]
T = TypeVar("T")
#: A number, an array over faces or patches, or numbers and triples by the names of surfaces.
Values = Union[ArrayLike, Mapping[str, ArrayLike]]


def floats(name: str, values: ArrayLike) -> Floats:
    """Returns finite numbers."""
    try:
        found = np.asarray(values)
        # NumPy would leave out imaginary parts, and read texts and dates as numbers.
        if found.dtype.kind not in "biufO":
            raise TypeError(f"values of type {found.dtype}")
        array = found.astype(np.float64, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise ArgumentError(f"{name}: no array of numbers ({error})") from None
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        place = ", ".join(str(k) for k in bad[0])
        at = f" at [{place}]" if place else ""
        raise ArgumentError(f"{name}: {array[tuple(bad[0])]}{at} is not finite")
    return array


def points(name: str, values: ArrayLike) -> Floats:
    """Returns rows of three finite numbers."""
    array = floats(name, values)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ArgumentError(f"{name}: shape {array.shape}, expected (n, 3)")
    return np.ascontiguousarray(array)


def faces(values: Any, n_vertices: int) -> tuple[NDArray[np.uint32], NDArray[np.uint64]]:
    """Returns the corners of all faces one after another, and the end of those of each."""
    if isinstance(values, np.ndarray) and values.dtype != object:
        if values.ndim != 2 or values.shape[1] < 3:
            raise ArgumentError(f"faces: shape {values.shape}, expected (m, 3), (m, 4) or a list of lists")
        counts = np.full(len(values), values.shape[1], dtype=np.uint64)
        flat = values.reshape(-1)
    else:
        if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
            raise ArgumentError(f"faces: {type(values).__name__}, expected (m, 3), (m, 4) or a list of lists")
        rows = [np.asarray(row) for row in values]
        for k, row in enumerate(rows):
            if row.ndim != 1 or len(row) < 3:
                raise ArgumentError(f"faces: face {k} has shape {row.shape}, expected at least 3 indices")
        counts = np.array([len(row) for row in rows], dtype=np.uint64)
        flat = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    if len(counts) == 0:
        raise ArgumentError("faces: there are none")
    if flat.dtype.kind not in "iu":
        raise ArgumentError(f"faces: numbers of type {flat.dtype}, expected whole numbers")
    ends = np.cumsum(counts, dtype=np.uint64)
    wrong = np.flatnonzero((flat < 0) | (flat >= n_vertices))
    if len(wrong):
        face = int(np.searchsorted(ends, wrong[0], side="right"))
        raise ArgumentError(f"faces: face {face} has vertex {flat[wrong[0]]}, and there are {n_vertices} vertices")
    return np.ascontiguousarray(flat, dtype=np.uint32), ends


def surfaces(values: Optional[Sequence[Any]], n_faces: int) -> tuple[list[str], NDArray[np.uint32]]:
    """Returns the names of surfaces, in the order in which they appear, and that of each face; none for None."""
    if values is None:
        return [], np.zeros(0, dtype=np.uint32)
    array = np.asarray(values)
    if array.shape != (n_faces,):
        raise ArgumentError(f"surfaces: shape {array.shape}, expected ({n_faces},), one for each face")
    if array.dtype.kind not in "iuUO":
        raise ArgumentError(f"surfaces: values of type {array.dtype}, expected names or whole numbers")
    names: dict[str, int] = {}
    plain = array.dtype.kind in "iu"
    ids = [names.setdefault(f"surface{key}" if plain else str(key), len(names)) for key in array.tolist()]
    return list(names), np.array(ids, dtype=np.uint32)


def of_faces(name: str, values: Values, names: Sequence[str], surface: NDArray[np.uint32], n_faces: int) -> Floats:
    """Returns three channels of each face, or of all faces alike, from a number, an array or a mapping from names of surfaces."""
    if isinstance(values, Mapping):
        return by_surface(name, values, names, surface)
    array = floats(name, values)
    if array.ndim == 0:
        return np.full((1, 3), array)
    if array.shape == (1, 3) or array.shape == (n_faces, 3):
        return np.ascontiguousarray(array)
    if array.shape == (n_faces,):
        return np.repeat(array[:, np.newaxis], 3, axis=1)
    expected = f"a number, (1, 3) for one colour, ({n_faces},), ({n_faces}, 3), or a dict from names of surfaces"
    raise ArgumentError(f"{name}: shape {array.shape}, expected {expected}")


def by_surface(
    name: str, values: Mapping[str, ArrayLike], names: Sequence[str], surface: NDArray[np.uint32]
) -> Floats:
    """Returns three channels of each face from a mapping; `"*"` stands for all other surfaces."""
    if not names:
        raise ArgumentError(f"{name}: a dict needs `surfaces`, the names of the faces' surfaces")
    unknown = [key for key in values if key not in names and key != "*"]
    if unknown:
        raise ArgumentError(f"{name}: there is no surface {unknown[0]!r}; the scene has {', '.join(names[:12])}")
    table = np.empty((len(names), 3))
    for k, own in enumerate(names):
        value = values.get(own, values.get("*"))
        if value is None:
            raise ArgumentError(f"{name}: no value for surface {own!r}; give one, or one for '*'")
        array = floats(f"{name}[{own!r}]", value)
        if array.shape not in ((), (3,)):
            raise ArgumentError(f"{name}[{own!r}]: shape {array.shape}, expected a number or three")
        table[k] = array
    return np.ascontiguousarray(table[surface])


def of_patches(name: str, values: ArrayLike, n: int) -> Floats:
    """Returns an array over patches: a number, (n,), (n, k) or (n, k, 3)."""
    array = floats(name, values)
    if array.ndim == 0:
        return np.full(n, array)
    if array.shape[0] == n and (array.ndim in (1, 2) or (array.ndim == 3 and array.shape[2] == 3)):
        return array
    raise ArgumentError(f"{name}: shape {array.shape}, expected a number, ({n},), ({n}, k) or ({n}, k, 3)")


def squeezed(values: Floats) -> Floats:
    """Returns the values of one channel without its axis."""
    return values[:, 0] if values.shape[1] == 1 else values


def vector(name: str, values: Optional[Sequence[float]]) -> Optional[list[float]]:
    """Returns three numbers."""
    if values is None:
        return None
    array = floats(name, values)
    if array.shape != (3,):
        raise ArgumentError(f"{name}: shape {array.shape}, expected (3,)")
    found: list[float] = array.tolist()
    return found


def instance(name: str, value: T, kind: type[T]) -> T:
    """Returns a value that is an instance of a class."""
    if not isinstance(value, kind):
        raise ArgumentError(f"{name}: {type(value).__name__}, expected {kind.__name__}")
    return value


def flag(name: str, value: object) -> bool:
    """Returns a truth value."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(f"{name}: {type(value).__name__}, expected bool")
    return bool(value)


def whole(name: str, value: Any, least: int) -> int:
    """Returns a whole number of 32 bits."""
    try:
        number = operator.index(value)
    except TypeError:
        raise ArgumentError(f"{name}: {type(value).__name__}, expected a whole number") from None
    if number < least:
        raise ArgumentError(f"{name}: {number} is {'not above 0' if least else 'negative'}")
    if number >= 1 << 32:
        raise ArgumentError(f"{name}: {number} is above {(1 << 32) - 1}")
    return number


def table(name: str, value: Optional[Mapping[str, Any]]) -> Optional[dict[str, Any]]:
    """Returns a mapping as a dict."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{name}: {type(value).__name__}, expected a dict")
    return dict(value)


def path(name: str, value: Any) -> str:
    """Returns the name of a file."""
    try:
        return os.fsdecode(value)
    except TypeError:
        raise ArgumentError(f"{name}: {type(value).__name__}, expected a path") from None


def optional_path(name: str, value: Any) -> Optional[str]:
    """Returns the name of a file, or None."""
    return None if value is None else path(name, value)


def turned(flip: Union[bool, str, Sequence[str]]) -> Union[bool, list[str]]:
    """Returns the surfaces that are reversed: all, none, or some by their names."""
    if isinstance(flip, (bool, np.bool_)):
        return bool(flip)
    if isinstance(flip, str):
        return [flip]
    if not hasattr(flip, "__iter__"):
        raise ArgumentError(f"flip: {type(flip).__name__}, expected bool or names of surfaces")
    return list(flip)


def toml(name: str, value: Any) -> str:
    """Returns a value in TOML: text, paths, truth values, numbers, and lists and tables of these."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (str, os.PathLike)):
        return json.dumps(os.fspath(value))
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(str(key))} = {toml(f'{name}[{key!r}]', own)}" for key, own in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, (list, tuple)) and not all(isinstance(own, (int, float)) for own in value):
        return "[" + ", ".join(toml(f"{name}[{k}]", own) for k, own in enumerate(value)) + "]"
    array = floats(name, value)
    if array.ndim > 1:
        raise ArgumentError(f"{name}: shape {array.shape}, expected a number or a row of numbers")
    if array.ndim == 0:
        return repr(float(array))
    return "[" + ", ".join(repr(number) for number in array.tolist()) + "]"


def given(**options: Any) -> dict[str, Any]:
    """Returns the options that are not None."""
    return {name: value for name, value in options.items() if value is not None}
