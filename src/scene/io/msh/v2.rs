//! Nodes and elements of MSH 2.2.

use glam::DVec3;

use super::super::Counts;
use super::super::cells::Cell;
use super::super::cursor::Cursor;
use super::{Binary as _, MeshFile, element};
use crate::scene::{SceneError, SceneErrorKind};

impl MeshFile<'_> {
    /// Reads `n`, and for each node its tag and coordinates.
    pub(super) fn nodes_v2(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        let n: u64 = cursor.number("the number of nodes")?;
        if self.is_binary {
            cursor.next_line()?;
        }
        let n = self.count(cursor, n, [8, 28], "nodes")?;
        self.source.expect(Counts {
            vertices: n as u64,
            ..Counts::default()
        })?;
        self.polygons.vertices.reserve(n);
        for _ in 0..n {
            let tag = if self.is_binary {
                u64::from(cursor.binary::<u32>("the nodes")?)
            } else {
                cursor.number("the tag of a node")?
            };
            let position = [
                self.coordinate(cursor)?,
                self.coordinate(cursor)?,
                self.coordinate(cursor)?,
            ];
            self.nodes.push(tag);
            self.polygons.vertices.push(DVec3::from_array(position));
        }
        Ok(())
    }

    /// Reads `n`, and for each element its tag, type, number of tags, tags and nodes; binary elements come in blocks of one type.
    pub(super) fn elements_v2(&mut self, cursor: &mut Cursor<'_>) -> Result<(), SceneError> {
        let n: u64 = cursor.number("the number of elements")?;
        if self.is_binary {
            cursor.next_line()?;
        }
        let n = self.count(cursor, n, [8, 8], "elements")?;
        self.source.expect(Counts {
            corners: 4 * n as u64,
            faces: n as u64,
            ..Counts::default()
        })?;
        if self.is_binary {
            let mut n_read = 0;
            while n_read < n {
                n_read += self.block_v2(cursor, n - n_read)?;
            }
            return Ok(());
        }
        for _ in 0..n {
            let Some(number) = cursor.next_full_line()? else {
                return Err(self.source.error(SceneErrorKind::CutShort { what: "the elements" }));
            };
            self.element_line_v2(cursor, number)?;
        }
        Ok(())
    }

    /// Reads the element on the last line, which has the given number.
    fn element_line_v2(&mut self, cursor: &Cursor<'_>, number: u32) -> Result<(), SceneError> {
        let line = cursor.last();
        let at_line = |kind| SceneError::new(self.polygons.numbering.origin(&self.source.path, number), kind);
        let malformed = || {
            at_line(SceneErrorKind::malformed(
                "tag, type, number of tags, tags and nodes",
                line,
            ))
        };
        let words: Vec<i64> = line
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()
            .map_err(|_| malformed())?;
        let [_, kind, n_tags, rest @ ..] = &words[..] else {
            return Err(malformed());
        };
        let n_tags = usize::try_from(*n_tags).unwrap_or(usize::MAX);
        let (Some((cell, n_nodes)), Some((tags, nodes))) = (element(*kind), rest.split_at_checked(n_tags)) else {
            return Err(malformed());
        };
        self.others.count(cell);
        if let Cell::Face(n_corners, _) = cell {
            if nodes.len() < n_nodes {
                return Err(malformed());
            }
            let nodes: Vec<u64> = nodes[..n_corners]
                .iter()
                .map(|tag| u64::try_from(*tag).unwrap_or(0))
                .collect();
            let tag = |k: usize| tags.get(k).copied().unwrap_or(0);
            self.face(cursor, &nodes, (tag(0), tag(1)), number).map_err(|error| {
                SceneError::new(self.polygons.numbering.origin(&self.source.path, number), error.kind)
            })?;
        }
        Ok(())
    }

    /// Reads a block of binary elements, and returns their number.
    fn block_v2(&mut self, cursor: &mut Cursor<'_>, n_left: usize) -> Result<usize, SceneError> {
        const WHAT: &str = "the elements";
        let [kind, n, n_tags] = [
            cursor.binary::<i32>(WHAT)?,
            cursor.binary::<i32>(WHAT)?,
            cursor.binary::<i32>(WHAT)?,
        ];
        let malformed = |found: i32| {
            let expected = "a type, a number of elements and one of tags";
            self.source
                .error(SceneErrorKind::malformed(expected, found.to_string()))
        };
        let (cell, n_nodes) = element(kind.into()).ok_or_else(|| malformed(kind))?;
        let n_elements = usize::try_from(n)
            .ok()
            .filter(|n| (1..=n_left).contains(n))
            .ok_or_else(|| malformed(n))?;
        let n_tags = usize::try_from(n_tags)
            .ok()
            .filter(|tags| *tags < 1 << 16)
            .ok_or_else(|| malformed(n_tags))?;
        for _ in 0..n_elements {
            let number: u32 = cursor.binary(WHAT)?;
            let mut tags = [0_i64; 2];
            for k in 0..n_tags {
                let tag: i32 = cursor.binary(WHAT)?;
                if let Some(place) = tags.get_mut(k) {
                    *place = tag.into();
                }
            }
            let is_little = cursor.is_little;
            let nodes = cursor.take(4 * n_nodes, WHAT)?;
            let mut corners = [0_u64; 4];
            for (corner, node) in corners.iter_mut().zip(nodes.chunks_exact(4)) {
                *corner = u32::of(node, is_little).into();
            }
            self.others.count(cell);
            if let Cell::Face(n_corners, _) = cell {
                self.face(cursor, &corners[..n_corners], (tags[0], tags[1]), number)?;
            }
        }
        Ok(n_elements)
    }
}
