"""Rendered images."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arguments import path as path_of
from ._result import Result

#: The channels of a group of layers: colours, or coordinates.
_SUFFIXES = ("RGB", "XYZ")


class Image(Result[_core.Image], Mapping[str, "NDArray[Any]"]):
    """An image: the radiance of each pixel, and layers by name.

    `Model.render`, `Model.field` and `VoxelSolution.render` make it. ``np.asarray(image)`` is `radiance`. Layers are ``irradiance``, ``radiosity``,
    ``albedo`` (h, w, 3), ``N`` and ``P`` (normal and position, h, w, 3), ``Z`` (depth), ``patch`` (id, the
    greatest uint32 in the background) and others, as in the OpenEXR files. `save` writes an
    OpenEXR file with all layers, or a PNG.
    """

    def __init__(self, core: _core.Image, surfaces: Optional[list[dict[str, Any]]] = None) -> None:
        super().__init__(core)
        #: Of a field (`Model.field`): the surfaces with the mean ``form_factor`` of the samples that show their
        #: front, ``n_samples`` of them; None of other images.
        self.surfaces = surfaces
        groups: dict[str, list[str]] = {}
        for name in core.names:
            stem, _, suffix = name.rpartition(".")
            groups.setdefault(stem if suffix in "RGBXYZ" and stem else name, []).append(name)
        for letter in "RGB":
            groups.pop(letter, None)
        self._groups = groups

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Image {width} x {height}, {', '.join(self._groups)}>"

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
        return np.asarray(self.radiance, dtype=dtype)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self._core.size

    @property
    def radiance(self) -> NDArray[np.float32]:
        """L of each pixel, W/(m2 sr), float32, (h, w, 3)."""
        return self._stack(["R", "G", "B"])

    def _stack(self, names: list[str]) -> NDArray[np.float32]:
        layers = [self._core.floats(name) for name in names]
        return np.stack([layer for layer in layers if layer is not None], axis=-1)

    def __getitem__(self, name: str) -> NDArray[Any]:
        names = self._groups[name]
        for order in _SUFFIXES:
            channels = [f"{name}.{letter}" for letter in order]
            if set(names) == set(channels):
                return self._stack(channels)
        ids = self._core.ids(names[0])
        if ids is not None:
            return ids
        layer = self._core.floats(names[0])
        if layer is None:
            raise KeyError(name)
        return layer

    def __iter__(self) -> Iterator[str]:
        return iter(self._groups)

    def __len__(self) -> int:
        return len(self._groups)



def verify(path: Union[str, os.PathLike[str]]) -> dict[str, Any]:
    """Checks an OpenEXR image of this package or program against the analytic answer of the scene that it was made from.

    Parameters
    ----------
    path : path
        The image, as `Image.save` writes it.

    Returns
    -------
    dict
        By the names of `radiosity verify --json`: ``passed``, and the errors of each layer.

    Raises
    ------
    RenderError
        If the file cannot be read, or its scene has no analytic answer.
    """
    found: dict[str, Any] = json.loads(_core.verify(path_of("path", path)))
    return found
