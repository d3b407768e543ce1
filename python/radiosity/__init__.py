"""View factors and radiosity for diffuse scenes, with an error stated for every number.

A scene of flat faces becomes a `Model`; from it come `FormFactors` (view factors; both names mean the
same), a `Solution` (radiosities), an `Image`, `Heat` (temperatures and net fluxes), `PointViews` and a
`VoxelSolution` (discrete radiosity).

>>> import radiosity as rd
>>> vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
>>> faces = [[0, 1, 2, 3], [4, 7, 6, 5]]
>>> model = rd.Model(vertices, faces, surfaces=["lower", "upper"])
>>> ff = model.form_factors()
>>> round(float(ff.surface[0, 1]), 6)
0.199825

A row of a matrix of form factors is from i to j: F[i, j] is the fraction of the light leaving i that reaches
j, so each row sums to 1 in a closed scene.

Warnings are `RadiosityWarning`s of the module `warnings`, errors are subclasses of `RadiosityError`.
Long calls release the interpreter's lock, end with Ctrl-C, and show a bar in a terminal or notebook.
"""

from __future__ import annotations

from ._core import __version__
from ._errors import (
    ArgumentError,
    FileError,
    FormFactorError,
    HeatError,
    MemoryLimitError,
    RadiosityError,
    RadiosityWarning,
    RenderError,
    SceneError,
    SolverError,
)
from ._factors import FormFactors
from ._heat import ExchangeFactors, Heat, PointViews, SunPath
from ._image import Image, verify
from ._interop import from_meshio, from_pyvista, from_trimesh
from ._model import Model, load
from ._solution import Solution
from ._threads import set_threads
from ._voxels import VoxelSolution

__all__ = [
    "ArgumentError",
    "ExchangeFactors",
    "FileError",
    "FormFactorError",
    "FormFactors",
    "Heat",
    "HeatError",
    "Image",
    "MemoryLimitError",
    "Model",
    "PointViews",
    "RadiosityError",
    "RadiosityWarning",
    "RenderError",
    "SceneError",
    "Solution",
    "SolverError",
    "SunPath",
    "VoxelSolution",
    "__version__",
    "from_meshio",
    "from_pyvista",
    "from_trimesh",
    "load",
    "set_threads",
    "verify",
]
