"""Reads with meshio, PyVista, trimesh and SciPy what the program writes, and compares the numbers.

    python3 read_back.py PROGRAM SCENE

Needs meshio, pyvista, trimesh, numpy and scipy. A script and not a test, as the packages are large; the files' layouts themselves are tested.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np
import pyvista
import scipy.sparse
import trimesh


def texts(array):
    return bytes(np.asarray(array, np.uint8)).decode().rstrip("\0").split("\0")


def main():
    program, scene = (str(Path(name).resolve()) for name in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)

        def run(*arguments):
            subprocess.run([program, *map(str, arguments)], check=True, cwd=at, capture_output=True)

        for ending in ("npz", "vtu", "ply", "obj", "vf"):
            run("form-factors", scene, "--subdivide", 3, "-o", f"F.{ending}")
        for ending in ("csv", "vtu", "ply", "obj"):
            run("solve", scene, "--subdivide", 3, "-o", f"B.{ending}")
        factors = scipy.sparse.load_npz(at / "F.npz")
        sums = np.asarray(factors.sum(axis=1)).ravel()
        archive = np.load(at / "F.npz")
        assert json.loads(str(archive["meta"]))["n_patches"] == len(sums)
        with open(at / "B.csv", newline="") as lines:
            rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        channels = [name for name in rows[0] if name.startswith("radiosity")]
        radiosity = np.array([[float(row[name]) for name in channels] for row in rows])
        area = np.array([float(row["area_m2"]) for row in rows])
        names = list(dict.fromkeys(row["surface"] for row in rows))

        for name, reader in (("meshio", meshio.read), ("PyVista", pyvista.read)):
            for file in ("F.vtu", "B.vtu"):
                mesh = reader(at / file)
                if name == "meshio":
                    # Cells come back by kind: triangles, then quads.
                    data = {key: np.squeeze(np.concatenate(parts)) for key, parts in mesh.cell_data.items()}
                else:
                    data = dict(mesh.cell_data)
                found = texts(mesh.field_data["surface_name"])
                assert set(names) == set(found), (names, found)
                json.loads(texts(mesh.field_data["description"])[0])
                assert np.isclose(data["area_m2"].sum(), area.sum(), rtol=1e-12)
                assert np.isclose(data["sky_factor"].sum(), archive["sky_factor"].sum(), rtol=1e-9, atol=1e-12)
                if file == "F.vtu":
                    assert np.allclose(np.sort(data["row_sum"]), np.sort(sums), rtol=1e-12)
                else:
                    power = (data["area_m2"][:, None] * data["radiosity"].reshape(len(area), -1)).sum(axis=0)
                    assert np.allclose(power, (area[:, None] * radiosity).sum(axis=0), rtol=1e-12)
            print(f"{name} reads F.vtu and B.vtu of {len(area)} patches on {len(names)} surfaces")

        for file in ("F.ply", "F.obj", "B.ply", "B.obj"):
            one = meshio.read(at / file)
            assert sum(len(block.data) for block in one.cells) == len(area), file
            two = trimesh.load(at / file, process=False, force="mesh")
            assert np.isclose(two.area, area.sum(), rtol=1e-6), file
            assert two.visual.kind == "vertex" and len(two.visual.vertex_colors) == len(two.vertices), file
            three = pyvista.read(at / file)
            assert three.n_cells == len(area), file
            print(f"meshio, trimesh and PyVista read {file}")

        with open(at / "F.vf") as lines:
            head, areas, *matrix, emissivities = lines.read().splitlines()
        program_name, version, kind, _, _, count = head.split()
        assert (program_name, version, kind, int(count)) == ("View3D", "3.3", "0", len(names))
        matrix = np.array([line.split() for line in matrix], float)
        assert matrix.shape == (len(names), len(names)) and len(areas.split()) == len(emissivities.split()) == len(names)
        print(f"F.vf has {len(names)} surfaces, rows sum to {matrix.sum(axis=1).min():.6f} and more")


if __name__ == "__main__":
    main()
