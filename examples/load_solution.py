#!/usr/bin/env python3
"""Load solutions that `radiosity solve SCENE -o B.vtu` wrote, with meshio, and check that they are whole.

    python3 examples/load_solution.py B.vtu [more.vtu ...]

Radiosity, irradiance, exitance, residual and error are in W/m², one column for each channel. Needs meshio and numpy.
"""

import sys

import meshio
import numpy as np

NAMES = ["surface", "area_m2", "radiosity", "irradiance", "exitance", "reflectance", "residual", "error", "row_sum"]


def load(path):
    """Returns corner positions [n, 3], patches as a list of (kind, corner numbers), and every cell array over all patches."""
    mesh = meshio.read(path)
    cells = [(block.type, block.data) for block in mesh.cells]
    arrays = {name: np.concatenate(blocks) for name, blocks in mesh.cell_data.items()}
    return mesh.points, cells, arrays


def areas(points, cells):
    """Returns the area of every patch, from its corners: half the cross product of a quad's diagonals, or of a triangle's sides."""
    all_areas = []
    for kind, corners in cells:
        p = points[corners]
        a, b = (p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]) if kind == "quad" else (p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        all_areas.append(0.5 * np.linalg.norm(np.cross(a, b), axis=1))
    return np.concatenate(all_areas)


def main():
    for path in sys.argv[1:]:
        points, cells, arrays = load(path)
        missing = [name for name in NAMES if name not in arrays]
        assert not missing, f"{path} lacks {missing}"
        columns = {name: array.reshape(len(array), -1) for name, array in arrays.items()}
        assert np.allclose(areas(points, cells), arrays["area_m2"], rtol=1e-9)
        # The residual is what its definition says: r = E - B + rho H.
        follows = columns["exitance"] - columns["radiosity"] + columns["reflectance"] * columns["irradiance"]
        assert np.allclose(follows, columns["residual"], atol=1e-12)
        assert (columns["error"] >= 0).all() and (columns["row_sum"] < 1 + 1e-3).all()
        power = (arrays["area_m2"][:, None] * columns["radiosity"]).sum(axis=0)
        worst = columns["error"].max()
        print(f"{path}: {len(arrays['surface'])} patches, power {power} W, greatest error of a radiosity {worst:.1e} W/m2")


if __name__ == "__main__":
    main()
