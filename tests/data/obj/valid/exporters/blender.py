"""Writes `blender 5.obj` with Blender 5.0.1 (PyPI: bpy), its exporter left at its defaults but for smooth groups. The scene is ours."""
import bpy, os
bpy.ops.wm.read_factory_settings(use_empty=True)
def material(name, kd, ke=None):
    m=bpy.data.materials.new(name); m.use_nodes=True
    b=m.node_tree.nodes['Principled BSDF']
    b.inputs['Base Color'].default_value=(*kd,1)
    if ke:
        b.inputs['Emission Color'].default_value=(*ke,1); b.inputs['Emission Strength'].default_value=1.0
    return m
white=material('Wall paint',(0.7,0.7,0.7)); red=material('Red.001',(0.6,0.1,0.1)); lamp=material('Lamp',(0.2,0.2,0.2),(5,5,5))
# a room seen from inside
bpy.ops.mesh.primitive_cube_add(size=2, location=(0,0,1)); room=bpy.context.object; room.name='Room'
room.data.materials.append(white); room.data.materials.append(red)
for p in room.data.polygons: p.flip()
room.data.polygons[0].material_index=1
# a box standing in it, turned
bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0.3,0.2,0.26), rotation=(0,0,0.4)); box=bpy.context.object; box.name='Box.001'
box.data.materials.append(white)
# a lamp of six corners
bpy.ops.mesh.primitive_circle_add(vertices=6, radius=0.3, fill_type='NGON', location=(0,0,1.95), rotation=(3.14159265358979,0,0)); l=bpy.context.object; l.name='Ceiling lamp'
l.data.materials.append(lamp)
# a path: edges without faces, and a smooth sphere
m=bpy.data.meshes.new('Wire'); m.from_pydata([(0,0,0.1),(0.1,0,0.1),(0.2,0,0.3)],[(0,1),(1,2)],[]); bpy.context.collection.objects.link(bpy.data.objects.new('Wire',m))
bpy.ops.mesh.primitive_uv_sphere_add(segments=8, ring_count=4, radius=0.2, location=(-0.5,-0.4,0.5)); bpy.ops.object.shade_smooth()
bpy.context.object.name='Ball'; bpy.context.object.data.materials.append(red)

bpy.ops.wm.obj_export(filepath=os.path.abspath("blender 5.obj"), export_smooth_groups=True)

