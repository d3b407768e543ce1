"""Scenes from arrays and files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import CUBE, INWARDS, SIDES, cube, squares

import radiosity as rd

ROOT = Path(__file__).resolve().parents[2]


def test_patches_have_surfaces_areas_and_normals() -> None:
    model = cube(subdivide=3)
    assert model.n_patches == 54
    assert model.surfaces == SIDES
    assert np.array_equal(np.bincount(model.patch_surface), [9] * 6)
    np.testing.assert_allclose(model.patch_area, 1.0 / 9.0, rtol=1e-14)
    np.testing.assert_allclose(model.surface_area, 1.0, rtol=1e-14)
    # All of them look at the middle.
    inwards = ((0.5 - model.patch_centroid) * model.patch_normal).sum(axis=1)
    np.testing.assert_allclose(inwards, 0.5, rtol=1e-12)
    assert repr(model) == "<Model: 54 patches on 6 surfaces>"


@pytest.mark.parametrize("faces", [np.array(INWARDS), INWARDS, [tuple(face) for face in INWARDS]])
def test_faces_of_every_kind_are_the_same_scene(faces: object) -> None:
    model = rd.Model(CUBE, faces)
    assert model.surfaces == [f"face{k}" for k in range(1, 7)]
    triangles = [corner for a, b, c, d in INWARDS for corner in ([a, b, c], [a, c, d])]
    halves = rd.Model(np.array(CUBE), np.array(triangles))
    assert halves.surfaces == ["part1", "part3", "part5", "part7", "part9", "part11"]
    mixed = rd.Model(CUBE, INWARDS[:5] + triangles[-2:])
    assert [round(float(area), 12) for area in mixed.surface_area] == [1.0] * 6
    for other in (halves, mixed):
        np.testing.assert_allclose(other.form_factors().surface, model.form_factors().surface, atol=1e-6)


def test_surfaces_are_named_or_numbered() -> None:
    assert rd.Model(CUBE, INWARDS, surfaces=[7, 7, 1, 1, 2, 2]).surfaces == ["surface7", "surface1", "surface2"]
    assert rd.Model(CUBE, INWARDS, surfaces=np.array(["b", "a", "b", "a", "c", "b"])).surfaces == ["b", "a", "c"]
    assert rd.Model(CUBE, INWARDS, crease_angle=120.0).surfaces == ["part1"]


def test_materials_of_faces_and_surfaces() -> None:
    model = cube(reflectance={"floor": 0.1, "*": 0.7}, exitance=[0, 3, 0, 0, 0, 0])
    np.testing.assert_array_equal(model.reflectance, [0.1] + [0.7] * 5)
    np.testing.assert_array_equal(model.exitance, [0, 3, 0, 0, 0, 0])
    coloured = cube(reflectance=[[0.1, 0.2, 0.3]], exitance={"ceiling": (1, 2, 3), "*": 0})
    assert coloured.reflectance.shape == (6, 3)
    np.testing.assert_array_equal(coloured.exitance[1], [1, 2, 3])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": np.zeros((8, 2))}, r"vertices: shape \(8, 2\), expected \(n, 3\)"),
        ({"vertices": [[0, 0, np.nan]] + CUBE[1:]}, r"vertices: nan at \[0, 2\] is not finite"),
        ({"vertices": "cube"}, "vertices: no array of numbers"),
        ({"faces": np.zeros((2, 2), int)}, r"faces: shape \(2, 2\)"),
        ({"faces": [[0, 1]]}, "faces: face 0 has shape"),
        ({"faces": []}, "faces: there are none"),
        ({"faces": [[0, 1, 2], [0, 1, 8]]}, "faces: face 1 has vertex 8, and there are 8 vertices"),
        ({"faces": [[0, 1, -1]]}, "faces: face 0 has vertex -1"),
        ({"faces": np.zeros((2, 3))}, "faces: numbers of type float64"),
        ({"surfaces": ["a"]}, r"surfaces: shape \(1,\), expected \(6,\)"),
        ({"reflectance": 1.5}, r"reflectance: 1.5 is outside \[0, 1"),
        ({"reflectance": [0.5] * 5}, r"reflectance: shape \(5,\)"),
        ({"reflectance": {"roof": 0.5}}, "reflectance: a dict needs `surfaces`"),
        ({"reflectance": {"roof": 0.5}, "surfaces": SIDES}, "reflectance: there is no surface 'roof'"),
        ({"reflectance": {"floor": 0.5}, "surfaces": SIDES}, "reflectance: no value for surface 'ceiling'"),
        ({"exitance": [0, 0, -1.0, 0, 0, 0]}, "exitance: -1.0 of face 2 is outside"),
        ({"exitance": np.inf}, "exitance: inf is not finite"),
        ({"subdivide": 0}, "subdivide: 0 is not above 0"),
        ({"subdivide": 2, "max_edge": 0.5}, "subdivide, max_edge: give one of them"),
        ({"max_edge": -1.0}, "max_edge: -1 is not above 0"),
        ({"unit": "km"}, 'unit: "km" is none of m, mm, cm, in, ft'),
        ({"cut_at_walls": "no"}, "cut_at_walls: no of type str cannot be used"),
    ],
)
def test_wrong_arguments_are_named(change: dict[str, object], message: str) -> None:
    arguments = {"vertices": CUBE, "faces": INWARDS, **change}
    with pytest.raises(rd.ArgumentError, match=message) as caught:
        rd.Model(**arguments)  # type: ignore[arg-type]
    assert isinstance(caught.value, rd.RadiosityError) and isinstance(caught.value, ValueError)


def test_scenes_that_cannot_be_are_refused() -> None:
    with pytest.raises(rd.SceneError, match="face 6"):
        rd.Model(CUBE, INWARDS + [INWARDS[0]])
    with pytest.raises(rd.SceneError, match="no such file|cannot be read|No such file"):
        rd.Model.read("/nowhere/scene.obj")
    with pytest.raises(rd.SceneError, match="vertex 0"):
        rd.Model([[1e30, 0, 0]] + CUBE[1:], INWARDS)


def test_files_of_all_formats_are_the_same_scene() -> None:
    folder = ROOT / "tests" / "data" / "formats"
    model = rd.Model.read(ROOT / "scenes" / "room-box" / "scene.obj", subdivide=2)
    assert model.surfaces[0] == "room_x0"
    assert folder.is_dir()
    found = 0
    for path in sorted(folder.rglob("*")):
        if path.suffix in (".stl", ".ply", ".msh", ".vtu", ".glb", ".vs3"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rd.RadiosityWarning)
                read = rd.Model.read(path)
            assert read.n_patches > 0, path
            found += 1
    assert found >= 6


def test_units_axes_and_windings() -> None:
    with pytest.warns(rd.RadiosityWarning, match="flip"):
        half = rd.Model(np.array(CUBE) * 100.0, INWARDS, unit="cm", up_axis="y", flip=True)
    np.testing.assert_allclose(half.surface_area, 1.0, rtol=1e-12)
    outwards = ((0.5 * np.array([1, -1, 1]) - half.patch_centroid) * half.patch_normal).sum(axis=1)
    np.testing.assert_allclose(outwards, -0.5, rtol=1e-12)


def test_warnings_are_warnings() -> None:
    # The smaller face is drawn on the larger one, and is cut out of it.
    vertices = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [1, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]]
    with pytest.warns(rd.RadiosityWarning, match="cut out") as caught:
        rd.Model(vertices, [[0, 1, 2, 3], [4, 5, 6, 7], [0, 3, 2, 1]])
    assert caught[0].filename == __file__


def test_meshes_of_other_packages() -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=[2.0, 2.0, 2.0])
    with pytest.warns(rd.RadiosityWarning, match="no face sees another"):
        assert rd.from_trimesh(box).n_patches == 12
    box.invert()
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name="a", geom_name="g")
    moved = trimesh.transformations.translation_matrix([5.0, 0.0, 0.0])
    scene.add_geometry(box, node_name="b", geom_name="h", transform=moved)
    model = rd.from_trimesh(scene)
    assert sorted(model.surfaces) == ["a", "b"]
    b = model.patch_centroid[model.patch_surface == model.surfaces.index("b")]
    assert b[:, 0].min() > 3.0


def test_meshio_meshes() -> None:
    meshio = pytest.importorskip("meshio")
    cells = [("quad", np.array(INWARDS[:4])), ("triangle", np.array([[3, 7, 6], [3, 6, 2]])), ("line", [[0, 1]])]
    data = {"gmsh:physical": [np.array([1, 1, 2, 2]), np.array([3, 3]), np.array([9])]}
    model = rd.from_meshio(meshio.Mesh(np.array(CUBE), cells, cell_data=data))
    assert model.surfaces == ["surface1", "surface2", "surface3"]
    assert model.n_patches == 6
    groups = {"floor": np.array([1, 2]), "lid": np.array([3, 2]), "rim": np.array([9, 1])}
    named = rd.from_meshio(meshio.Mesh(np.array(CUBE), cells, cell_data=data, field_data=groups))
    assert named.surfaces == ["floor", "surface2", "lid"]


def test_pyvista_there_and_back() -> None:
    pyvista = pytest.importorskip("pyvista")
    model = cube(subdivide=2)
    mesh = model.to_pyvista(radiosity=np.arange(24.0))
    assert mesh.n_cells == 24
    np.testing.assert_allclose(mesh.compute_cell_sizes()["Area"], model.patch_area, rtol=1e-6)
    assert list(mesh.field_data["surface_name"]) == SIDES
    np.testing.assert_array_equal(mesh.cell_data["radiosity"], np.arange(24.0))
    back = rd.from_pyvista(mesh)
    assert back.n_patches == 24 and back.surfaces == SIDES
    np.testing.assert_array_equal(back.patch_surface, model.patch_surface)
    with pytest.warns(rd.RadiosityWarning, match="no face sees another"):
        assert rd.from_pyvista(pyvista.Cube()).n_patches == 6
    with pytest.raises(rd.ArgumentError, match=r"bad: shape \(3,\)"):
        model.to_pyvista(bad=[1, 2, 3])


def test_two_squares_have_no_surface_arrays_of_their_own() -> None:
    assert squares(subdivide=2).surfaces == ["lower", "upper"]
