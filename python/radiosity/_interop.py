"""Converts meshes of other packages to models; none of these packages is required."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._errors import ArgumentError
from ._model import Model, Settings

if TYPE_CHECKING:
    from typing_extensions import Unpack


def from_trimesh(mesh: Any, /, **settings: Unpack[Settings]) -> Model:
    """Returns the model of a trimesh mesh or scene.

    Parameters
    ----------
    mesh : trimesh.Trimesh, trimesh.Scene or a dict of meshes
        Of a scene or dict every mesh is a surface, with its name; transformations of a scene are applied.
        Faces see on the side of their normal: outwards of a closed mesh that is wound as usual.
    **settings
        As of `Model`; `surfaces` where the mesh is a single one.

    Returns
    -------
    Model

    Raises
    ------
    ArgumentError, SceneError
        As of `Model`.
    """
    if hasattr(mesh, "geometry") and hasattr(mesh, "graph"):
        parts = {}
        for node in mesh.graph.nodes_geometry:
            transform, name = mesh.graph[node]
            parts[str(node)] = mesh.geometry[name].copy().apply_transform(transform)
    elif isinstance(mesh, dict):
        parts = {str(name): part for name, part in mesh.items()}
    else:
        _expect(hasattr(mesh, "vertices") and hasattr(mesh, "faces"), mesh, "a trimesh.Trimesh, a trimesh.Scene or a dict")
        return Model(np.asarray(mesh.vertices), np.asarray(mesh.faces), **settings)
    if "surfaces" in settings:
        raise ArgumentError("surfaces: the names of the meshes are those of the surfaces; leave it out")
    if not parts:
        raise ArgumentError("mesh: it has no geometry")
    vertices, faces, names = [], [], []
    offset = 0
    for name, part in parts.items():
        _expect(hasattr(part, "vertices") and hasattr(part, "faces"), part, f"a trimesh.Trimesh as {name!r}")
        vertices.append(np.asarray(part.vertices, dtype=np.float64))
        faces.append(np.asarray(part.faces, dtype=np.int64) + offset)
        names += [name] * len(part.faces)
        offset += len(part.vertices)
    settings["surfaces"] = names
    return Model(np.concatenate(vertices), np.concatenate(faces), **settings)


def from_pyvista(mesh: Any, /, *, surface_array: str = "surface", **settings: Unpack[Settings]) -> Model:
    """Returns the model of a PyVista surface.

    Parameters
    ----------
    mesh : pyvista.DataSet
        Its surface cells; of a grid of volume cells the outer surface. Quads and larger polygons stay.
    surface_array : str
        The cell array whose values are the surfaces, where there is one of that name; with names as
        `Model.to_pyvista` writes them, where there are some.
    **settings
        As of `Model`.

    Returns
    -------
    Model

    Raises
    ------
    ArgumentError, SceneError
        As of `Model`.
    """
    poly = _surface(mesh)
    faces = _polygons(np.asarray(poly.faces))
    if "surfaces" not in settings and surface_array in poly.cell_data:
        values = np.asarray(poly.cell_data[surface_array])
        names = np.asarray(poly.field_data.get("surface_name", []))
        # As `Model.to_pyvista` writes them: the values are places in the names.
        if names.dtype.kind == "U" and values.dtype.kind in "iu" and 0 <= values.min(initial=0) <= values.max(initial=0) < len(names):
            values = names[values]
        settings["surfaces"] = values.tolist()
    return Model(np.asarray(poly.points, dtype=np.float64), faces, **settings)


def _surface(mesh: Any) -> Any:
    """Returns the polygons of a PyVista mesh."""
    _expect(hasattr(mesh, "points") and hasattr(mesh, "extract_surface"), mesh, "a pyvista.DataSet")
    if not hasattr(mesh, "faces"):
        try:
            # Versions that have several algorithms warn where none is named.
            mesh = mesh.extract_surface(algorithm="dataset_surface")
        except TypeError:
            mesh = mesh.extract_surface()
    return mesh.triangulate() if mesh.n_strips else mesh


def _expect(is_mesh: bool, mesh: Any, kind: str) -> None:
    if not is_mesh:
        raise ArgumentError(f"mesh: {type(mesh).__name__}, expected {kind}")


def _polygons(cells: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Returns faces from numbers of corners, each with the corners after it."""
    faces = []
    at = 0
    while at < len(cells):
        end = at + 1 + int(cells[at])
        faces.append(cells[at + 1 : end])
        at = end
    return faces


def from_meshio(mesh: Any, /, *, surface_array: str = "gmsh:physical", **settings: Unpack[Settings]) -> Model:
    """Returns the model of the triangles, quads and polygons of a meshio mesh.

    Parameters
    ----------
    mesh : meshio.Mesh
        Cells of other kinds are left out.
    surface_array : str
        The cell data whose values are the surfaces, where there is one of that name. Physical groups of gmsh
        have the names that `field_data` gives them.
    **settings
        As of `Model`.

    Returns
    -------
    Model

    Raises
    ------
    ArgumentError, SceneError
        As of `Model`.
    """
    _expect(hasattr(mesh, "points") and hasattr(mesh, "cells"), mesh, "a meshio.Mesh")
    names = {}
    if surface_array == "gmsh:physical":
        groups = mesh.field_data.items()
        names = {int(group[0]): name for name, group in groups if len(group) == 2 and group[1] == 2}
    faces: list[NDArray[np.int64]] = []
    values: list[Any] = []
    arrays = mesh.cell_data.get(surface_array)
    for k, block in enumerate(mesh.cells):
        if block.type not in ("triangle", "quad", "polygon"):
            continue
        faces.extend(np.asarray(block.data))
        if arrays is not None:
            own = np.asarray(arrays[k]).tolist()
            values.extend([names.get(value, f"surface{value}") for value in own] if names else own)
    if arrays is not None and "surfaces" not in settings:
        settings["surfaces"] = values
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.shape[1:] == (2,):
        points = np.column_stack([points, np.zeros(len(points))])
    return Model(points, faces, **settings)
