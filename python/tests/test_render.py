"""Images of solutions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import cube

import radiosity as rd

CAMERA = {"eye": [0.5, 0.05, 0.5], "look_at": [0.5, 1.0, 0.5], "fov": 60.0, "width": 32, "height": 24}


def test_a_furnace_is_one_colour() -> None:
    model = cube(subdivide=2, reflectance=0.5, exitance=1.0)
    image = model.render(model.solve(), **CAMERA, direct="off")
    assert image.size == (32, 24)
    assert image.radiance.shape == (24, 32, 3) and image.radiance.dtype == np.float32
    # L = B / pi, B = 2.
    np.testing.assert_allclose(image.radiance, 2.0 / np.pi, rtol=1e-4)
    np.testing.assert_array_equal(np.asarray(image), image.radiance)
    assert {"irradiance", "radiosity", "albedo", "N", "P", "Z", "patch"} <= set(image)
    assert image["N"].shape == (24, 32, 3) and image["Z"].shape == (24, 32)
    assert image["patch"].dtype == np.uint32 and image["patch"].max() < model.n_patches
    np.testing.assert_allclose(image["albedo"], 0.5, rtol=1e-6)
    with pytest.raises(KeyError):
        image["nothing"]


def test_the_direct_pass_shows_the_lamp() -> None:
    model = cube(subdivide=4, exitance={"ceiling": 1.0, "*": 0.0})
    solution = model.solve()
    by_patches = model.render(solution, **CAMERA, flat=True)
    by_pixels = model.render(solution, **CAMERA, direct="exact")
    assert by_pixels.radiance.mean() == pytest.approx(by_patches.radiance.mean(), rel=0.05)


def test_own_materials_are_shown_patch_by_patch() -> None:
    model = cube(subdivide=2)
    solution = model.solve(exitance=np.arange(24.0), reflectance=0.0)
    image = model.render(solution, **CAMERA, samples=1)
    np.testing.assert_allclose(image.radiance[..., 0], image["patch"] / np.pi, rtol=1e-5)
    with pytest.raises(rd.ArgumentError, match="flat"):
        model.render(solution, flat=False)
    with pytest.raises(rd.ArgumentError, match="4 channels"):
        model.render(model.solve(exitance=np.ones((24, 4))))


def test_files(tmp_path: Path) -> None:
    model = cube(exitance=1.0)
    image = model.render(model.solve(), **CAMERA)
    for name in ("a.exr", "a.png"):
        image.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 100
    with pytest.raises(rd.ArgumentError, match=".exr or .png"):
        image.save(tmp_path / "a.jpg")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"eye": [0, 0]}, r"eye: shape \(2,\), expected \(3,\)"),
        ({"eye": [0.5, 0.5, 0.5], "look_at": [0.5, 0.5, 0.5]}, "look_at"),
        ({"direct": "magic"}, 'direct: "magic" is none of'),
        ({"direct": "rays", "flat": True}, "direct: not along with flat"),
        ({"width": 0}, "0"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    model = cube(exitance=1.0)
    with pytest.raises(rd.ArgumentError, match=message):
        model.render(model.solve(), **arguments)  # type: ignore[arg-type]


def test_an_image_of_nothing_warns() -> None:
    model = cube(exitance=1.0)
    solution = model.solve()
    with pytest.warns(rd.RadiosityWarning, match="no face|front"):
        model.render(solution, eye=[5.0, 5.0, 5.0], look_at=[9.0, 9.0, 9.0], width=8)
