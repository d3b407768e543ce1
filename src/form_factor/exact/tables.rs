//! Pairs of two faces that are computed together, since they repeat or share their corners.

use std::ops::Range;

use super::batches::{Batches, Known};
use super::corners::{CornerSums, PatchGrid};
use super::lattice::{Lattice, Repeats};
use super::table::{MIN_PAIRS, Table};
use super::views::Views;
use crate::form_factor::pairs::Exchange;
use crate::geometry::polygon_form_factor::PreparedPolygon;
use crate::threads;
use crate::visibility::occluders::PairVisibility;

impl Batches<'_> {
    /// Returns the exchange area of a pair without occluders, from the table of its faces if there is one.
    pub(super) fn unoccluded(&self, i: usize, j: usize) -> Exchange {
        let faces = [i, j].map(|k| self.patches.face_of_patch[k]);
        let table = self.table_of(faces);
        table.map_or_else(|| self.repeated(i, j), |table| table.get(i, j))
    }

    /// Returns the exchange area of a pair of faces without a table, from that of their grids if there is one.
    pub(super) fn repeated(&self, i: usize, j: usize) -> Exchange {
        let grids = self.grids.of(i).zip(self.grids.of(j));
        let table = grids.and_then(|(from, to)| self.grid_tables.get(&[from, to]));
        let kernel = |one: usize, other: usize| self.kernel(one, other);
        table.map_or_else(|| kernel(i, j), |table| table.get_or(&self.patches, (i, j), kernel))
    }

    /// Makes tables for the grids of some faces with those of all faces that they see part of, and drops those of grids before `first_row`.
    fn find_grid_tables(&mut self, first_row: usize, faces: &Range<usize>, views: &[Views]) {
        let grids = &self.grids;
        self.grid_tables
            .retain(|[from, _], _| grids.grids[*from as usize].last() >= first_row);
        let grid = |face: usize| grids.of(self.patches.faces[face].range().start);
        let mut is_known = vec![false; grids.grids.len()];
        for (f, of_face) in faces.clone().zip(views) {
            let Some(from) = grid(f) else { continue };
            is_known.fill(false);
            for view in &of_face.faces {
                let Some(to) = grid(view.face).filter(|&to| !is_known[to as usize]) else {
                    continue;
                };
                is_known[to as usize] = true;
                if self.grid_tables.contains_key(&[from, to]) {
                    continue;
                }
                let [one, other] = [from, to].map(|k| &grids.grids[k as usize]);
                if let Some(table) = Repeats::empty(one, other) {
                    self.grid_tables.insert([from, to], table);
                }
            }
        }
    }

    /// Computes the tables of some faces of a batch with all later faces that they see part of, for the rows of the batch.
    ///
    /// Tables of faces before the batch are dropped.
    pub(super) fn find_tables(
        &mut self,
        (of_batch, rows): (&Range<usize>, &Range<usize>),
        faces: &Range<usize>,
        views: &[Views],
    ) {
        self.find_grid_tables(rows.start, faces, views);
        let mut tables = std::mem::take(&mut self.tables);
        // Tables without these rows go first: perhaps none takes their place.
        tables.retain(|[f, _], table| of_batch.contains(f) && table.is_of(&self.rows_of(*f, rows)));
        let patches = &self.patches;
        let missing: Vec<[usize; 2]> = faces
            .clone()
            .flat_map(|f| {
                let of_face = views[f - faces.start].faces.iter();
                of_face
                    .filter(move |view| !patches.are_one_pair([f, view.face]))
                    .filter(|view| matches!(&view.known, Known::Seen(seen) if seen.visibility != PairVisibility::None))
                    .map(move |view| [f, view.face])
            })
            .filter(|key| !tables.contains_key(key))
            .collect();
        let found: Vec<([usize; 2], Table)> = threads::collect_flat(missing.len(), |k| {
            let key = missing[k];
            Some((key, self.table(key, rows)?))
        });
        tables.extend(found);
        self.tables = tables;
    }

    /// Returns the table of two faces.
    pub(super) fn table_of(&self, faces: [usize; 2]) -> Option<&Table> {
        (!self.patches.are_one_pair(faces))
            .then(|| self.tables.get(&faces))
            .flatten()
    }

    fn rows_of(&self, face: usize, rows: &Range<usize>) -> Range<usize> {
        let own = self.patches.faces[face].range();
        rows.start.max(own.start)..rows.end.min(own.end)
    }

    fn table(&self, [f, g]: [usize; 2], rows: &Range<usize>) -> Option<Table> {
        let (from, to) = self.lattices[f].as_ref().zip(self.lattices[g].as_ref())?;
        if let Some(repeats) = Repeats::new(&self.patches, from, to, |i, j| self.kernel(i, j)) {
            return Some(Table::Repeats(repeats));
        }
        let [own, other] = [self.rows_of(f, rows), self.patches.faces[g].range()];
        if own.len() * other.len() < MIN_PAIRS {
            return None;
        }
        let smallest = |range: Range<usize>| {
            let areas = self.patches.prepared[range].iter().map(PreparedPolygon::area);
            areas.fold(f64::INFINITY, f64::min)
        };
        let most = self
            .method
            .full_tolerance(smallest(own.clone()).min(smallest(other.clone())))
            .abs;
        if most <= 0.0 {
            return None;
        }
        let grid = |lattice: &Lattice, range: Range<usize>| PatchGrid::new(&self.patches, lattice, range);
        let sums = CornerSums::new(&grid(from, own.clone())?, &grid(to, other)?, most)?;
        Some(Table::Corners(sums, own))
    }
}
