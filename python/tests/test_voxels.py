"""Light on voxels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import SIDES, cube

import radiosity as rd


def test_a_furnace_on_voxels_is_one_light() -> None:
    model = cube(reflectance=0.5, exitance=1.0)
    voxels = model.voxels(12, radius=8, solver="auto", tolerance=1e-9)
    n = voxels.figures["n_surfels"]
    assert voxels.centre.shape == voxels.normal.shape == (n, 3)
    assert voxels.area.shape == voxels.surface.shape == voxels.radiosity.shape == (n,)
    # B = E / (1 - rho).
    np.testing.assert_allclose(voxels.radiosity, 2.0, rtol=1e-2)
    np.testing.assert_allclose(voxels.irradiance, 2.0, rtol=1e-2)
    # All of the six unit squares, and only these.
    np.testing.assert_allclose(np.bincount(voxels.surface, voxels.area), np.ones(6), rtol=1e-9)
    assert [surface["name"] for surface in voxels.figures["surfaces"]] == SIDES
    # The centres of the floor's voxels lie on the floor, to half a voxel, and its surfels face up.
    floor = voxels.surface == SIDES.index("floor")
    assert np.abs(voxels.centre[floor, 2]).max() <= 0.51 * voxels.figures["voxel_size_m"]
    np.testing.assert_array_equal(voxels.normal[floor], np.broadcast_to([0.0, 0.0, 1.0], (floor.sum(), 3)))


@pytest.mark.filterwarnings("ignore:.*unshot light is left")
def test_passes_near_the_solution() -> None:
    model = cube(reflectance=0.5, exitance={"ceiling": 1.0, "*": 0.0})
    solved = model.voxels(10, radius=6, solver="auto", tolerance=1e-9)
    changes = []
    for passes in (2, 30):
        voxels = model.voxels(10, radius=6, passes=passes, form="jacobi")
        assert voxels.figures["n_passes"] == passes
        changes.append(np.abs(voxels.radiosity - solved.radiosity).max())
    assert changes[1] < 1e-6 < 1e-2 < changes[0]
    adaptive = model.voxels(10, radius=6, adaptive=0.05, coarsest=1)
    assert adaptive.figures["n_cells"] <= solved.figures["n_surfels"]


def test_an_image_and_a_file(tmp_path: Path) -> None:
    model = cube(subdivide=4, reflectance=0.5, exitance=1.0)
    voxels = model.voxels(12, radius=8)
    camera = {"eye": [0.5, 0.05, 0.5], "look_at": [0.5, 1.0, 0.5], "fov": 60.0, "width": 16, "height": 12}
    image = voxels.render(**camera)
    assert image.size == (16, 12)
    np.testing.assert_allclose(image.radiance, 2.0 / np.pi, rtol=2e-2)
    assert voxels.render(**camera, show_voxels=True).size == (16, 12)
    voxels.save(tmp_path / "B.vtu")
    meshio = pytest.importorskip("meshio")
    mesh = meshio.read(tmp_path / "B.vtu")
    np.testing.assert_array_equal(mesh.cell_data["radiosity"][0].ravel(), voxels.radiosity)
    assert [block.type for block in mesh.cells] == ["hexahedron"]
    corners = mesh.points[mesh.cells[0].data]
    np.testing.assert_allclose(corners.mean(axis=1), voxels.centre, atol=1e-12)
    # Around the lower face counter-clockwise, then up: the volume is positive, and that of a cube.
    edges = [corners[:, k] - corners[:, 0] for k in (1, 3, 4)]
    volume = np.einsum("ij,ij->i", np.cross(edges[0], edges[1]), edges[2])
    np.testing.assert_allclose(volume, voxels.figures["voxel_size_m"] ** 3, rtol=1e-9)
    with pytest.raises(rd.ArgumentError, match="written as .vtu"):
        voxels.save(tmp_path / "B.exr")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n": 2}, "2|4"),
        ({"radius": 0}, "0"),
        ({"solver": "auto", "passes": 3}, "passes"),
        ({"tolerance": 1e-3}, "tolerance: only along with a solver"),
        ({"adaptive": 0.1, "solver": "auto"}, "solver: not along with adaptive"),
        ({"coarsest": 2}, "coarsest"),
        ({"adaptive": 0.1, "coarsest": 7}, "coarsest"),
        ({"links": "memory", "link_file": "x.links"}, "link_file"),
        ({"form": "chaos"}, 'form: "chaos" is none of'),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(rd.RadiosityError, match=message):
        cube(exitance=1.0).voxels(**arguments)  # type: ignore[arg-type]


def test_threads_change_nothing() -> None:
    model = cube(subdivide=3, exitance=1.0)
    found = []
    try:
        for n in (1, 2, None):
            rd.set_threads(n)
            found.append(model.form_factors("qmc", rays=16).toarray())
    finally:
        rd.set_threads(None)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    with pytest.raises(rd.ArgumentError, match="0 is not above 0"):
        rd.set_threads(0)
