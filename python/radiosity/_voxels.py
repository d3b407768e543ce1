"""Discrete radiosity: light on voxels."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arguments import given, optional_path, squeezed, vector
from ._image import Image
from ._progress import Bar, Progress
from ._result import Result

if TYPE_CHECKING:
    from ._model import Model

Floats = NDArray[np.float64]


class VoxelSolution(Result[_core.VoxelSolution]):
    """Radiosities on the voxels of a scene, one for each of their n surfels: the share of one surface in one voxel.

    `Model.voxels` makes it. The method and its errors are in `docs/methods.md` of the project. `save` writes the
    voxels as ``.vtu``; `render` makes an image.
    """

    def __init__(self, core: _core.VoxelSolution, model: Model) -> None:
        super().__init__(core)
        self._model = model

    def __repr__(self) -> str:
        found = self.figures
        return f"<VoxelSolution of {found['n_surfels']} surfels in {found['n_voxels']} voxels>"

    @property
    def model(self) -> Model:
        """The model of the voxels."""
        return self._model

    @property
    def centre(self) -> Floats:
        """The centre of each surfel's voxel, m, (n, 3)."""
        return self._core.centre

    @property
    def normal(self) -> Floats:
        """The unit normal of each surfel, on its front, (n, 3)."""
        return self._core.normal

    @property
    def area(self) -> Floats:
        """The share of each surfel in the area of its surface, m2, (n,)."""
        return self._core.area

    @property
    def surface(self) -> NDArray[np.int64]:
        """The id of the surface of each surfel, an index into `Model.surfaces`, (n,)."""
        return self._core.surface

    @property
    def radiosity(self) -> Floats:
        """The radiosity B of each surfel, W/m2, (n,) for a gray scene, else (n, 3)."""
        return squeezed(self._core.radiosity)

    @property
    def irradiance(self) -> Floats:
        """The irradiance H of each surfel, W/m2, (n,) for a gray scene, else (n, 3)."""
        return squeezed(self._core.irradiance)

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Voxels, links, leaks and the surfaces with their mean radiosity, by the names of `radiosity voxel --json`."""
        found: dict[str, Any] = json.loads(self._core.record)
        return found

    def render(
        self,
        *,
        eye: Optional[Sequence[float]] = None,
        look_at: Optional[Sequence[float]] = None,
        up: Optional[Sequence[float]] = None,
        fov: Optional[float] = None,
        width: Optional[int] = None,
        height: Optional[int] = None,
        camera: Union[None, str, os.PathLike[str]] = None,
        samples: Optional[int] = None,
        flat: Optional[bool] = None,
        show_voxels: bool = False,
        progress: Progress = None,
    ) -> Image:
        """Renders the light on the patches of the model, or the voxels themselves.

        Parameters
        ----------
        eye, look_at, up, fov, width, height, camera, samples, flat, progress
            As of `Model.render`.
        show_voxels : bool
            Show the voxels, not the surfaces that they represent.

        Returns
        -------
        Image

        Raises
        ------
        ArgumentError, SceneError
            If settings do not fit together, or the camera cannot be read.
        """
        options = given(
            eye=vector("eye", eye),
            look_at=vector("look_at", look_at),
            up=vector("up", up),
            fov=fov,
            width=width,
            height=height,
            camera=optional_path("camera", camera),
            samples=samples,
            flat=flat,
            show_voxels=show_voxels,
        )
        with Bar(progress) as callback:
            return Image(self._core.render(options, callback))
