"""The package as a whole: documentation, types, examples."""

from __future__ import annotations

import doctest
import inspect
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import radiosity as rd

ROOT = Path(__file__).resolve().parents[1]
PUBLIC = [getattr(rd, name) for name in rd.__all__ if not name.startswith("_")]


def members(of: object) -> list[tuple[str, object]]:
    """Public methods and properties of a class of the package."""
    if not inspect.isclass(of) or issubclass(of, (Exception, Warning)):
        return []
    return [(name, own) for name, own in vars(of).items() if not name.startswith("_")]


@pytest.mark.parametrize("item", PUBLIC, ids=lambda item: item.__name__)
def test_all_is_documented(item: object) -> None:
    assert inspect.getdoc(item)
    for name, own in members(item):
        text = inspect.getdoc(own)
        assert text, f"{item}.{name}"
        function = own.__func__ if isinstance(own, classmethod) else own
        if inspect.isfunction(function):
            taken = [p for p in inspect.signature(function).parameters if p not in ("self", "cls")]
            if taken:
                assert "Parameters\n----------" in text or len(taken) == 1, f"{item}.{name}"
                section = text.partition("Parameters\n----------")[2]
                for parameter in taken:
                    if section:
                        assert re.search(rf"(^|\n|, )(\*\*)?{parameter}\b", section), f"{item}.{name}: {parameter}"


def test_a_row_is_said_to_be_from_i_to_j() -> None:
    said = [rd.FormFactors, rd.ExchangeFactors, rd.Model.form_factors, rd.load, rd.FormFactors.save]
    said += [getattr(rd.FormFactors, name) for name in ("surface", "surface_error", "matrix", "toarray", "tocsr", "aslinearoperator", "__matmul__")]
    for item in said:
        text = inspect.getdoc(item) or ""
        assert re.search(r"from (patch |surface )?i to (patch |surface )?j", text), item


def test_the_examples_of_the_docs_hold() -> None:
    assert doctest.testmod(rd).failed == 0


def test_types_hold() -> None:
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy", "--strict", "--ignore-missing-imports", "radiosity", "examples"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize(
    ("name", "needs", "expected"),
    [
        ("view_factors", ["trimesh"], r"known to be 1"),
        ("thermal_network", [], r"temperature_k of wall +\d+"),
        ("methods", [], r"hemicube +resolution = 128"),
    ],
)
@pytest.mark.filterwarnings("ignore::radiosity.RadiosityWarning")
def test_examples_run(
    name: str, needs: list[str], expected: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in needs:
        pytest.importorskip(package)
    monkeypatch.setattr(sys, "argv", [name])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    assert re.search(expected, capsys.readouterr().out)


@pytest.mark.filterwarnings("ignore::radiosity.RadiosityWarning")
def test_the_plots_of_the_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    path = tmp_path / "methods.png"
    monkeypatch.setattr(sys, "argv", ["methods", "--plot", str(path)])
    runpy.run_path(str(ROOT / "examples" / "methods.py"), run_name="__main__")
    assert path.stat().st_size > 1000


def test_the_plot_of_a_mesh(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    pytest.importorskip("pyvista")
    path = tmp_path / "view.png"
    # In a process of its own: without a screen VTK may end it.
    command = [sys.executable, str(ROOT / "examples" / "view_factors.py"), "--plot", str(path)]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode != 0 and not path.exists() and "known to be 1" in run.stdout:
        pytest.skip("VTK cannot draw here")
    assert run.returncode == 0, run.stderr
    assert path.stat().st_size > 1000
