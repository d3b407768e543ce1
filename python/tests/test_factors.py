"""Form factors: closed forms, conservation, files, linear algebra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import CUBE, INWARDS, cube, squares

import radiosity as rd


def opposed(distance: float) -> float:
    """The factor between two opposed unit squares (closed form)."""
    x = 1.0 / distance
    a = 1.0 + x * x
    log = np.log(a * a / (1.0 + 2.0 * x * x))
    whole = 0.5 * log + 2.0 * x * np.sqrt(a) * np.arctan(x / np.sqrt(a)) - 2.0 * x * np.arctan(x)
    return float(2.0 / (np.pi * x * x) * whole)


@pytest.mark.parametrize("distance", [0.1, 1.0, 7.0])
@pytest.mark.parametrize("subdivide", [1, 3])
def test_opposed_squares(distance: float, subdivide: int) -> None:
    ff = squares(distance, subdivide=subdivide).form_factors()
    assert abs(ff.surface[0, 1] - opposed(distance)) <= ff.surface_error[0, 1] + 1e-12
    assert ff.surface_error[0, 1] < 1e-6
    assert ff.surface[0, 0] == ff.surface[1, 1] == 0.0
    np.testing.assert_allclose(ff.surface.sum(axis=1) + ff.surface_sky, 1.0, atol=1e-9)
    np.testing.assert_allclose(ff.lost, ff.surface_sky, atol=1e-9)
    assert ff.warnings == []


@pytest.mark.parametrize(("turn", "move"), [(0.0, 0.0), (0.7, 0.0), (0.3, 12.5)])
def test_rows_of_a_closed_scene_sum_to_one(turn: float, move: float) -> None:
    model = cube(turn, move, subdivide=3)
    ff = model.form_factors()
    np.testing.assert_allclose(ff.row_sums, 1.0, atol=1e-6)
    np.testing.assert_allclose(ff.sky, 0.0, atol=1e-6)
    exchange = model.patch_area[:, np.newaxis] * ff.toarray()
    np.testing.assert_allclose(exchange, exchange.T, atol=1e-12)
    assert ff.checks["closed"] and ff.checks["reciprocity_error_max"] < 1e-9


def test_a_row_is_from_i_to_j() -> None:
    # A small square over a large one: nearly all that leaves the small one reaches the large one, not the other way.
    small = [[0.45, 0.45, 0.05], [0.55, 0.45, 0.05], [0.55, 0.55, 0.05], [0.45, 0.55, 0.05]]
    large = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    ff = rd.Model(small + large, [[3, 2, 1, 0], [4, 5, 6, 7]], surfaces=["small", "large"]).form_factors()
    assert ff.matrix[0, 1] > 0.9 and ff.matrix[1, 0] < 0.02
    assert ff.surface[0, 1] == pytest.approx(ff.matrix[0, 1])
    assert (ff @ [0.0, 1.0])[0] == pytest.approx(ff.matrix[0, 1])


def test_matrix_errors_and_products_agree() -> None:
    ff = cube(subdivide=4).form_factors("sr", rays=256)
    full = ff.toarray()
    np.testing.assert_array_equal(np.asarray(ff.matrix.todense() if hasattr(ff.matrix, "todense") else ff.matrix), full)
    errors = np.asarray(ff.errors.todense() if hasattr(ff.errors, "todense") else ff.errors)
    exact = cube(subdivide=4).form_factors().toarray()
    assert np.mean(np.abs(full - exact) <= 3.0 * errors + 1e-12) > 0.9
    x = np.random.default_rng(1).random((96, 3))
    np.testing.assert_allclose(ff @ x, full @ x, rtol=1e-12)
    np.testing.assert_allclose(ff @ x[:, 0], full @ x[:, 0], rtol=1e-12)
    with pytest.raises(rd.ArgumentError, match=r"x: shape \(95,\), expected \(96,\)"):
        ff @ x[1:, 0]
    with pytest.raises(rd.ArgumentError, match="x: nan"):
        ff @ np.full(96, np.nan)


def test_sparse_matrices_and_linear_operators() -> None:
    sparse = pytest.importorskip("scipy.sparse")
    # A row of boxes: most pairs are hidden.
    n_boxes = 4
    vertices = np.concatenate([np.array(CUBE) + [3.0 * k, 0, 0] for k in range(n_boxes)])
    faces = np.concatenate([np.array(INWARDS) + 8 * k for k in range(n_boxes)])
    ff = rd.Model(vertices, faces, subdivide=2).form_factors()
    assert ff.density < 1 / 3
    assert sparse.issparse(ff.matrix) and sparse.issparse(ff.errors)
    np.testing.assert_array_equal(ff.matrix.toarray(), ff.toarray())
    operator = ff.aslinearoperator()
    x = np.random.default_rng(2).random(ff.shape[0])
    np.testing.assert_allclose(operator @ x, ff.toarray() @ x, rtol=1e-12)
    if ff.is_symmetric:
        np.testing.assert_allclose(operator.T @ x, ff.toarray().T @ x, rtol=1e-12)


@pytest.mark.parametrize("dense", [False, True])
def test_files_come_back(tmp_path: Path, dense: bool) -> None:
    model = cube(subdivide=2, reflectance=0.25)
    ff = model.form_factors("sr", rays=200, balance="off")
    path = tmp_path / "F.npz"
    ff.save(path, dense=dense)
    again = rd.load(path, cube(subdivide=2, reflectance=0.75), balance="off")
    np.testing.assert_array_equal(again.toarray(), ff.toarray())
    np.testing.assert_array_equal(again.row_sums, ff.row_sums)
    with np.load(path) as archive:
        assert "from" not in archive.files
        assert str(archive["meta"]).startswith("{") and '"method": "sr"' in str(archive["meta"])
        np.testing.assert_array_equal(archive["area_m2"], model.patch_area)
        np.testing.assert_array_equal(archive["sky_factor"], ff.sky)
        if dense:
            np.testing.assert_array_equal(archive["F"], ff.toarray())
        else:
            sparse = pytest.importorskip("scipy.sparse")
            np.testing.assert_array_equal(sparse.load_npz(path).toarray(), ff.toarray())
    with pytest.raises(rd.FileError, match="geometry"):
        rd.load(path, cube(0.1, subdivide=2))
    with pytest.raises(rd.ArgumentError, match="subdivide"):
        rd.load(path, cube(subdivide=3))


@pytest.mark.parametrize("ending", ["npy", "mtx", "csv", "exr", "vtu", "vf", "ply", "obj"])
def test_other_files(tmp_path: Path, ending: str) -> None:
    model = cube(subdivide=2)
    ff = model.form_factors()
    path = tmp_path / f"F.{ending}"
    ff.save(path, surface="floor" if ending in ("vtu", "ply", "obj") else None)
    assert path.stat().st_size > 100
    if ending in ("npy", "mtx"):
        again = rd.load(path, model)
        assert not again.errors_known and np.isnan(again.errors).all() and np.isnan(again.surface_error).all()
        np.testing.assert_allclose(again.toarray(), ff.toarray(), rtol=1e-12, atol=1e-300)
    if ending == "vf":
        lines = path.read_text().splitlines()
        assert lines[0].split() == ["View3D", "3.3", "0", "1", "0", "6"] and len(lines) == 9
        np.testing.assert_allclose([[float(x) for x in line.split()] for line in lines[2:8]], ff.surface, atol=1e-6)
    if ending in ("ply", "obj"):
        assert rd.Model.read(path).n_patches == 24
    if ending == "npy":
        np.testing.assert_array_equal(np.load(path), ff.toarray())


def test_errors_have_their_classes(tmp_path: Path) -> None:
    model = cube()
    with pytest.raises(rd.FormFactorError, match="magic"):
        model.form_factors("magic")
    with pytest.raises(rd.FormFactorError, match="rays"):
        model.form_factors(rays=3)
    with pytest.raises(rd.ArgumentError, match="rays: 0 is not above 0"):
        model.form_factors("sr", rays=0)
    with pytest.raises(rd.ArgumentError, match="balance"):
        model.form_factors(balance="off", storage="symmetric")
    with pytest.raises(rd.SceneError, match="closed"):
        squares().form_factors("sr", closed=True)
    with pytest.raises(rd.MemoryLimitError, match="memory_limit"):
        cube(subdivide=40).form_factors(memory_limit=1000)
    with pytest.raises(rd.FileError, match="F.bin"):
        model.form_factors().save(tmp_path / "F.bin")
    with pytest.raises(rd.FileError, match="nowhere"):
        rd.load("/nowhere/F.npz", model)
    with pytest.raises(rd.ArgumentError, match="surface: there is no surface"):
        model.form_factors().save(tmp_path / "F.vtu", surface="roof")


def test_storages_hold_the_same(tmp_path: Path) -> None:
    model = cube(subdivide=3)
    expected = model.form_factors().toarray()
    for storage in ("dense", "symmetric", "sparse", "disk"):
        ff = model.form_factors(storage=storage, scratch=tmp_path)
        np.testing.assert_allclose(ff.toarray(), expected, rtol=1e-9, atol=1e-12)
    single = model.form_factors(precision="f32").toarray()
    np.testing.assert_allclose(single, expected, rtol=1e-6, atol=1e-9)


def test_a_sphere_in_a_box() -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=[2.0, 3.0, 4.0])
    box.invert()
    # An icosahedron is enough of a sphere: its own area counts.
    sphere = trimesh.creation.icosphere(subdivisions=0, radius=0.6)
    sphere.apply_translation([0.1, -0.2, 0.4])
    model = rd.from_trimesh({"box": box, "sphere": sphere})
    ff = model.form_factors()
    k, s = model.surfaces.index("box"), model.surfaces.index("sphere")
    expected = sphere.area / box.area
    assert abs(ff.surface[k, s] - expected) <= ff.surface_error[k, s]
    assert ff.surface_error[k, s] < 1e-4 * expected
    assert abs(ff.surface[s, k] - 1.0) <= ff.surface_error[s, k]


def test_row_tolerance() -> None:
    model = rd.Model.builtin("cornell-box")
    loose = model.form_factors(row_tolerance=1e-3)
    fine = model.form_factors(tolerance=1e-8)
    assert 1e-9 < loose.row_sum_errors.max() <= 1e-3
    off = np.abs(loose.row_sums - fine.row_sums)
    assert (off <= loose.row_sum_errors + fine.row_sum_errors).all()
    with pytest.raises(rd.FormFactorError, match="above 0"):
        model.form_factors(row_tolerance=0.0)
