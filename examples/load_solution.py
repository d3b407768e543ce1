#!/usr/bin/env python3
"""Load solutions that `radiosity solve SCENE -o B.vtu` wrote, with VTK's own reader, and check that they are whole.

    python3 examples/load_solution.py B.vtu [more.vtu ...]

Radiosity, irradiance, exitance, residual and error are in W/m², one column for each channel. Needs vtk and numpy.
"""

import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

NAMES = ["surface", "area_m2", "radiosity", "irradiance", "exitance", "reflectance", "residual", "error", "row_sum"]


def load(path):
    """Returns the grid and every cell array over all patches."""
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    data = grid.GetCellData()
    arrays = {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}
    return grid, arrays


def areas(grid):
    """Returns the area of every patch, from its corners: half the cross product of a quad's diagonals, or of a triangle's sides."""
    points = vtk_to_numpy(grid.GetPoints().GetData())
    found = []
    for k in range(grid.GetNumberOfCells()):
        ids = grid.GetCell(k).GetPointIds()
        p = points[[ids.GetId(i) for i in range(ids.GetNumberOfIds())]]
        a, b = (p[2] - p[0], p[3] - p[1]) if len(p) == 4 else (p[1] - p[0], p[2] - p[0])
        found.append(0.5 * np.linalg.norm(np.cross(a, b)))
    return np.array(found)


def main():
    for path in sys.argv[1:]:
        grid, arrays = load(path)
        missing = [name for name in NAMES if name not in arrays]
        assert not missing, f"{path} lacks {missing}"
        columns = {name: array.reshape(len(array), -1) for name, array in arrays.items()}
        assert np.allclose(areas(grid), arrays["area_m2"], rtol=1e-9)
        # The residual is what its definition says: r = E - B + rho H.
        follows = columns["exitance"] - columns["radiosity"] + columns["reflectance"] * columns["irradiance"]
        assert np.allclose(follows, columns["residual"], atol=1e-12)
        assert (columns["error"] >= 0).all() and (columns["row_sum"] < 1 + 1e-3).all()
        power = (arrays["area_m2"][:, None] * columns["radiosity"]).sum(axis=0)
        worst = columns["error"].max()
        print(f"{path}: {len(arrays['surface'])} patches, power {power} W, greatest error of a radiosity {worst:.1e} W/m2")


if __name__ == "__main__":
    main()
