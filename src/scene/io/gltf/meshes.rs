//! The meshes of a glTF file, placed by its nodes.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::super::cursor::Cursor;
use super::super::polygons::{NONE, Names, Polygons};
use super::super::scalar::Binary as _;
use super::super::source::Source;
use super::super::{Counts, LoadOptions};
use super::buffers::Buffer;
use super::document::{Accessor, Document, Node, Primitive};
use super::materials::materials;
use crate::scene::{
    MAX_COORDINATE, Numbering, Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Written,
};

/// The depth of nested nodes beyond which a file is refused: cyclic nodes have no end.
const MAX_DEPTH: usize = 1 << 10;

/// The distance from 0 or 1 that counts as the rounding of numbers of a transformation: some of them have five digits.
const OFF_UNIT: f64 = 1e-5;

/// The name of unused data in warnings.
const COLOURS: &str = "colours of vertices";

/// The modes of primitives that are triangles.
const TRIANGLES: u32 = 4;
const STRIP: u32 = 5;
const FAN: u32 = 6;

/// A node and its transformation.
#[derive(Clone, Copy)]
struct Placed {
    node: usize,
    world_from_node: DAffine3,
    /// The error of the transformation's numbers, as a part of a coordinate and in its unit.
    rounding: [f64; 2],
}

struct Meshes<'a> {
    document: &'a Document,
    buffers: &'a [Buffer<'a>],
    source: &'a Source<'a>,
    polygons: Polygons,
    groups: Names,
    /// The parts of the file, by the number before their first triangle.
    parts: Vec<(u32, String)>,
    n_thin: usize,
    /// The meshes with skipped data, and its name.
    unread: Vec<(usize, &'static str)>,
}

/// Returns the polygons of the scene that a file shows.
pub(super) fn polygons<'s>(
    document: &Document,
    buffers: &[Buffer<'s>],
    source: &Source<'s>,
    options: &LoadOptions,
) -> Result<Polygons, SceneError> {
    let mut meshes = Meshes {
        document,
        buffers,
        source,
        polygons: Polygons {
            written: Written::new(),
            materials: materials(document, source, options.max_exitance)?,
            ..Polygons::default()
        },
        groups: Names::default(),
        parts: Vec::new(),
        n_thin: 0,
        unread: Vec::new(),
    };
    let nodes = meshes.nodes()?;
    meshes.warn_of_nodes(&nodes);
    for placed in nodes {
        meshes.add(placed)?;
    }
    let Meshes {
        mut polygons,
        groups,
        parts,
        n_thin,
        unread,
        ..
    } = meshes;
    polygons.groups = groups.all;
    polygons.numbering = Numbering::Elements {
        noun: "triangle",
        first: 0,
        parts,
    };
    let file = Origin::file(&source.path);
    let mut warn = |count, what| {
        let kind = if what == COLOURS {
            SceneWarningKind::UnusedColours { count }
        } else {
            SceneWarningKind::SkippedElements { count, what }
        };
        polygons.warnings.push(SceneWarning::new(file.clone(), kind));
    };
    if n_thin > 0 {
        warn(n_thin, "primitives of points or lines");
    }
    let mut counts: HashMap<&'static str, usize> = HashMap::new();
    for (_, what) in &unread {
        *counts.entry(what).or_default() += 1;
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_unstable();
    for (what, count) in counts {
        warn(count, what);
    }
    Ok(polygons)
}

impl<'a> Meshes<'a> {
    fn error_at(&self, element: String, kind: SceneErrorKind) -> SceneError {
        let path = self.source.path.clone();
        SceneError::new(Origin::Element { path, element }, kind)
    }

    /// Returns the roots of the scene that is shown; without scenes, all nodes that have no parent.
    fn roots(&self) -> Vec<usize> {
        let document = self.document;
        if let Some(scene) = document.scenes.get(document.scene) {
            return scene.nodes.clone();
        }
        let mut is_child = vec![false; document.nodes.len()];
        for &child in document.nodes.iter().flat_map(|node| &node.children) {
            if let Some(is_child) = is_child.get_mut(child) {
                *is_child = true;
            }
        }
        (0..document.nodes.len()).filter(|node| !is_child[*node]).collect()
    }

    /// Returns the nodes with a mesh, in file order: children before siblings.
    fn nodes(&self) -> Result<Vec<Placed>, SceneError> {
        let mut found = Vec::new();
        let mut is_seen = vec![false; self.document.nodes.len()];
        let whole = |node| Placed {
            node,
            world_from_node: DAffine3::IDENTITY,
            rounding: [0.0; 2],
        };
        // The last element is the next node.
        let mut waiting: Vec<(Placed, usize)> = self.roots().into_iter().rev().map(|node| (whole(node), 0)).collect();
        while let Some((parent, depth)) = waiting.pop() {
            let node = parent.node;
            let refused = |expected: &str, instead: &str| {
                let kind = SceneErrorKind::malformed(expected, instead);
                self.error_at(format!("node {node}"), kind)
            };
            let Some(own) = self.document.nodes.get(node) else {
                return Err(refused("a node of the file", &node.to_string()));
            };
            if depth > MAX_DEPTH {
                return Err(refused("at most 1024 nodes below one another", "more"));
            }
            if std::mem::replace(&mut is_seen[node], true) {
                return Err(refused("each node once below one other", "it again"));
            }
            let (transform, [part, shift]) =
                transform(own).map_err(|kind| self.error_at(format!("node {node}"), kind))?;
            let placed = Placed {
                node,
                world_from_node: parent.world_from_node * transform,
                rounding: [parent.rounding[0] + part, parent.rounding[1] + shift],
            };
            if !placed.world_from_node.is_finite() {
                return Err(refused("a finite transformation", "another"));
            }
            if own.mesh.is_some() {
                found.push(placed);
            }
            let children = own.children.iter().rev();
            waiting.extend(children.map(|&child| (Placed { node: child, ..placed }, depth + 1)));
        }
        Ok(found)
    }

    /// Warns of rotations that are scaled, and of copies that are not read.
    fn warn_of_nodes(&mut self, nodes: &[Placed]) {
        let number = |is_so: fn(&Node) -> bool| {
            let all = nodes.iter().map(|own| &self.document.nodes[own.node]);
            all.filter(|own| is_so(own)).count()
        };
        let (scaled, copied) = (number(is_scaled), number(has_copies));
        let kinds = [
            (scaled, SceneWarningKind::ScaledRotations { count: scaled }),
            (copied, SceneWarningKind::UnreadCopies { count: copied }),
        ];
        let file = Origin::file(&self.source.path);
        let new = kinds.into_iter().filter(|(n, _)| *n > 0);
        let new = new.map(|(_, kind)| SceneWarning::new(file.clone(), kind));
        self.polygons.warnings.extend(new);
    }

    /// Adds the mesh of a node.
    fn add(&mut self, placed: Placed) -> Result<(), SceneError> {
        let node = placed.node;
        let own = &self.document.nodes[node];
        let number = own.mesh.unwrap_or(usize::MAX);
        let Some(mesh) = self.document.meshes.get(number) else {
            let kind = SceneErrorKind::malformed("a mesh of the file", number.to_string());
            return Err(self.error_at(format!("node {node}"), kind));
        };
        let stated = [&own.name, &mesh.name].into_iter().flatten();
        let name = stated.map(|name| name.trim()).find(|name| !name.is_empty());
        let name = name.map_or_else(|| format!("node{node}"), str::to_owned);
        if own.skin.is_some() {
            self.unread.push((number, "skins of meshes"));
        }
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let element = match mesh.primitives.len() {
                1 => format!("`{name}`"),
                _ => format!("`{name}`, primitive {k}"),
            };
            let added = self.primitive(primitive, number, &name, &element, placed);
            added.map_err(|kind| self.error_at(element, kind))?;
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        mesh: usize,
        name: &str,
        element: &str,
        placed: Placed,
    ) -> Result<(), SceneErrorKind> {
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        if !(TRIANGLES..=FAN).contains(&mode) {
            self.n_thin += 1;
            return Ok(());
        }
        let unread = [
            (!primitive.targets.is_empty(), "morph targets"),
            (primitive.attributes.contains_key("COLOR_0"), COLOURS),
        ];
        let new: Vec<_> = unread
            .into_iter()
            .filter(|(is_there, _)| *is_there)
            .map(|(_, what)| (mesh, what))
            .collect();
        for one in new {
            if !self.unread.contains(&one) {
                self.unread.push(one);
            }
        }
        let Some(positions) = primitive.attributes.get("POSITION") else {
            return Err(SceneErrorKind::malformed("an attribute `POSITION`", "none"));
        };
        let material = match primitive.material {
            None => NONE,
            Some(k) if k < self.polygons.materials.len() => u32::try_from(k).unwrap_or(NONE),
            Some(k) => return Err(SceneErrorKind::malformed("a material of the file", k.to_string())),
        };
        let first = self.positions(*positions, placed)?;
        let n_vertices = self.polygons.vertices.len() - first;
        let indices = match primitive.indices {
            Some(accessor) => self.indices(accessor, n_vertices)?,
            None => (0..u32::try_from(n_vertices).unwrap_or(NONE)).collect(),
        };
        let group = self.groups.number(name);
        let before = u32::try_from(self.polygons.faces.len()).unwrap_or(u32::MAX);
        self.parts.push((before, element.to_owned()));
        let first = u32::try_from(first).unwrap_or(NONE);
        // A reflection reverses the winding of triangles, and the format requires it to be restored.
        let is_mirrored = placed.world_from_node.matrix3.determinant() < 0.0;
        let mut push = |mut corners: [u32; 3]| {
            if is_mirrored {
                corners.swap(1, 2);
            }
            let number = u32::try_from(self.polygons.faces.len())
                .unwrap_or(u32::MAX)
                .saturating_add(1);
            let corners = corners.map(|corner| first.saturating_add(corner));
            self.polygons.face(corners, group, material, number);
        };
        match mode {
            STRIP => indices.windows(3).enumerate().for_each(|(k, own)| {
                push(if k % 2 == 0 {
                    [own[0], own[1], own[2]]
                } else {
                    [own[1], own[0], own[2]]
                });
            }),
            FAN => indices
                .windows(2)
                .skip(1)
                .for_each(|own| push([indices[0], own[0], own[1]])),
            _ => indices.as_chunks::<3>().0.iter().for_each(|own| push(*own)),
        }
        Ok(())
    }

    /// Adds the positions of an accessor, and returns the number of the first vertex.
    fn positions(&mut self, accessor: usize, placed: Placed) -> Result<usize, SceneErrorKind> {
        let world_from_node = placed.world_from_node;
        let (own, mut cursor, gap) = self.accessor(accessor)?;
        if own.kind != "VEC3" {
            return Err(SceneErrorKind::malformed("positions of type `VEC3`", own.kind.clone()));
        }
        let first = self.polygons.vertices.len();
        self.source
            .expect(Counts {
                vertices: own.count,
                ..Counts::default()
            })
            .map_err(|error| error.kind)?;
        let size = component_bytes(own.component_type)?;
        let mut greatest = 0.0_f64;
        let mut local_written = Written::new();
        for k in 0..own.count {
            let mut local = [0.0; 3];
            let point = next(&mut cursor, if k == 0 { 0 } else { gap }, 3 * size)?;
            for (x, own_bytes) in local.iter_mut().zip(point.chunks_exact(size)) {
                *x = component(own, own_bytes);
                if x.is_nan() || x.abs() > MAX_COORDINATE {
                    return Err(SceneErrorKind::BadCoordinate { token: x.to_string() });
                }
                greatest = greatest.max(x.abs());
                #[expect(clippy::cast_possible_truncation, reason = "it was an f32, or is a short number")]
                local_written.see_single(*x as f32);
            }
            let position = world_from_node.transform_point3(DVec3::from_array(local));
            if position
                .to_array()
                .iter()
                .any(|x| x.is_nan() || x.abs() > MAX_COORDINATE)
            {
                return Err(SceneErrorKind::BadCoordinate {
                    token: position.to_string(),
                });
            }
            self.polygons.vertices.push(position);
        }
        self.note_rounding(placed, greatest, &local_written);
        Ok(first)
    }

    /// Records the error of positions: a step of f32 in each of three coordinates, scaled by the node, and the node's own rounding.
    fn note_rounding(&mut self, placed: Placed, greatest: f64, local: &Written) {
        let written = &mut self.polygons.written;
        if placed.world_from_node == DAffine3::IDENTITY {
            written.merge_single(local);
            return;
        }
        let rows = placed.world_from_node.matrix3.transpose().to_cols_array_2d();
        let sums = rows.map(|row| row.iter().map(|x| x.abs()).sum::<f64>());
        let scale = sums.into_iter().fold(0.0, f64::max);
        let of_points = if local.shows_rounding() {
            local.unit(greatest)
        } else {
            0.0
        };
        let [part, shift] = placed.rounding;
        // Numbers of f64 have no rounding to record.
        let least = scale * (of_points + part * greatest) + shift;
        if least > 1e-14 * greatest * scale {
            written.at_least(least);
        }
    }

    fn indices(&self, accessor: usize, n_vertices: usize) -> Result<Vec<u32>, SceneErrorKind> {
        let (own, mut cursor, gap) = self.accessor(accessor)?;
        if own.kind != "SCALAR" || !matches!(own.component_type, 5121 | 5123 | 5125) {
            return Err(SceneErrorKind::malformed(
                "indices that are unsigned whole numbers",
                own.kind.clone(),
            ));
        }
        self.source
            .expect(Counts {
                corners: own.count,
                faces: own.count / 3,
                ..Counts::default()
            })
            .map_err(|error| error.kind)?;
        let size = component_bytes(own.component_type)?;
        let mut indices = Vec::new();
        for k in 0..own.count {
            let one = next(&mut cursor, if k == 0 { 0 } else { gap }, size)?;
            let index = match size {
                1 => u8::of(one, true).into(),
                2 => u16::of(one, true).into(),
                _ => u32::of(one, true),
            };
            if index as usize >= n_vertices {
                let index = index.into();
                return Err(SceneErrorKind::IndexOutOfRange { index, n_vertices });
            }
            indices.push(index);
        }
        Ok(indices)
    }

    /// Returns an accessor, where its elements begin, and the bytes between two of them.
    fn accessor(&self, number: usize) -> Result<(&'a Accessor, Cursor<'a>, u64), SceneErrorKind> {
        let document = self.document;
        let missing = |what: &str, place: usize| SceneErrorKind::malformed(what, place.to_string());
        let own = document
            .accessors
            .get(number)
            .ok_or_else(|| missing("an accessor of the file", number))?;
        if own.sparse.is_some() {
            return Err(SceneErrorKind::unsupported(
                "sparse accessors are not read; export plain ones",
            ));
        }
        let n_components = match &*own.kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            other => return Err(SceneErrorKind::malformed("an accessor of `SCALAR` or `VEC3`", other)),
        };
        let size = (n_components * component_bytes(own.component_type)?) as u64;
        let view = own.buffer_view.ok_or_else(|| {
            SceneErrorKind::unsupported("accessors without a buffer are not read; export without compression")
        })?;
        let view = document
            .views
            .get(view)
            .ok_or_else(|| missing("a buffer view of the file", view))?;
        let buffer = self
            .buffers
            .get(view.buffer)
            .ok_or_else(|| missing("a buffer of the file", view.buffer))?;
        // Of version 1 of the format, in which 0 means that no bytes are between two elements.
        let stride = view.byte_stride.filter(|stride| *stride > 0).unwrap_or(size);
        if stride < size {
            let expected = format!("a `byteStride` of the {size} bytes of an element, or more");
            return Err(SceneErrorKind::malformed(expected, stride.to_string()));
        }
        let in_buffer = rest(buffer.len(), view.byte_offset, "a `byteOffset` within the buffer")?;
        if view.byte_length > in_buffer {
            return Err(SceneErrorKind::Truncated {
                what: "bytes of a buffer view",
                n: view.byte_length,
                room: in_buffer,
            });
        }
        let in_view = rest(
            view.byte_length,
            own.byte_offset,
            "a `byteOffset` within the buffer view",
        )?;
        let room = in_view.checked_sub(size).map_or(0, |behind| behind / stride + 1);
        if own.count > room {
            return Err(SceneErrorKind::Truncated {
                what: "elements of an accessor",
                n: own.count,
                room,
            });
        }
        let cursor = buffer.cursor(self.source, view.byte_offset + own.byte_offset);
        Ok((own, cursor, stride - size))
    }
}

/// Returns the number of bytes behind an offset.
fn rest(length: u64, offset: u64, expected: &str) -> Result<u64, SceneErrorKind> {
    length
        .checked_sub(offset)
        .ok_or_else(|| SceneErrorKind::malformed(expected, offset.to_string()))
}

/// Returns the bytes of the next element, behind a gap.
fn next<'c>(cursor: &'c mut Cursor<'_>, gap: u64, size: usize) -> Result<&'c [u8], SceneErrorKind> {
    const WHAT: &str = "an accessor";
    cursor.skip(gap, WHAT).map_err(|error| error.kind)?;
    cursor.take(size, WHAT).map_err(|error| error.kind)
}

fn component_bytes(kind: u32) -> Result<usize, SceneErrorKind> {
    match kind {
        5120 | 5121 => Ok(1),
        5122 | 5123 => Ok(2),
        5125 | 5126 => Ok(4),
        _ => Err(SceneErrorKind::malformed(
            "a type of components of glTF",
            kind.to_string(),
        )),
    }
}

/// Returns a component; normalised integers fill [−1, 1] or [0, 1].
fn component(own: &Accessor, bytes: &[u8]) -> f64 {
    let (value, greatest) = match own.component_type {
        5120 => (i8::of(bytes, true).into(), 127.0),
        5121 => (u8::of(bytes, true).into(), 255.0),
        5122 => (i16::of(bytes, true).into(), 32767.0),
        5123 => (u16::of(bytes, true).into(), 65535.0),
        5125 => (u32::of(bytes, true).into(), 4_294_967_295.0),
        _ => return f32::of(bytes, true).into(),
    };
    if own.normalized {
        f64::max(value / greatest, -1.0)
    } else {
        value
    }
}

/// Returns the transformation of a node, and the error of its numbers: as a part of a coordinate, and in its unit.
fn transform(node: &Node) -> Result<(DAffine3, [f64; 2]), SceneErrorKind> {
    let unit_of = |numbers: &[f64]| {
        let mut written = Written::new();
        numbers
            .iter()
            .filter(|x| x.is_finite())
            .for_each(|x| written.see_binary(*x));
        let greatest = numbers.iter().fold(0.0, |greatest: f64, x| greatest.max(x.abs()));
        if written.shows_rounding() {
            written.unit(greatest)
        } else {
            0.0
        }
    };
    if let Some(matrix) = &node.matrix {
        let row = [3, 7, 11, 15].map(|k| matrix[k]);
        let is_affine = row
            .iter()
            .zip([0.0, 0.0, 0.0, 1.0])
            .all(|(x, meant)| (x - meant).abs() <= OFF_UNIT);
        if !is_affine {
            let found = row.map(|x| x.to_string()).join(" ");
            return Err(SceneErrorKind::malformed("a `matrix` with the last row 0 0 0 1", found));
        }
        let rounding = [unit_of(&matrix[..12]), unit_of(&matrix[12..15])];
        return Ok((DAffine3::from_mat4(DMat4::from_cols_array(matrix)), rounding));
    }
    let rotation = match node.rotation {
        None => DQuat::IDENTITY,
        Some(stated) => {
            let own = DQuat::from_array(stated);
            let is_rotation = own.length_squared().is_normal();
            // A quaternion of f32 has length 1 to 24 bits.
            is_rotation.then(|| own.normalize()).ok_or_else(|| {
                let found = stated.map(|x| x.to_string()).join(" ");
                SceneErrorKind::malformed("a `rotation` of length 1", found)
            })?
        }
    };
    let scale = node.scale.unwrap_or([1.0; 3]);
    let translation = node.translation.unwrap_or_default();
    let is_right_angle = DMat3::from_quat(rotation)
        .to_cols_array()
        .iter()
        .all(|x| (x - x.round()).abs() < 1e-15);
    // A component of a quaternion enters an element of the matrix up to four times.
    let of_rotation = if is_right_angle {
        0.0
    } else {
        node.rotation.map_or(0.0, |numbers| 4.0 * unit_of(&numbers))
    };
    let affine =
        DAffine3::from_scale_rotation_translation(DVec3::from_array(scale), rotation, DVec3::from_array(translation));
    Ok((affine, [of_rotation + unit_of(&scale), unit_of(&translation)]))
}

/// Returns whether the rotation of a node is no unit quaternion, beyond rounding.
fn is_scaled(node: &Node) -> bool {
    let rotation = node.rotation.filter(|_| node.matrix.is_none());
    rotation.is_some_and(|own| (DQuat::from_array(own).length() - 1.0).abs() > OFF_UNIT)
}

/// Returns whether a node has copies by an extension.
fn has_copies(node: &Node) -> bool {
    node.extensions.contains_key("EXT_mesh_gpu_instancing")
}
