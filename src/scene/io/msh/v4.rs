//! Entities, nodes and elements of MSH 4.1.

use glam::DVec3;

use super::super::Counts;
use super::super::cells::Cell;
use super::super::cursor::Cursor;
use super::{MeshFile, element};
use crate::scene::{SceneError, SceneErrorKind};

impl MeshFile<'_> {
    /// Reads a count: a `size_t` of 8 or 4 bytes, or text.
    fn size(&self, cursor: &mut Cursor<'_>, what: &'static str) -> Result<u64, SceneError> {
        if self.is_binary && self.size_bytes == 4 {
            return cursor.binary::<u32>(what).map(u64::from);
        }
        self.whole(cursor, what)
    }

    fn int(&self, cursor: &mut Cursor<'_>, what: &'static str) -> Result<i64, SceneError> {
        self.whole::<i32>(cursor, what).map(i64::from)
    }

    /// Checks a stated count of things that consist of `n_numbers` counts each.
    fn counted(&self, cursor: &Cursor<'_>, n: u64, n_numbers: u64, what: &'static str) -> Result<usize, SceneError> {
        self.count(cursor, n, [2 * n_numbers - 1, 4 * n_numbers], what)
    }

    /// Reads the physical groups of the surfaces of the model.
    pub(super) fn entities(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        const WHAT: &str = "the entities";
        if self.version.0 == 2 {
            return Ok(());
        }
        let mut counts = [0; 4];
        for count in &mut counts {
            let stated = self.size(cursor, WHAT)?;
            *count = self.counted(cursor, stated, 5, "entities")?;
        }
        for (dimension, n) in counts.into_iter().enumerate() {
            for _ in 0..n {
                let tag = self.int(cursor, WHAT)?;
                // A point has three coordinates; other entities have a bounding box of six.
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.whole::<f64>(cursor, WHAT)?;
                }
                let physical = self.ints(cursor)?;
                if dimension > 0 {
                    self.ints(cursor)?;
                }
                if let (2, Some(&first)) = (dimension, physical.first()) {
                    self.physical_of_entity.insert(tag, first);
                }
            }
        }
        Ok(())
    }

    fn ints(&self, cursor: &mut Cursor<'_>) -> Result<Vec<i64>, SceneError> {
        const WHAT: &str = "the entities";
        let n = self.size(cursor, WHAT)?;
        let n = self.counted(cursor, n, 1, "tags of an entity")?;
        (0..n).map(|_| self.int(cursor, WHAT)).collect()
    }

    /// Reads blocks of nodes: an entity, tags, then coordinates, with parameters on the entity where these are stored.
    pub(super) fn nodes_v4(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        const WHAT: &str = "the nodes";
        let n_blocks = self.size(cursor, WHAT)?;
        let n_blocks = self.counted(cursor, n_blocks, 4, "blocks of nodes")?;
        let n_nodes = self.size(cursor, WHAT)?;
        let n_nodes = self.counted(cursor, n_nodes, 4, "nodes")?;
        self.source.expect(Counts {
            vertices: n_nodes as u64,
            ..Counts::default()
        })?;
        self.polygons.vertices.reserve(n_nodes);
        let _tags = [self.size(cursor, WHAT)?, self.size(cursor, WHAT)?];
        for _ in 0..n_blocks {
            let dimension = self.int(cursor, WHAT)?;
            self.int(cursor, WHAT)?;
            let is_parametric = self.int(cursor, WHAT)? != 0;
            let n = self.size(cursor, WHAT)?;
            let n = self.counted(cursor, n, 4, "nodes")?;
            for _ in 0..n {
                let tag = self.size(cursor, WHAT)?;
                self.nodes.push(tag);
            }
            let n_parameters = if is_parametric { dimension.clamp(0, 3) } else { 0 };
            for _ in 0..n {
                let position = [
                    self.coordinate(cursor)?,
                    self.coordinate(cursor)?,
                    self.coordinate(cursor)?,
                ];
                self.polygons.vertices.push(DVec3::from_array(position));
                for _ in 0..n_parameters {
                    self.whole::<f64>(cursor, WHAT)?;
                }
            }
        }
        Ok(())
    }

    /// Reads blocks of elements: an entity, a type, and for each element its tag and its nodes.
    pub(super) fn elements_v4(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        const WHAT: &str = "the elements";
        let n_blocks = self.size(cursor, WHAT)?;
        let n_blocks = self.counted(cursor, n_blocks, 4, "blocks of elements")?;
        let n_elements = self.size(cursor, WHAT)?;
        let n_elements = self.counted(cursor, n_elements, 2, "elements")?;
        self.source.expect(Counts {
            corners: 4 * n_elements as u64,
            faces: n_elements as u64,
            ..Counts::default()
        })?;
        let _tags = [self.size(cursor, WHAT)?, self.size(cursor, WHAT)?];
        for _ in 0..n_blocks {
            let dimension = self.int(cursor, WHAT)?;
            let entity = self.int(cursor, WHAT)?;
            let kind = self.int(cursor, WHAT)?;
            let n = self.size(cursor, WHAT)?;
            let Some((cell, n_nodes)) = element(kind) else {
                let found = SceneErrorKind::malformed("a type of elements of gmsh", kind.to_string());
                return Err(if self.is_binary {
                    self.source.error(found)
                } else {
                    cursor.error(found)
                });
            };
            let n = self.counted(cursor, n, n_nodes as u64 + 1, "elements")?;
            let physical = match dimension {
                2 => self.physical_of_entity.get(&entity).copied().unwrap_or(0),
                _ => 0,
            };
            for _ in 0..n {
                self.element_v4(cursor, cell, n_nodes, (physical, entity))?;
            }
        }
        Ok(())
    }

    fn element_v4(
        &mut self,
        cursor: &mut Cursor<'_>,
        cell: Cell,
        n_nodes: usize,
        tags: (i64, i64),
    ) -> Result<(), SceneError> {
        const WHAT: &str = "the elements";
        let tag = self.size(cursor, WHAT)?;
        let number = if self.is_binary {
            u32::try_from(tag).unwrap_or(u32::MAX)
        } else {
            cursor.line()
        };
        self.others.count(cell);
        let n_corners = match cell {
            Cell::Face(n_corners, _) => n_corners,
            _ => 0,
        };
        let mut corners = [0; 4];
        for k in 0..n_nodes {
            let node = self.size(cursor, WHAT)?;
            if let Some(corner) = corners.get_mut(k) {
                *corner = node;
            }
        }
        if n_corners == 0 {
            return Ok(());
        }
        self.face(cursor, &corners[..n_corners], tags, number)
    }
}
