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


def test_a_field_is_the_form_factor_of_each_point() -> None:
    model = cube()
    image = model.field("ceiling", **CAMERA, samples=1)
    assert image.surfaces is not None
    means = {surface["name"]: surface["form_factor"] for surface in image.surfaces}
    # The camera sees some of each wall: means are those of the points that it sees.
    assert means["ceiling"] == 0.0 and 0.0 < means["north"] < 0.5
    # From a point of the floor at (x, y) straight below the middle: 4 times the corner of a square of half the side.
    below = model.field("ceiling", eye=[0.5, 0.5, 0.9], look_at=[0.5, 0.5, 0.0], fov=0.01, width=1, samples=1)
    a = 0.5 / np.sqrt(1.25)
    corner = 2.0 * a * np.arctan(a) / (2.0 * np.pi)
    assert below.surfaces is not None
    floor = next(surface for surface in below.surfaces if surface["name"] == "floor")
    assert floor["form_factor"] == pytest.approx(4.0 * corner, abs=1e-6)
    by_rays = model.field("ceiling", **CAMERA, samples=1, method="sr", rays=1024, seed=7)
    assert by_rays.surfaces is not None
    for surface in by_rays.surfaces:
        if surface["form_factor"] is not None:
            assert surface["form_factor"] == pytest.approx(means[surface["name"]], abs=0.01)


def test_wrong_fields_are_named() -> None:
    model = cube()
    for arguments, message in [
        ({"surface": "roof"}, "surface: there is no 'roof'"),
        ({"surface": "floor", "method": "magic"}, 'method: "magic" is none of exact, sr, qmc'),
        ({"surface": "floor", "rays": 9}, "rays"),
        ({"surface": "floor", "method": "sr", "rays": 70000}, "65536"),
    ]:
        with pytest.raises(rd.ArgumentError, match=message):
            model.field(**arguments)  # type: ignore[arg-type]


def test_a_sequence_is_written_frame_by_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model = cube(subdivide=2, reflectance=0.5, exitance=1.0)
    (tmp_path / "dim.toml").write_text('[surface."*"]\nexitance = 0.5\n')
    frames = [
        {"name": "day"},
        {"name": "dim", "lighting": tmp_path / "dim.toml"},
        {"name": "open", "move": [{"surface": "ceiling", "translate": [0.0, 0.0, 0.5]}]},
    ]
    found = model.render_frames(frames, "B.exr", **CAMERA, form_factors={"tolerance": 1e-4}, solver="jacobi")
    assert [frame["name"] for frame in found["frames"]] == ["day", "dim", "open"]
    for frame in found["frames"]:
        assert Path(frame["image"]).stat().st_size > 100 and Path(frame["preview"]).stat().st_size > 100
    means = [[surface["radiosity"][0] for surface in frame["surfaces"]] for frame in found["frames"]]
    np.testing.assert_allclose(means[0], 2.0, rtol=1e-5)
    np.testing.assert_allclose(means[1], 1.0, rtol=1e-5)
    assert max(means[2]) < 2.0
    assert len(found["poses"]) == 2
    # A file says the same.
    (tmp_path / "frames.toml").write_text('[[frame]]\nname = "day"\n')
    again = model.render_frames(tmp_path / "frames.toml", tmp_path / "C.exr", **CAMERA)
    np.testing.assert_allclose(again["frames"][0]["surfaces"][0]["radiosity"], 2.0, rtol=1e-5)
    with pytest.raises(rd.SceneError, match="frames:.*two frames are called"):
        model.render_frames([{"name": "a"}, {"name": "a"}], "B.exr")
    with pytest.raises(rd.ArgumentError, match="output"):
        model.render_frames(frames, "B.png")


def test_built_in_scenes_and_their_verification(tmp_path: Path) -> None:
    model = rd.Model.builtin("cube", subdivide=2)
    assert model.n_patches == 24
    field = model.field(model.surfaces[0], camera="unfolded", width=8)
    field.save(tmp_path / "F.exr")
    assert rd.verify(tmp_path / "F.exr")["passed"] is True
    with pytest.raises(rd.SceneError, match="cornell-box"):
        rd.Model.builtin("nowhere")
    with pytest.raises(rd.RenderError, match="none.exr"):
        rd.verify(tmp_path / "none.exr")
