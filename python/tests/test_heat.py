"""Temperatures, fluxes, exchange factors and free points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SIDES, cube, squares

import radiosity as rd

SIGMA = 5.670374419e-8


def conditions(**of_floor: Any) -> dict[str, Any]:
    return {
        "surface": {
            "*": {"emissivity": 0.7, "temperature_k": 300.0},
            "floor": {"emissivity": 0.9, **of_floor},
        }
    }


def test_one_temperature_has_no_flux() -> None:
    heat = cube(0.2, subdivide=2).heat(conditions(temperature_k=300.0))
    np.testing.assert_allclose(heat.temperature, 300.0, rtol=1e-12)
    assert (np.abs(heat.net_flux) <= heat.net_flux_error + 1e-9).all()
    assert abs(heat.balance["energy_balance_w"]) <= heat.balance["energy_balance_w_error"] + 1e-9


def test_a_supplied_floor_is_warmer() -> None:
    model = cube(subdivide=3)
    heat = model.heat(conditions(supplied_w_m2=100.0))
    floor = model.patch_surface == 0
    np.testing.assert_allclose(heat.net_flux[floor], 100.0, rtol=1e-6)
    assert heat.temperature[floor].min() > 300.0
    own = heat.surfaces[0]
    assert own["name"] == "floor" and own["net_heat_w"] == pytest.approx(100.0, rel=1e-6)
    # To rounding, what is supplied leaves by the other sides.
    total = sum(surface["net_heat_w"] for surface in heat.surfaces)
    assert abs(total) < 1e-2


def test_two_plates_in_closed_form() -> None:
    # Between black plates far wider than their distance q = sigma (T1^4 - T2^4); by factors for these.
    model = squares(distance=0.2, subdivide=2)
    ff = model.form_factors()
    boundary = {
        "surface": [
            {"name": "lower", "emissivity": 1.0, "temperature_k": 500.0},
            {"name": "upper", "emissivity": 1.0, "temperature_k": 400.0},
        ]
    }
    heat = model.heat(boundary, ff)
    expected = SIGMA * (500.0**4 - ff.surface[0, 1] * 400.0**4)
    assert heat.surfaces[0]["net_flux_w_m2"] == pytest.approx(expected, rel=1e-6)


def test_dicts_and_files_say_the_same(tmp_path: Path) -> None:
    model = cube(subdivide=2)
    ff = model.form_factors()
    path = tmp_path / "boundary.toml"
    path.write_text(
        '[surroundings]\ntemperature_k = 3\n[[surface]]\nname = "*"\nemissivity = 0.7\ntemperature_k = 300.0\n'
        '[[surface]]\nname = "floor"\nnode = "plate"\nemissivity = 0.9\n[[node]]\nname = "plate"\nsupplied_w = 40.0\n'
    )
    told = {
        "surroundings": {"temperature_k": 3},
        "surface": [
            {"name": "*", "emissivity": 0.7, "temperature_k": 300.0},
            {"name": "floor", "node": "plate", "emissivity": 0.9},
        ],
        "node": {"plate": {"supplied_w": 40.0}},
    }
    of_file, of_dict = model.heat(path, ff), model.heat(told, ff)
    assert set(of_file) == set(of_dict)
    for name in of_file:
        np.testing.assert_array_equal(of_file[name], of_dict[name])


@pytest.mark.parametrize("whole", [False, True])
def test_values_may_be_arrays_over_patches(whole: bool) -> None:
    model = cube(subdivide=2)
    ff = model.form_factors()
    floor = model.patch_surface == 0

    def spread(value: float) -> np.ndarray:  # type: ignore[type-arg]
        return np.full(24 if whole else 4, value)

    plain = model.heat(conditions(temperature_k=350.0), ff)
    same = model.heat(
        {"surface": {"*": {"emissivity": 0.7, "temperature_k": 300.0}, "floor": {"emissivity": spread(0.9), "temperature_k": spread(350.0)}}},
        ff,
    )
    for name in plain:
        np.testing.assert_allclose(same[name], plain[name], rtol=1e-12, atol=1e-300)
    assert same.surfaces[0]["emissivity"] == pytest.approx(0.9)
    rising = np.linspace(310.0, 340.0, 24) if whole else np.linspace(310.0, 340.0, 4)
    heat = model.heat(conditions(temperature_k=rising), ff)
    np.testing.assert_allclose(heat.temperature[floor], rising[floor] if whole else rising, rtol=1e-12)
    supplied = np.array([0.0, 10.0, 20.0, 30.0])
    flux = model.heat(conditions(supplied_w_m2=supplied), ff)
    np.testing.assert_allclose(flux.net_flux[floor], supplied, atol=1e-6)
    assert flux.surfaces[0]["net_heat_w"] == pytest.approx(15.0, rel=1e-6)


@pytest.mark.parametrize(
    ("boundary", "error", "message"),
    [
        (conditions(temperature_k=[300.0] * 5), rd.HeatError, "5 values, where the surface has 1 patch and the scene 6"),
        (conditions(temperature_k=[300.0, -5.0]), rd.SceneError, "temperature_k: -5.0 is negative"),
        (conditions(temperature_k=np.ones((2, 2))), rd.ArgumentError, r"boundary\['surface'\]\['floor'\]\['temperature_k'\]: shape"),
        (conditions(temperature_k=np.nan), rd.ArgumentError, "nan is not finite"),
        (conditions(), rd.SceneError, "2 conditions|no condition|floor"),
        ({"surface": 3}, rd.ArgumentError, r"boundary\['surface'\]: expected a list"),
        ({"air": 3}, rd.ArgumentError, r"boundary\['air'\]: expected a dict"),
        ({"surface": {"roof": {"emissivity": 0.5, "adiabatic": True}}}, rd.SceneError, "roof"),
        ({"surface": {"*": {"emissivity": 0.5, "adiabatic": True}}}, rd.HeatError, "temperature"),
        (
            {"surface": {"*": {"emissivity": 0.5, "adiabatic": True}, "floor": {"emissivity": 2.0}}},
            rd.SceneError,
            r"^boundary\['surface'\]\['floor'\]: surface `floor`: emissivity: 2",
        ),
        (
            {"surface": [{"name": "*", "emissivity": 0.5, "adiabatic": True}, {"name": "floor", "emisivity": 0.5}]},
            rd.SceneError,
            r"^boundary\['surface'\]\[1\]: unknown field `emisivity`",
        ),
        ({"sun": {"direction": [0, 0, 0], "irradiance_w_m2": 1}, "surface": {}}, rd.SceneError, r"^boundary\['sun'\]: "),
        ({"surface": {}}, rd.SceneError, "^boundary: no `surface`"),
        (
            {
                "sun": {"direction": [0, 0, 0], "irradiance_w_m2": 1},
                "surface": {"*": {"emissivity": 0.5, "adiabatic": True}},
            },
            rd.SceneError,
            r"^boundary\['sun'\]: sun.direction: ",
        ),
        ("/nowhere/boundary.toml", rd.SceneError, "nowhere"),
    ],
)
def test_wrong_conditions_are_named(boundary: Any, error: type[Exception], message: str) -> None:
    if boundary == conditions():
        # The pattern's temperature counts for the floor, too.
        assert cube(subdivide=2).heat(boundary).temperature[0] == 300.0
        return
    with pytest.raises(error, match=message):
        cube().heat(boundary)


def test_sun_and_sky() -> None:
    # The wall faces the plate and the sun.
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1]]
    faces = [[0, 1, 2, 3], [1, 0, 4, 5]]
    plate = rd.Model(vertices, faces, surfaces=["plate", "wall"], subdivide=2)
    boundary = {"surface": {"*": {"emissivity": 1.0, "absorptance": 0.5, "temperature_k": 300.0}}}
    sun = {"direction": [0, 1, 1], "irradiance": 800.0}
    heat = plate.heat(boundary, sun=sun, sky=100.0)
    absorbed = heat.surfaces[0]["absorbed_solar_w"]
    plane = 800.0 / np.sqrt(2.0) + 100.0
    # The wall hides a part of the sky and reflects onto the plate.
    assert 0.5 * plane * 0.9 < absorbed < 0.5 * plane * 1.2
    alone = plate.heat(boundary, sky=0.0, sun=sun)
    assert alone.surfaces[0]["sunlit_fraction"] == pytest.approx(1.0)
    with pytest.raises(rd.ArgumentError, match="one solar band"):
        plate.heat(boundary, sun={"direction": [0, 1, 1], "irradiance": [1, 2, 3]})


@pytest.mark.parametrize("by", ["surface", "patch"])
def test_exchange_factors(by: str) -> None:
    model = cube(subdivide=2)
    found = model.exchange_factors(conditions(temperature_k=1.0), by=by)
    m = (6 if by == "surface" else 24) + 1
    assert found.gebhart.shape == (m, m) and found.names[-1] == "surroundings"
    np.testing.assert_allclose(found.gebhart.sum(axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(found.conductance, found.conductance.T, atol=1e-9)
    np.testing.assert_allclose(found.script_f[0], found.emissivity[0] * found.gebhart[0])
    assert found.emissivity[0] == pytest.approx(0.9)


def test_points() -> None:
    model = cube(subdivide=2)
    views = model.points([[0.5, 0.5, 0.5], [0.2, 0.7, 0.4]])
    np.testing.assert_allclose(views.factors.sum(axis=1) + views["surroundings"], 1.0, atol=1e-9)
    np.testing.assert_allclose(views.factors[0], 1.0 / 6.0, atol=1e-9)
    assert views.status == ["free", "free"] and np.isnan(views.mean_radiant_temperature).all()
    up = model.points([[0.5, 0.5, 0.5]], normals=[[0.0, 0.0, 2.0]])
    ceiling = SIDES.index("ceiling")
    assert up.factors[0, ceiling] == up.factors[0].max() and up.factors[0, SIDES.index("floor")] == 0.0
    heat = model.heat(conditions(temperature_k=300.0))
    warm = model.points([[0.5, 0.5, 0.5]], heat=heat)
    assert warm.mean_radiant_temperature[0] == pytest.approx(300.0, rel=1e-4)
    assert warm.irradiance[0] == pytest.approx(SIGMA * 300.0**4, rel=1e-4)
    assert "mean_radiant_temperature_error" in warm


@pytest.mark.parametrize(
    ("xyz", "normals", "message"),
    [
        ([0, 0, 0], None, r"xyz: shape \(3,\)"),
        ([[0, 0, np.inf]], None, "xyz: inf"),
        ([[0, 0, 0]], [[0, 0, 0]], "normals: that of point 0 has no length"),
        ([[0, 0, 0]], [[0, 0, 1], [0, 0, 1]], r"normals: shape \(2, 3\), expected \(1, 3\)"),
    ],
)
def test_wrong_points_are_named(xyz: Any, normals: Any, message: str) -> None:
    with pytest.raises(rd.ArgumentError, match=message):
        cube().points(xyz, normals)


@pytest.mark.parametrize("ending", ["csv", "npz", "vtu", "ply", "obj"])
def test_files(tmp_path: Path, ending: str) -> None:
    heat = cube(subdivide=2).heat(conditions(temperature_k=310.0))
    path = tmp_path / f"T.{ending}"
    heat.save(path)
    if ending == "npz":
        with np.load(path) as archive:
            np.testing.assert_array_equal(archive["temperature_k"], heat.temperature)


def test_a_path_of_the_sun(tmp_path: Path) -> None:
    ground = squares(distance=1.0, reflectance=0.3, subdivide=2)
    ff = ground.form_factors()
    rows = [[0.0, 0, 1, 1, 1000.0], [1.5, 0, 0.2, 1, 800.0], [2.0, 0, 1, 1, 0.0]]
    light = ground.along_sun_path(rows, ff, sky=20.0)
    assert light["radiosity"].shape == (3, 8, 1) and light["reflectance"].shape == (8, 1)
    np.testing.assert_array_equal(light.times, [0.0, 1.5, 2.0])
    for k, (_, x, y, z, strength) in enumerate(rows[:2]):
        alone = ground.solve(ff, sun={"direction": [x, y, z], "irradiance": strength}, sky=20.0)
        np.testing.assert_allclose(light["radiosity"][k, :, 0], alone.radiosity, rtol=1e-5, atol=1e-6)
    assert [step["sun_irradiance_w_m2"] for step in light.document["steps"]] == [1000.0, 800.0, 0.0]
    boundary = {"surroundings": {"temperature_k": 250.0}, "surface": {"*": {"emissivity": 0.9, "adiabatic": True}}}
    table = tmp_path / "day.csv"
    lines = ["2026-06-21T12:00:00+02:00,47.4,8.5,900", "2026-06-21T23:00:00+02:00,47.4,8.5,0"]
    table.write_text("time,latitude,longitude,irradiance\n" + "\n".join(lines) + "\n")
    heat = ground.along_sun_path(table, ff, boundary=boundary)
    assert heat["temperature_k"].shape == (2, 8) and heat.times[1] == 11 * 3600.0
    assert (heat["temperature_k"][0] > heat["temperature_k"][1]).any()
    table.write_text("time,x,y,z,irradiance\n0,0,0,0,5\n")
    with pytest.raises(rd.FileError, match="day.csv:2"):
        ground.along_sun_path(table, ff)
    with pytest.raises(rd.ArgumentError, match="row 1: time"):
        ground.along_sun_path([rows[1], rows[0]], ff)
