"""Writes `trimesh.obj` and `meshio.obj` with these two libraries (PyPI: trimesh 5.2, meshio 5.3). The scene is ours."""
import meshio
import numpy as np
import trimesh
from trimesh.visual.material import SimpleMaterial

room = trimesh.creation.box((2, 2, 2))
room.invert()
ball = trimesh.creation.icosphere(subdivisions=1, radius=0.3)
for mesh, name, colour in [(room, "wall", (180, 180, 180)), (ball, "red ball", (150, 20, 20))]:
    uv = np.zeros((len(mesh.vertices), 2))
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=SimpleMaterial(name=name, diffuse=colour))
scene = trimesh.Scene({"room": room, "ball": ball})
text, files = trimesh.exchange.obj.export_obj(scene, return_texture=True, mtl_name="trimesh.mtl")
open("trimesh.obj", "w").write(text)
for name, content in files.items():
    if name.endswith(".mtl"):
        open(name, "wb").write(content)

points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
quads = np.array([[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4]])
triangles = np.array([[1, 2, 6], [1, 6, 5]])
meshio.write("meshio.obj", meshio.Mesh(points, [("quad", quads), ("triangle", triangles)]))
