"""Scenes of the tests."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import radiosity as rd

CUBE = [[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)]
INWARDS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [1, 5, 7, 3], [3, 7, 6, 2], [2, 6, 4, 0]]
SIDES = ["floor", "ceiling", "south", "east", "north", "west"]


def cube(turn: float = 0.0, move: float = 0.0, **settings: Any) -> rd.Model:
    """A unit cube that faces inwards, turned and moved."""
    c, s = np.cos(turn), np.sin(turn)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    vertices = np.array(CUBE) @ (about_x @ about_z).T + move
    return rd.Model(vertices, INWARDS, surfaces=SIDES, **settings)


def squares(distance: float = 1.0, **settings: Any) -> rd.Model:
    """Two unit squares that face each other."""
    lower = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    upper = [[x, y, distance] for x, y, _ in lower]
    return rd.Model(lower + upper, [[0, 1, 2, 3], [4, 7, 6, 5]], surfaces=["lower", "upper"], **settings)


@pytest.fixture(autouse=True)
def no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bars belong to terminals."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: False, raising=False)
