"""Error against time of three form-factor methods, with a plot by matplotlib.

    python methods.py [SCENE] [--plot OUT.png]

The scene is a room with a box in it by default. The reference is the exact method, whose own error is far below.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, Optional

import numpy as np

import radiosity as rd

#: Methods with a setting that makes them finer, and its values.
METHODS: dict[str, tuple[str, list[int]]] = {
    "sr": ("rays", [64, 256, 1024, 4096]),
    "hemicube": ("resolution", [16, 32, 64, 128]),
    "gauss-lambert": ("points", [1, 2, 4]),
}


def room_with_box() -> rd.Model:
    """Returns a room of 3 m x 3 m x 2.5 m with a block of 1 m in it."""

    def cuboid(low: list[float], high: list[float], inwards: bool) -> tuple[list[list[float]], list[list[int]]]:
        corners = [[x, y, z] for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
        sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [1, 5, 7, 3], [3, 7, 6, 2], [2, 6, 4, 0]]
        return corners, sides if inwards else [side[::-1] for side in sides]

    room, walls = cuboid([0.0, 0.0, 0.0], [3.0, 3.0, 2.5], inwards=True)
    block, sides = cuboid([1.0, 1.0, 0.5], [2.0, 2.0, 1.5], inwards=False)
    faces = walls + [[8 + corner for corner in side] for side in sides]
    names = ["floor", "ceiling", "wall", "wall", "wall", "wall"] + ["block"] * 6
    return rd.Model(room + block, faces, surfaces=names, subdivide=3)


def measured(model: rd.Model) -> dict[str, list[tuple[float, float]]]:
    """Returns seconds and root mean square errors of F by method."""
    reference = model.form_factors().toarray()
    found: dict[str, list[tuple[float, float]]] = {}
    for method, (setting, values) in METHODS.items():
        for value in values:
            settings: Any = {setting: value}
            begun = time.perf_counter()
            ff = model.form_factors(method, balance="off", **settings)
            seconds = time.perf_counter() - begun
            error = float(np.sqrt(np.mean((ff.toarray() - reference) ** 2)))
            found.setdefault(method, []).append((seconds, error))
            print(f"{method:14} {setting} = {value:<6} {seconds:8.3f} s   error {error:.1e}")
    return found


def plot(found: dict[str, list[tuple[float, float]]], path: str) -> None:
    """Draws errors over times."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 4))
    for method, points in found.items():
        axes.loglog(*zip(*points), marker="o", label=method)
    axes.set_xlabel("time, s")
    axes.set_ylabel("root mean square error of F")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path)


def main(arguments: Optional[list[str]] = None) -> None:
    """Prints, and plots where that is wanted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?")
    parser.add_argument("--plot", metavar="OUT.png")
    args = parser.parse_args(arguments)
    model = rd.Model.read(args.scene) if args.scene else room_with_box()
    found = measured(model)
    if args.plot:
        plot(found, args.plot)
        print(f"wrote {args.plot}")


if __name__ == "__main__":
    main()
