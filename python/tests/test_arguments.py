"""Arguments of wrong types and values: each is refused by name, in one line."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CUBE, INWARDS, cube

import radiosity as rd

NAN = float("nan")


def heat(model: rd.Model, **settings: Any) -> object:
    return model.heat({"surface": {"*": {"temperature_k": 300.0, "emissivity": 0.5}}}, **settings)


CALLS: list[tuple[str, Callable[[rd.Model], object]]] = [
    ("vertices", lambda m: rd.Model(["a"], INWARDS)),
    ("faces", lambda m: rd.Model(CUBE, 1.0)),
    ("flip", lambda m: rd.Model(CUBE, INWARDS, flip=1.5)),  # type: ignore[arg-type]
    ("crease_angle", lambda m: cube(crease_angle=NAN)),
    ("crease_angle", lambda m: cube(crease_angle=-1.0)),
    ("unit", lambda m: cube(unit=np.full((9, 9), 0.5))),
    ("path", lambda m: rd.Model.read(3)),  # type: ignore[arg-type]
    ("materials", lambda m: rd.Model.read("scene.obj", materials=[1])),  # type: ignore[arg-type]
    ("name", lambda m: rd.Model.builtin(3)),  # type: ignore[arg-type]
    ("level", lambda m: rd.Model.builtin("cube", level=-1)),
    ("time_limit", lambda m: m.form_factors(time_limit=1e30)),
    ("scratch", lambda m: m.form_factors(scratch=1)),  # type: ignore[arg-type]
    ("form_factors", lambda m: m.solve("F.npz")),  # type: ignore[arg-type]
    ("form_factors", lambda m: heat(m, form_factors=3)),
    ("exitance", lambda m: m.solve(exitance=np.ones(6, dtype=complex))),
    ("exitance", lambda m: m.solve(exitance="3")),
    ("sun", lambda m: m.solve(sun="noon")),  # type: ignore[arg-type]
    ("sky", lambda m: m.along_sun_path([[0.0, 0.0, 0.0, 1.0, 1.0]], sky=1j)),  # type: ignore[arg-type]
    ("north", lambda m: m.along_sun_path([[0.0, 0.0, 0.0, 1.0, 1.0]], north=1.0)),  # type: ignore[arg-type]
    ("sun", lambda m: m.solve(sun={"direction": (0, 0, 1), "irradiance": NAN})),
    ("sky", lambda m: m.solve(sky=NAN)),
    ("sky", lambda m: heat(m, sky=NAN)),
    ("boundary", lambda m: m.heat(3)),  # type: ignore[arg-type]
    ("by", lambda m: m.exchange_factors({}, by=np.ones(2))),  # type: ignore[arg-type]
    ("solution", lambda m: m.render(m)),  # type: ignore[arg-type]
    ("noise", lambda m: m.render(m.solve(), noise=NAN)),
    ("noise", lambda m: m.render(m.solve(), noise=-1.0)),
    ("surface", lambda m: m.field(np.ones(2))),  # type: ignore[arg-type]
    ("frames", lambda m: m.render_frames(3, "a.exr")),  # type: ignore[arg-type]
    ("person", lambda m: m.points([[0.5, 0.5, 0.5]], person="yes")),  # type: ignore[arg-type]
    ("heat", lambda m: m.points([[0.5, 0.5, 0.5]], heat=3)),  # type: ignore[arg-type]
    ("model", lambda m: rd.load("F.npz", 3)),  # type: ignore[arg-type]
    ("path", lambda m: m.form_factors().save(3)),  # type: ignore[arg-type]
    ("path", lambda m: rd.verify(3)),  # type: ignore[arg-type]
    ("n", lambda m: rd.set_threads("all")),  # type: ignore[arg-type]
    ("n", lambda m: rd.set_threads(0)),
    ("mesh", lambda m: rd.from_trimesh(3)),
    ("mesh", lambda m: rd.from_trimesh({"a": 3})),
    ("mesh", lambda m: rd.from_pyvista("box.vtp")),
    ("mesh", lambda m: rd.from_meshio(None)),
]


@pytest.mark.parametrize(("name", "call"), CALLS)
def test_a_wrong_argument_is_refused_by_its_name(name: str, call: Callable[[rd.Model], object]) -> None:
    model = cube(exitance=1.0)
    with pytest.raises(rd.ArgumentError) as refused:
        call(model)
    message = str(refused.value)
    assert message.startswith(f"{name}: "), message
    assert "\n" not in message and len(message) < 200


def test_one_surface_is_reversed_by_its_name() -> None:
    with pytest.warns(rd.RadiosityWarning, match="normal is probably inverted"):
        turned = cube(flip="floor")
    assert np.array_equal(turned.patch_normal[0], -cube().patch_normal[0])
    with pytest.raises(rd.SceneError, match="no surface `roof`"):
        cube(flip="roof")


def test_a_pyvista_surface_may_have_strips_and_come_from_a_grid() -> None:
    pyvista = pytest.importorskip("pyvista")
    box = pyvista.Box()
    strips = box.triangulate().strip()
    assert strips.n_strips > 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The outside of a box sees nothing.
        warnings.simplefilter("ignore", rd.RadiosityWarning)
        model = rd.from_pyvista(strips)
        assert len(model.surfaces) == 6
        assert model.n_patches == 12
        assert rd.from_pyvista(box.extract_cells(range(6))).n_patches == 6


def test_a_file_name_may_be_bytes(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rd.RadiosityWarning)
        assert rd.Model.read(bytes(tmp_path / "cube.obj")).n_patches == 1  # type: ignore[arg-type]


def test_light_beyond_the_range_of_numbers_is_refused() -> None:
    for brightest in (1.7e308, 2e300):
        with pytest.raises(rd.SolverError, match="range of numbers"):
            cube().solve(exitance=np.array([0.0, brightest, 0.0, 0.0, 0.0, 0.0]))
