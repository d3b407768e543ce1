"""A thermal network from the factors between surfaces, beside the same scene patch by patch.

    python thermal_network.py

A furnace: a hot floor, a cold ceiling, and walls that let no heat through. With q = B - H and H = F B between
surfaces, a wall has B = H, and a surface of temperature T has B = e sigma T^4 + (1 - e) H.
"""

from __future__ import annotations

import numpy as np

import radiosity as rd

SIGMA = 5.670374419e-8


def furnace() -> rd.Model:
    """Returns a box of 2 m x 2 m x 1 m that faces inwards, each side cut into 4 x 4 patches."""
    x, y, z = 2.0, 2.0, 1.0
    vertices = [[a, b, c] for c in (0.0, z) for a, b in ((0.0, 0.0), (x, 0.0), (x, y), (0.0, y))]
    faces = [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
    names = ["floor", "ceiling", "wall", "wall", "wall", "wall"]
    return rd.Model(vertices, faces, surfaces=names, subdivide=4)


def network(model: rd.Model, ff: rd.FormFactors) -> dict[str, float]:
    """Returns the net heat of each surface, W, and the temperature of the walls, K, from one node for each surface."""
    emissivity = {"floor": 0.8, "ceiling": 0.6, "wall": 1.0}
    temperature = {"floor": 1000.0, "ceiling": 400.0}
    n = len(model.surfaces)
    system, right = np.eye(n), np.zeros(n)
    for i, name in enumerate(model.surfaces):
        if name in temperature:
            e = emissivity[name]
            system[i] -= (1.0 - e) * ff.surface[i]
            right[i] = e * SIGMA * temperature[name] ** 4
        else:
            system[i] -= ff.surface[i]
    radiosity = np.linalg.solve(system, right)
    heat = model.surface_area * (radiosity - ff.surface @ radiosity)
    found = {f"net_heat_w of {name}": float(heat[i]) for i, name in enumerate(model.surfaces)}
    wall = model.surfaces.index("wall")
    found["temperature_k of wall"] = float((radiosity[wall] / SIGMA) ** 0.25)
    return found


def by_patches(model: rd.Model, ff: rd.FormFactors) -> dict[str, float]:
    """Returns the same from the temperatures and fluxes of all patches."""
    boundary = {
        "surface": {
            "floor": {"emissivity": 0.8, "temperature_k": 1000.0},
            "ceiling": {"emissivity": 0.6, "temperature_k": 400.0},
            "wall": {"emissivity": 1.0, "adiabatic": True},
        }
    }
    heat = model.heat(boundary, ff)
    found = {f"net_heat_w of {own['name']}": float(own["net_heat_w"]) for own in heat.surfaces}
    wall = model.surfaces.index("wall")
    found["temperature_k of wall"] = float(heat.surfaces[wall]["temperature_k"])
    return found


def main() -> None:
    """Prints both beside each other."""
    model = furnace()
    ff = model.form_factors()
    print("factors from row to column")
    for name, row, error in zip(model.surfaces, ff.surface, ff.surface_error):
        print(f"{name:10}", " ".join(f"{value:9.6f}" for value in row), f"+- {error.max():.0e}")
    nodes, patches = network(model, ff), by_patches(model, ff)
    print(f"{'':26}{'3 nodes':>14}{'patches':>14}")
    for key in nodes:
        print(f"{key:26}{nodes[key]:14.2f}{patches[key]:14.2f}")


if __name__ == "__main__":
    main()
