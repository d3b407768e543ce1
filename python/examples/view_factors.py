"""View factors of a trimesh mesh: a sphere in a box, with a plot by PyVista.

    python view_factors.py [--plot OUT.png]

Everything that leaves the sphere reaches the box, so that by reciprocity F(box -> sphere) = A_sphere / A_box.
Needs trimesh; the plot needs pyvista.
"""

from __future__ import annotations

import argparse
from typing import Optional

import trimesh

import radiosity as rd


def sphere_in_box() -> rd.Model:
    """Returns a faceted sphere of radius 0.5 in a box of 2 m that faces inwards."""
    box = trimesh.creation.box(extents=[2.0, 2.0, 2.0])
    box.invert()
    sphere = trimesh.creation.icosphere(subdivisions=1, radius=0.5)
    return rd.from_trimesh({"box": box, "sphere": sphere})


def plot(model: rd.Model, ff: rd.FormFactors, path: str) -> None:
    """Draws the form factor from each patch of the box to the sphere."""
    import pyvista

    sphere = model.patch_surface == model.surfaces.index("sphere")
    to_sphere = ff @ sphere.astype(float)
    mesh = model.to_pyvista(to_sphere=to_sphere)
    plotter = pyvista.Plotter(off_screen=True, window_size=[640, 480])
    plotter.add_mesh(mesh, scalars="to_sphere", show_edges=True, culling="back")
    plotter.screenshot(path)
    plotter.close()


def main(arguments: Optional[list[str]] = None) -> None:
    """Prints the factors between box and sphere beside the known ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", metavar="OUT.png")
    args = parser.parse_args(arguments)
    model = sphere_in_box()
    ff = model.form_factors(tolerance=1e-4)
    box, sphere = model.surfaces.index("box"), model.surfaces.index("sphere")
    expected = model.surface_area[sphere] / model.surface_area[box]
    found, error = ff.surface[box, sphere], ff.surface_error[box, sphere]
    print(f"{model.n_patches} patches")
    print(f"F(box -> sphere) = {found:.9f} +- {error:.1e}, A_sphere / A_box = {expected:.9f}, off by {abs(found - expected):.1e}")
    print(f"F(sphere -> box) = {ff.surface[sphere, box]:.9f} +- {ff.surface_error[sphere, box]:.1e}, known to be 1")
    if args.plot:
        plot(model, ff, args.plot)
        print(f"wrote {args.plot}")


if __name__ == "__main__":
    main()
