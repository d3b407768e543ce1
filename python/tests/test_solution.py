"""Solutions: furnaces, many lightings, colours, the sun, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import cube, squares

import radiosity as rd


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_a_furnace(rho: float) -> None:
    solution = cube(0.4, 3.0, subdivide=3, reflectance=rho, exitance=2.0).solve()
    assert solution.stop_reason == "converged"
    error = (solution.error_bound or 0.0) * 2.0 / (1.0 - rho) + 1e-6
    np.testing.assert_allclose(solution.radiosity, 2.0 / (1.0 - rho), atol=10 * error)
    assert solution.radiosity.shape == (54,)
    np.testing.assert_allclose(solution.surface_means, 2.0 / (1.0 - rho), atol=10 * error)


def test_two_squares_in_closed_form() -> None:
    model = squares(reflectance=0.5, exitance={"lower": 1.0, "upper": 0.0})
    ff = model.form_factors()
    solution = model.solve(ff, tolerance=1e-12)
    expected = 1.0 / (1.0 - 0.25 * ff.surface[0, 1] ** 2)
    assert solution.radiosity[0] == pytest.approx(expected, rel=1e-9)
    assert solution.error is not None and solution.error.shape == (2,)
    np.testing.assert_allclose(solution.irradiance, ff @ solution.radiosity, rtol=1e-9)
    assert solution.relative_error is not None and solution.relative_error < 1e-5
    assert solution.history[0]["pass"] == 0 and solution.history[-1]["residual_l2"] <= 1e-12
    assert solution.energy[0]["emitted"] == pytest.approx(1.0)
    assert solution.residual is not None and solution.residual <= 1e-12
    assert solution.form_factors is ff and solution.model is model


def test_many_lightings_are_many_solutions() -> None:
    model = cube(subdivide=3, reflectance={"floor": 0.2, "*": 0.6})
    ff = model.form_factors()
    rng = np.random.default_rng(3)
    lights = rng.random((54, 4))
    all_of_them = model.solve(ff, exitance=lights, tolerance=1e-12)
    assert all_of_them.radiosity.shape == (54, 4)
    assert all_of_them.surface_means.shape == (6, 4)
    for k in range(4):
        one = model.solve(ff, exitance=lights[:, k], tolerance=1e-12)
        assert one.radiosity.shape == (54,)
        np.testing.assert_allclose(all_of_them.radiosity[:, k], one.radiosity, rtol=1e-10)
    # The light of all of them together is the sum of their lights.
    together = model.solve(ff, exitance=lights.sum(axis=1), tolerance=1e-12)
    np.testing.assert_allclose(all_of_them.radiosity.sum(axis=1), together.radiosity, rtol=1e-9)


def test_coloured_lightings_have_three_channels_each() -> None:
    model = cube(subdivide=2, reflectance=[[0.1, 0.5, 0.8]])
    ff = model.form_factors()
    lights = np.random.default_rng(4).random((24, 2, 3))
    solution = model.solve(ff, exitance=lights, tolerance=1e-12)
    assert solution.radiosity.shape == (24, 2, 3) and solution.surface_means.shape == (6, 2, 3)
    for k in range(2):
        for c, rho in enumerate((0.1, 0.5, 0.8)):
            one = model.solve(ff, exitance=lights[:, k, c], reflectance=rho, tolerance=1e-12)
            np.testing.assert_allclose(solution.radiosity[:, k, c], one.radiosity, rtol=1e-9)
    scene = model.solve(ff, reflectance=0.5)
    assert scene.radiosity.shape == (24, 3)


def test_given_materials_are_those_of_the_scene() -> None:
    rng = np.random.default_rng(5)
    rho, e = rng.random(6) * 0.9, rng.random(6)
    model = cube(reflectance=rho, exitance=e)
    ff = model.form_factors()
    plain = model.solve(ff)
    given = model.solve(ff, reflectance=rho, exitance=e)
    np.testing.assert_array_equal(plain.radiosity, given.radiosity)
    np.testing.assert_array_equal(given.reflectance, rho)
    np.testing.assert_array_equal(given.exitance, e)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"exitance": np.ones(5)}, r"exitance: shape \(5,\), expected a number, \(6,\)"),
        ({"exitance": [1.0, np.inf, 1, 1, 1, 1]}, r"exitance: inf at \[1\] is not finite"),
        ({"exitance": -1.0}, "exitance: -1.0 of patch 0 is outside"),
        ({"reflectance": 2.0}, "reflectance: 2.0 of patch 0 is outside"),
        ({"exitance": np.ones((6, 2)), "reflectance": np.full((6, 3), 0.5)}, r"reflectance: shape \(6, 3\) does not go"),
        ({"tolerance": 2.0}, "tolerance: 2 is outside"),
        ({"start": "bright"}, 'start: "bright" is none of exitance, zero, ambient'),
        ({"sun": {"direction": [0, 0, 1]}}, "sun: `irradiance` is missing"),
        ({"sun": {"direction": [0, 0, 0], "irradiance": 1.0}}, "sun: direction"),
        ({"sun": {"direction": [0, 0, 1], "irradiance": 1.0, "colour": 3}}, "colour: there is no such setting"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    model = cube(exitance=1.0)
    with pytest.raises(rd.ArgumentError, match=message):
        model.solve(model.form_factors(), **arguments)  # type: ignore[arg-type]


def test_what_does_not_go_together_is_refused() -> None:
    model = cube(exitance=1.0)
    with pytest.raises(rd.ArgumentError, match="another model"):
        model.solve(cube().form_factors())
    with pytest.raises(rd.SolverError, match="magic"):
        model.solve(solver="magic")
    with pytest.raises(rd.SolverError, match="omega"):
        model.solve(solver="jacobi", omega=1.5)
    with pytest.raises(rd.SolverError, match="no finite solution"):
        cube(reflectance=1.0, exitance=1.0).solve()


def test_solvers_agree() -> None:
    model = cube(subdivide=3, reflectance=0.7, exitance={"ceiling": 1.0, "*": 0.0})
    ff = model.form_factors()
    expected = model.solve(ff, solver="direct").radiosity
    for solver in ("pcg", "gmres", "jacobi", "gauss-seidel", "multigrid"):
        found = model.solve(ff, solver=solver, tolerance=1e-12)
        assert found.solver == solver
        np.testing.assert_allclose(found.radiosity, expected, rtol=1e-9)


def test_one_that_gives_up_warns() -> None:
    model = cube(subdivide=2, reflectance=0.99, exitance={"ceiling": 1.0, "*": 0.0})
    with pytest.warns(rd.RadiosityWarning, match="max_passes|passes"):
        solution = model.solve(solver="jacobi", max_passes=2)
    assert solution.stop_reason == "max_passes" and solution.warnings


def test_sunlight() -> None:
    ground = squares(distance=1.0, reflectance=0.0, subdivide=4)
    solution = ground.solve(sun={"direction": [0.0, 1.0, 1.0], "irradiance": 1000.0})
    sunlit = solution.sunlit
    assert sunlit is not None
    lower = ground.patch_surface == 0
    # The upper square is as high as it is long: at 45 degrees its shadow lies beside the lower one.
    np.testing.assert_allclose(sunlit["fraction"][lower], 1.0, atol=1e-9)
    np.testing.assert_allclose(solution.irradiance[lower], 1000.0 / np.sqrt(2.0), rtol=1e-9)
    np.testing.assert_allclose(solution.irradiance[~lower], 0.0, atol=1e-9)
    sun = {"latitude": 50.0, "longitude": 10.0, "time": "2026-06-21T12:00:00+02:00", "irradiance": [3.0, 2.0, 1.0]}
    coloured = ground.solve(sun=sun)
    assert coloured.irradiance.shape == (32, 3)
    assert (coloured.irradiance[:, 0] >= coloured.irradiance[:, 2]).all()


def test_light_of_the_sky() -> None:
    # Of a plate that sees nothing but the sky all of its light arrives; a second one 1 m above hides its own share.
    ground = squares(distance=1.0, reflectance=0.0, subdivide=4)
    ff = ground.form_factors()
    solution = ground.solve(ff, sky=100.0)
    lower, upper = ground.patch_surface == 0, ground.patch_surface == 1
    mean = float(np.average(solution.irradiance[lower], weights=ground.patch_area[lower]))
    assert mean == pytest.approx(100.0 * (1.0 - ff.surface[0, 1]), rel=1e-3)
    np.testing.assert_allclose(solution.irradiance[upper], 0.0, atol=1e-9)
    assert solution.sunlit is None
    sun = {"direction": [0.0, 1.0, 1.0], "irradiance": 1000.0}
    both, alone = ground.solve(ff, sky=100.0, sun=sun), ground.solve(ff, sun=sun)
    np.testing.assert_allclose(both.irradiance, solution.irradiance + alone.irradiance, rtol=1e-12)
    white = squares(distance=1.0, reflectance=0.8, subdivide=4)
    lit = white.solve(sky=100.0)
    assert (lit.radiosity[white.patch_surface == 1] > 1.0).all(), "the ground lights what is above it"
    image = white.render(lit, width=16, height=16, eye=[0.5, -2.0, 0.5], look_at=[0.5, 0.5, 0.5])
    assert image.radiance.max() > 0.0
    with pytest.raises(rd.ArgumentError, match="sun, sky"):
        white.solve(exitance=1.0, sky=100.0)
    with pytest.raises(rd.ArgumentError, match="sky"):
        white.solve(sky=-1.0)


@pytest.mark.filterwarnings("ignore:.*no face sees another")
def test_sunlight_is_pictured() -> None:
    # Straight down on the lower square, half of it in the shadow of an upper one that is half a square aside.
    ground = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    roof = [[x + 0.5, y, 1.0] for x, y, _ in ground]
    model = rd.Model(ground + roof, [[0, 1, 2, 3], [4, 5, 6, 7]], surfaces=["ground", "roof"], reflectance=0.5, subdivide=2)
    solution = model.solve(sun={"direction": [0.0, 0.0, 1.0], "irradiance": 1000.0}, sky=50.0)
    camera = {"width": 32, "height": 32, "eye": [0.5, 0.5, 0.9], "look_at": [0.5, 0.5, 0.0], "up": [0.0, 1.0, 0.0], "fov": 50.0}
    for direct in ["exact", "polygons"]:
        image = model.render(solution, direct=direct, **camera)
        direct_light, place = image["direct"], image["P"]
        on_ground = (place[..., 2] < 1e-3) & (image["patch"] < 4)
        lit = on_ground & (place[..., 0] < 0.49)
        dark = on_ground & (place[..., 0] > 0.51)
        assert lit.sum() > 100 and dark.sum() > 100
        np.testing.assert_allclose(direct_light[lit], 1000.0, rtol=1e-4)
        np.testing.assert_allclose(direct_light[dark], 0.0, atol=1e-3)


@pytest.mark.parametrize("ending", ["csv", "npz", "vtu", "ply", "obj"])
def test_files(tmp_path: Path, ending: str) -> None:
    model = cube(subdivide=2, exitance={"ceiling": 1.0, "*": 0.0})
    solution = model.solve()
    path = tmp_path / f"B.{ending}"
    solution.save(path)
    if ending == "npz":
        with np.load(path) as archive:
            np.testing.assert_array_equal(archive["radiosity"][:, 0], solution.radiosity)
            assert archive["area"].shape == (24,)
    if ending in ("ply", "obj"):
        assert rd.Model.read(path).n_patches == 24
    if ending == "csv":
        header = [line for line in path.read_text().splitlines() if not line.startswith("#")][0]
        columns = "radiosity_grey,irradiance_grey,error_grey,sky_factor,sky_factor_error"
        assert columns in header


def test_tables_name_channels(tmp_path: Path) -> None:
    model = cube(exitance=1.0)

    def header(exitance: np.ndarray) -> list[str]:  # type: ignore[type-arg]
        path = tmp_path / "B.csv"
        model.solve(exitance=exitance).save(path)
        rows = [line for line in path.read_text().splitlines() if not line.startswith("#")]
        assert len(rows[0].split(",")) == len(rows[1].split(","))
        return [name for name in rows[0].split(",") if name.startswith("radiosity")]

    assert header(np.ones((6, 3))) == ["radiosity_R", "radiosity_G", "radiosity_B"]
    assert header(np.ones((6, 2))) == ["radiosity_0", "radiosity_1"]
    assert len(header(np.ones((6, 5)))) == 5
