#!/usr/bin/env python3
"""Writes one room with a block in it in the formats of other programs: meshio, trimesh, gmsh and PyVista.

Run in an environment of its own (pip install meshio trimesh gmsh pyvista); the files stand beside this one, and the tests read these.
`triangles-*` are 24 triangles, `quads-*` 12 quadrilaterals, in the same order in all files. meshio 5.3.5, trimesh 5.2.0,
gmsh 4.15.2 and PyVista 0.49.1 wrote those that are here.
"""

import pathlib

import gmsh
import meshio
import numpy as np
import pyvista as pv
import trimesh
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

HERE = pathlib.Path(__file__).parent
NAMES = ["floor", "ceiling", "x0", "x1", "y0", "y1", "block"]


def box(size, inwards):
    x, y, z = size
    corners = np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0], [0, 0, z], [x, 0, z], [x, y, z], [0, y, z]], float)
    outwards = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2]]
    return corners, [face[::-1] for face in outwards] if inwards else outwards


def scene():
    room, walls = box((3.1, 4.2, 2.7), True)
    block, sides = box((0.8, 0.6, 1.1), False)
    a, b = 0.5, 0.3
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    block = block @ (about_x @ about_z).T + [1.1, 1.7, 0.6]
    quads = np.array(walls + [[v + 8 for v in side] for side in sides])
    surface = np.array([1, 2, 3, 4, 5, 6] + 6 * [7])
    triangles = np.concatenate([[[q[0], q[1], q[2]], [q[0], q[2], q[3]]] for q in quads])
    return np.concatenate([room, block]), quads, triangles, surface


POINTS, QUADS, TRIANGLES, SURFACE = scene()
OF_TRIANGLES = np.repeat(SURFACE, 2)


def by_meshio():
    fields = {name: np.array([k + 1, 2]) for k, name in enumerate(NAMES)}
    for kind, cells, surface in [("triangle", TRIANGLES, OF_TRIANGLES), ("quad", QUADS, SURFACE)]:
        tags = {"gmsh:physical": [surface], "gmsh:geometrical": [surface]}
        tagged = meshio.Mesh(POINTS, [(kind, cells)], cell_data=tags, field_data=fields)
        plain = meshio.Mesh(POINTS, [(kind, cells)], cell_data={"surface": [surface]})
        bare = meshio.Mesh(POINTS, [(kind, cells)])

        def out(mesh, name, **options):
            meshio.write(HERE / f"{kind}s-meshio-{name}", mesh, **options)

        if kind == "triangle":
            out(bare, "ascii.stl", file_format="stl", binary=False)
            out(bare, "binary.stl", file_format="stl", binary=True)
        out(bare, "plain.obj")
        out(plain, "ascii.ply", file_format="ply", binary=False)
        out(plain, "binary.ply", file_format="ply", binary=True)
        for version in ["22", "41"]:
            out(tagged, f"{version}-ascii.msh", file_format="gmsh" if version == "41" else "gmsh22", binary=False)
            out(tagged, f"{version}-binary.msh", file_format="gmsh" if version == "41" else "gmsh22", binary=True)
        out(plain, "ascii.vtk", binary=False)
        out(plain, "binary.vtk", binary=True)
        out(plain, "ascii.vtu", binary=False)
        out(plain, "base64.vtu", binary=True, compression=None)
        out(plain, "zlib.vtu", binary=True, compression="zlib")


def by_trimesh():
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, process=False)
    mesh.export(HERE / "triangles-trimesh-binary.stl")
    mesh.export(HERE / "triangles-trimesh-ascii.stl", file_type="stl_ascii")
    mesh.export(HERE / "triangles-trimesh-binary.ply")
    mesh.export(HERE / "triangles-trimesh-ascii.ply", encoding="ascii")
    mesh.export(HERE / "triangles-trimesh-plain.obj")
    # Surfaces as nodes, the block turned by its node.
    whole = trimesh.Scene()
    for k, name in enumerate(NAMES):
        part = trimesh.Trimesh(POINTS, TRIANGLES[OF_TRIANGLES == k + 1], process=False)
        glow = [1.0, 0.8, 0.6] if name == "ceiling" else [0.0, 0.0, 0.0]
        material = trimesh.visual.material.PBRMaterial(
            name=name, baseColorFactor=[128, 102, 51, 255], emissiveFactor=glow, metallicFactor=0.0, roughnessFactor=1.0
        )
        part.visual = trimesh.visual.TextureVisuals(material=material)
        transform = np.eye(4)
        if name == "block":
            transform = trimesh.transformations.rotation_matrix(0.7, [1, 2, 2], [0.3, 0.1, 0.2])
            part.apply_transform(np.linalg.inv(transform))
        whole.add_geometry(part, node_name=name, geom_name=name, transform=transform)
    whole.export(HERE / "triangles-trimesh.glb")
    for name, content in trimesh.exchange.gltf.export_gltf(whole, merge_buffers=True, embed_buffers=True).items():
        if name.endswith(".gltf"):
            (HERE / "triangles-trimesh.gltf").write_bytes(content)


def by_gmsh():
    for kind, cells, surface in [("triangle", TRIANGLES, OF_TRIANGLES), ("quad", QUADS, SURFACE)]:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        for k, name in enumerate(NAMES):
            tag = gmsh.model.addDiscreteEntity(2, k + 1)
            if k == 0:
                gmsh.model.mesh.addNodes(2, tag, range(1, len(POINTS) + 1), POINTS.ravel())
            own = np.flatnonzero(surface == k + 1)
            element = 2 if kind == "triangle" else 3
            gmsh.model.mesh.addElementsByType(tag, element, own + 1, cells[own].ravel() + 1)
            gmsh.model.addPhysicalGroup(2, [tag], k + 1, name)
        for version in [2.2, 4.1]:
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            for binary, encoding in [(0, "ascii"), (1, "binary")]:
                gmsh.option.setNumber("Mesh.Binary", binary)
                gmsh.write(str(HERE / f"{kind}s-gmsh-{round(10 * version)}-{encoding}.msh"))
        if kind == "triangle":
            for binary, encoding in [(0, "ascii"), (1, "binary")]:
                gmsh.option.setNumber("Mesh.Binary", binary)
                gmsh.write(str(HERE / f"triangles-gmsh-{encoding}.stl"))
            gmsh.option.setNumber("Mesh.Binary", 0)
            gmsh.write(str(HERE / "triangles-gmsh.vtk"))
        gmsh.finalize()
    # A box that gmsh meshes itself: no physical groups, points, lines and volumes beside the surfaces; first and second order.
    for order in [1, 2]:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 3.1, 4.2, 2.7)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", 5)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(HERE / f"box-gmsh-order-{order}.msh"))
        gmsh.finalize()


def by_pyvista():
    for kind, cells, surface in [("triangle", TRIANGLES, OF_TRIANGLES), ("quad", QUADS, SURFACE)]:
        n = cells.shape[1]
        flat = np.hstack([np.full((len(cells), 1), n), cells]).ravel()
        poly = pv.PolyData(POINTS, flat)
        poly.cell_data["surface"] = surface
        types = np.full(len(cells), pv.CellType.TRIANGLE if n == 3 else pv.CellType.QUAD)
        grid = pv.UnstructuredGrid(flat, types, POINTS)
        grid.cell_data["surface"] = surface
        grid.cell_data["name"] = [NAMES[k - 1] for k in surface]
        poly.save(HERE / f"{kind}s-pyvista-binary.vtk", binary=True)
        poly.save(HERE / f"{kind}s-pyvista-ascii.vtk", binary=False)
        poly.save(HERE / f"{kind}s-pyvista-binary.vtp", binary=True)
        poly.save(HERE / f"{kind}s-pyvista-ascii.vtp", binary=False)
        grid.save(HERE / f"{kind}s-pyvista-binary.vtu", binary=True)
        grid.save(HERE / f"{kind}s-pyvista-ascii.vtu", binary=False)
        grid.save(HERE / f"{kind}s-pyvista-grid.vtk", binary=True)
        poly.save(HERE / f"{kind}s-pyvista-binary.ply", binary=True)
        appended = [("raw", False, None), ("raw-zlib", False, "zlib"), ("base64", True, None), ("base64-zlib", True, "zlib")]
        for name, encoded, compressor in appended:
            writer = vtkXMLUnstructuredGridWriter() if kind == "triangle" else vtkXMLPolyDataWriter()
            writer.SetInputData(grid if kind == "triangle" else poly)
            writer.SetDataModeToAppended()
            writer.SetEncodeAppendedData(encoded)
            writer.SetCompressorTypeToZLib() if compressor else writer.SetCompressorTypeToNone()
            # Several blocks in each array.
            writer.SetBlockSize(64)
            if encoded:
                writer.SetHeaderTypeToUInt64()
                writer.SetByteOrderToBigEndian()
            writer.SetFileName(str(HERE / f"{kind}s-vtk-appended-{name}.{'vtu' if kind == 'triangle' else 'vtp'}"))
            writer.Write()
        writer = vtkPLYWriter()
        writer.SetInputData(poly)
        writer.SetFileTypeToBinary()
        writer.SetDataByteOrderToBigEndian()
        writer.SetFileName(str(HERE / f"{kind}s-vtk-big-endian.ply"))
        writer.Write()
        if kind == "triangle":
            poly.save(HERE / "triangles-pyvista-binary.stl", binary=True)
            poly.save(HERE / "triangles-pyvista-ascii.stl", binary=False)


by_meshio()
by_trimesh()
by_gmsh()
by_pyvista()
