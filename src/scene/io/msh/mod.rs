//! Reads gmsh's MSH 2.2 and 4.1, ASCII and binary.

use std::collections::{BTreeSet, HashMap};
use std::str::FromStr;

mod v2;
mod v4;

use super::cells::{Cell, Others};
use super::cursor::Cursor;
use super::polygons::{NONE, Names, Polygons};
use super::reader::{Head, Reader};
use super::scalar::Binary;
use super::source::Source;
use super::{LoadOptions, stl};
use crate::scene::{
    MAX_COORDINATE, Numbering, Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Written,
};

/// The format.
pub(super) struct Msh;

impl Reader for Msh {
    fn name(&self) -> &'static str {
        "msh"
    }

    fn summary(&self) -> &'static str {
        "gmsh MSH 2.2 or 4.1, ASCII or binary"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["msh"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        let begins = head.begins_with("$MeshFormat") || head.begins_with("$NOD");
        begins || (head.begins_with("$Comments") && head.contains("$MeshFormat"))
    }

    fn read(&self, source: &Source<'_>, _options: &LoadOptions) -> Result<Polygons, SceneError> {
        let mut cursor = source.cursor();
        let mut file = MeshFile::new(source);
        while cursor.next_full_line()?.is_some() {
            let name = cursor.last().to_owned();
            if !name.starts_with('$') {
                return Err(cursor.malformed("a section such as `$Nodes`", &name));
            }
            file.section(&mut cursor, &name)?;
        }
        file.end()
    }
}

/// The number of vertices of each type of element, from 1; 0 for undefined types.
const NODES: [u8; 38] = [
    2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56, 0, 0,
    0, 0, 16, 25, 36,
];

/// Returns the cell of a type of elements, and its number of vertices.
fn element(kind: i64) -> Option<(Cell, usize)> {
    let place = usize::try_from(kind).ok()?.checked_sub(1)?;
    let n = usize::from(*NODES.get(place)?);
    let cell = match kind {
        2 => Cell::Face(3, false),
        3 => Cell::Face(4, false),
        9 | 20..=25 => Cell::Face(3, true),
        10 | 16 | 36..=38 => Cell::Face(4, true),
        1 | 8 | 15 | 26..=28 => Cell::Thin,
        _ => Cell::Volume,
    };
    (n > 0).then_some((cell, n))
}

/// A mesh under construction, read section by section.
struct MeshFile<'a> {
    source: &'a Source<'a>,
    version: (u32, u32),
    is_binary: bool,
    /// The bytes of a count of version 4.
    size_bytes: usize,
    polygons: Polygons,
    /// The vertex of each node.
    nodes: Nodes,
    /// The names of physical groups, by dimension and tag.
    physical_names: HashMap<(i64, i64), String>,
    /// The physical group of each surface of the model.
    physical_of_entity: HashMap<i64, i64>,
    /// The physical group and the entity of each face.
    tags: Vec<(i64, i64)>,
    others: Others,
}

/// The vertex of each node by its tag.
#[derive(Default)]
struct Nodes {
    n: u32,
    /// The vertices of tags that are not 1, 2, 3 and so on.
    by_tag: HashMap<u64, u32>,
}

impl Nodes {
    /// Adds the next node.
    fn push(&mut self, tag: u64) {
        let vertex = self.n;
        self.n = self.n.saturating_add(1);
        if self.by_tag.is_empty() && tag == u64::from(vertex) + 1 {
            return;
        }
        if self.by_tag.is_empty() {
            self.by_tag = (0..vertex).map(|known| (u64::from(known) + 1, known)).collect();
        }
        self.by_tag.insert(tag, vertex);
    }

    fn vertex(&self, tag: u64) -> Option<u32> {
        if self.by_tag.is_empty() {
            let vertex = u32::try_from(tag.checked_sub(1)?).ok()?;
            return (vertex < self.n).then_some(vertex);
        }
        self.by_tag.get(&tag).copied()
    }
}

impl<'a> MeshFile<'a> {
    fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            version: (0, 0),
            is_binary: false,
            size_bytes: 8,
            polygons: Polygons {
                written: Written::new(),
                has_no_materials: true,
                ..Polygons::default()
            },
            nodes: Nodes::default(),
            physical_names: HashMap::new(),
            physical_of_entity: HashMap::new(),
            tags: Vec::new(),
            others: Others::default(),
        }
    }

    fn section(&mut self, cursor: &mut Cursor<'_>, name: &str) -> Result<(), SceneError> {
        if name == "$NOD" {
            return Err(old(cursor));
        }
        let is_content = matches!(name, "$PhysicalNames" | "$Entities" | "$Nodes" | "$Elements");
        if self.version == (0, 0) && is_content {
            return Err(cursor.malformed("`$MeshFormat` before all other sections", name));
        }
        match name {
            "$MeshFormat" => self.format(cursor)?,
            "$PhysicalNames" => self.names(cursor)?,
            "$Entities" => self.entities(cursor)?,
            "$Nodes" if self.version.0 == 2 => self.nodes_v2(cursor)?,
            "$Nodes" => self.nodes_v4(cursor)?,
            "$Elements" if self.version.0 == 2 => self.elements_v2(cursor)?,
            "$Elements" => self.elements_v4(cursor)?,
            "$ParametricNodes" => {
                let message = "`$ParametricNodes` are not read; save without parameters (Mesh.SaveParametric)";
                return Err(cursor.error(SceneErrorKind::unsupported(message)));
            }
            "$PartitionedEntities" => {
                let message = "partitioned meshes are not read; save without partitions";
                return Err(cursor.error(SceneErrorKind::unsupported(message)));
            }
            _ => {}
        }
        let end = format!("$End{}", &name[1..]);
        if cursor.skip_past_line(&end)? {
            Ok(())
        } else {
            Err(self.source.error(SceneErrorKind::CutShort { what: "a section" }))
        }
    }

    fn format(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        self.version = match cursor.expect_word("a version")? {
            "2.2" | "2" | "2.0" | "2.1" => (2, 2),
            "4.1" => (4, 1),
            _ => return Err(old(cursor)),
        };
        self.is_binary = cursor.number::<u32>("0 or 1")? == 1;
        self.size_bytes = cursor.number("the size of a number")?;
        if self.is_binary && !matches!(self.size_bytes, 4 | 8) {
            return Err(cursor.malformed("4 or 8 as the size of a number", &self.size_bytes.to_string()));
        }
        self.polygons.numbering = if self.is_binary {
            Numbering::elements("element", 1)
        } else {
            Numbering::Lines
        };
        if self.is_binary {
            cursor.next_line()?;
            let one: i32 = cursor.binary("the byte order")?;
            cursor.is_little = one == 1;
            if one != 1 && one.swap_bytes() != 1 {
                return Err(self
                    .source
                    .error(SceneErrorKind::malformed("1 as the byte order", one.to_string())));
            }
        }
        Ok(())
    }

    /// Reads the names of physical groups, which are text even in binary files.
    fn names(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        let n: u64 = cursor.number("the number of physical names")?;
        // The shortest entry: a dimension, a tag and two quotes.
        let n = cursor.count(n, 7, "physical names")?;
        for _ in 0..n {
            let dimension = cursor.number("a dimension")?;
            let tag = cursor.number("a physical tag")?;
            let rest = cursor.next_line()?.unwrap_or("");
            let name = rest.trim_matches('"').to_owned();
            self.physical_names.insert((dimension, tag), name);
        }
        Ok(())
    }

    /// Reads a number that is an `Int` or a count: text, or binary as `T`.
    fn whole<T: FromStr + Binary>(&self, cursor: &mut Cursor<'_>, what: &'static str) -> Result<T, SceneError> {
        if self.is_binary {
            cursor.binary(what)
        } else {
            cursor.number(what)
        }
    }

    fn coordinate(&mut self, cursor: &mut Cursor<'_>) -> Result<f64, SceneError> {
        if !self.is_binary {
            return stl::coordinate(cursor, &mut self.polygons.written);
        }
        let x: f64 = cursor.binary("the nodes")?;
        if x.is_nan() || x.abs() > MAX_COORDINATE {
            let kind = SceneErrorKind::BadCoordinate { token: x.to_string() };
            return Err(cursor.error_in(format!("node {}", self.nodes.n), kind));
        }
        self.polygons.written.see_binary(x);
        Ok(x)
    }

    /// Checks a stated count against the rest of the file, by the least bytes of each thing as text and as binary numbers.
    fn count(
        &self,
        cursor: &Cursor<'_>,
        n: u64,
        least_bytes: [u64; 2],
        what: &'static str,
    ) -> Result<usize, SceneError> {
        let counted = cursor.count(n, least_bytes[usize::from(self.is_binary)], what);
        counted.map_err(|error| {
            if self.is_binary {
                self.source.error(error.kind)
            } else {
                error
            }
        })
    }

    /// Adds a face of nodes.
    fn face(
        &mut self,
        cursor: &Cursor<'_>,
        tags: &[u64],
        (physical, entity): (i64, i64),
        number: u32,
    ) -> Result<(), SceneError> {
        // The tag is negative where the group contains the entity with reversed orientation.
        let is_turned = physical < 0;
        let start = self.polygons.corners.len();
        for &tag in tags {
            let Some(vertex) = self.nodes.vertex(tag) else {
                let kind = SceneErrorKind::malformed("the tag of a node of `$Nodes`", tag.to_string());
                return Err(if self.is_binary {
                    cursor.error_in(format!("element {number}"), kind)
                } else {
                    cursor.error(kind)
                });
            };
            self.polygons.corners.push(vertex);
        }
        if is_turned {
            self.polygons.corners[start..].reverse();
        }
        self.polygons.face([], NONE, NONE, number);
        self.tags.push((physical.abs(), entity));
        Ok(())
    }

    fn end(mut self) -> Result<Polygons, SceneError> {
        if self.version == (0, 0) {
            let kind = SceneErrorKind::malformed("`$MeshFormat`", "the end of the file");
            return Err(self.source.error(kind));
        }
        // Points and lines cause no warning, as gmsh saves those of the model beside its surfaces.
        self.others.thin = 0;
        let entities: BTreeSet<i64> = self.tags.iter().map(|(_, entity)| *entity).collect();
        let has_physical = self.tags.iter().any(|(physical, _)| *physical != 0);
        if has_physical || entities.len() > 1 {
            let mut names = Names::default();
            for (face, (physical, entity)) in self.polygons.faces.iter_mut().zip(&self.tags) {
                face.group = match (physical, self.physical_names.get(&(2, *physical))) {
                    (0, _) => names.number(&format!("surface{entity}")),
                    (_, Some(name)) if !name.is_empty() => names.number(name),
                    (physical, _) => names.number(&format!("physical{physical}")),
                };
            }
            self.polygons.groups = names.all;
        }
        let n_named = self
            .physical_names
            .keys()
            .filter(|(dimension, _)| *dimension == 2)
            .count();
        if !has_physical && n_named > 0 {
            let kind = SceneWarningKind::EmptyGroups { count: n_named };
            let at = Origin::file(&self.source.path);
            self.polygons.warnings.push(SceneWarning::new(at, kind));
        }
        let warnings = self.others.warnings(&self.source.path);
        self.polygons.warnings.extend(warnings);
        Ok(self.polygons)
    }
}

fn old(cursor: &Cursor<'_>) -> SceneError {
    let message = "only versions 2.2 and 4.1 of the format are read; save with `gmsh -format msh41`";
    cursor.error(SceneErrorKind::unsupported(message))
}
