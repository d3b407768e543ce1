//! Methods that compute the exchange area of one pair of patches at a time: A_i F_ij = A_j F_ji is computed once.

use std::ops::Range;

use super::kept::{self, Part, Piece};
use super::rounded::RoundedRows;
use super::{Computed, FormFactorError, Input, PairCounts};
use crate::geometry::polygon_form_factor::PreparedPolygon;
use crate::in_order::InOrder;
use crate::matrix::{Entry, FormFactors, RowTally, RowTile, StorageChoice};
use crate::mesh::{Mesh, PatchId};
use crate::progress::Progress;

/// The number of rows of the upper triangle that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 8;

/// The exchange area of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Exchange {
    /// A_i F_ij = A_j F_ji, m².
    pub(super) area: f64,
    /// An estimate of its absolute error, m².
    pub(super) error: f64,
}

/// What one thread computes pairs with; made once for every tile.
pub(super) trait PairWorker {
    /// Computes the exchange areas of patch `i` with each of `others`, all of which face it, in their order.
    ///
    /// `emit` is called once for each, in order. Fails where the method cannot treat a pair.
    fn row(&mut self, i: usize, others: &[usize], emit: &mut dyn FnMut(Exchange)) -> Result<(), FormFactorError>;

    /// Returns what this worker did; `not_facing` is counted by the caller.
    fn counts(&self) -> PairCounts;

    /// Returns false if a budget was spent before a tolerance was met.
    fn tolerance_met(&self) -> bool {
        true
    }
}

/// Computes the upper triangle, tile by tile in parallel, and stores it symmetric.
///
/// Patches of one plane, and those that lie behind each other's planes, are not passed on: they exchange nothing.
pub(super) fn by_pairs<W: PairWorker>(
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
    worker: impl Fn() -> W + Sync,
) -> Result<Computed, FormFactorError> {
    let n = input.mesh.n_patches();
    progress.begin("form factors", (n as u64 * (n as u64).saturating_sub(1)) / 2);
    let facing = Facing::new(input.mesh);
    let rounded = RoundedRows::new(input);
    let tile_byte = (ROWS_PER_TILE * n * size_of::<Entry>()) as u64;
    let results = InOrder::new(
        n.div_ceil(ROWS_PER_TILE),
        tile_byte,
        storage.place.waiting_byte(),
        |k| {
            let rows = k * ROWS_PER_TILE..n.min((k + 1) * ROWS_PER_TILE);
            let n_pairs: usize = rows.clone().map(|i| n - 1 - i).sum();
            let part = Part {
                first_row: rows.start,
                n,
                is_upper: true,
            };
            let result = match kept::take(progress, k as u64, part, |end| end == rows.end) {
                Some(piece) => Ok(piece),
                None if progress.is_cancelled() => Err(FormFactorError::Interrupted),
                None => tile(rows, &facing, rounded.as_ref(), &mut worker())
                    .inspect(|piece| kept::keep(progress, k as u64, piece)),
            };
            progress.advance(n_pairs as u64);
            result
        },
    );
    let mut counts = PairCounts::default();
    let mut tolerance_met = true;
    let mut failure = None;
    // In order: of several errors it is always the first row's that is reported.
    let upper = results.map_while(|result| match result {
        Ok(piece) => {
            counts = counts.plus(piece.counts);
            tolerance_met &= piece.tolerance_met;
            Some(piece.tiles)
        }
        Err(error) => {
            failure = Some(error);
            None
        }
    });
    let factors = FormFactors::from_exchange_tiles(input.mesh.areas(), upper.flatten(), storage);
    if let Some(error) = failure {
        return Err(error);
    }
    Ok(Computed {
        factors: factors?,
        pairs: Some(counts),
        tolerance_met,
    })
}

fn tile(
    rows: Range<usize>,
    facing: &Facing,
    rounded: Option<&RoundedRows<'_>>,
    worker: &mut impl PairWorker,
) -> Result<Piece, FormFactorError> {
    let mut tile = RowTile::new(rows.start);
    let mut not_facing = 0;
    let (mut others, mut entries) = (Vec::new(), Vec::new());
    for i in rows {
        others.clear();
        entries.clear();
        others.extend((i + 1..facing.len()).filter(|&j| facing.pair(i, j)));
        not_facing += (facing.len() - 1 - i - others.len()) as u64;
        let mut columns = others.iter();
        worker.row(i, &others, &mut |exchange| {
            if let Some(&j) = columns.next() {
                entries.push((PatchId::from_index(j).0, exchange.area, exchange.error));
            }
        })?;
        assert_eq!(entries.len(), others.len(), "one exchange area for each pair");
        if let Some(rounded) = rounded {
            rounded.add(i, 1.0, i + 1..facing.len(), &mut entries);
        }
        tile.push_row(&entries, RowTally::default());
    }
    let counts = PairCounts {
        not_facing,
        ..worker.counts()
    };
    Ok(Piece {
        tiles: vec![tile],
        counts,
        tolerance_met: worker.tolerance_met(),
    })
}

/// The planes of all patches and their corners, for the test that goes first.
#[derive(Debug)]
pub(super) struct Facing {
    corners: Vec<Vec<glam::DVec3>>,
    normals: Vec<glam::DVec3>,
    sizes: Vec<f64>,
}

impl Facing {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let corners: Vec<Vec<glam::DVec3>> = (0..mesh.n_patches())
            .map(|i| mesh.polygon(PatchId::from_index(i)))
            .collect();
        let sizes = corners
            .iter()
            .map(|c| c.iter().map(|v| v.distance(c[0])).fold(0.0, f64::max))
            .collect();
        Self {
            corners,
            normals: mesh.patches.iter().map(|p| p.normal).collect(),
            sizes,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }

    /// Returns the patches for the closed forms.
    pub(super) fn polygons(&self) -> Vec<PreparedPolygon> {
        self.corners
            .iter()
            .map(|corners| PreparedPolygon::new(corners))
            .collect()
    }

    /// Tells whether part of each patch lies in front of the other's plane.
    ///
    /// A corner counts as in front from 1e-14 of its distance and the patch's size on: below that, rounding decides the sign, and
    /// patches of one plane must be told from patches that meet at an edge. A billionth of the size of the patch that it is a corner of is enough, however large the other is.
    pub(super) fn pair(&self, i: usize, j: usize) -> bool {
        self.sees(i, j) && self.sees(j, i)
    }

    /// Tells whether any patch of one flat range may see any of another, and the reverse.
    pub(super) fn any(&self, from: Range<usize>, to: Range<usize>) -> bool {
        let sees = |i: usize, mut others: Range<usize>| others.any(|j| self.sees(i, j));
        sees(from.start, to.clone()) && sees(to.start, from)
    }

    /// Returns the unit normal of a patch.
    pub(super) fn normal(&self, i: usize) -> glam::DVec3 {
        self.normals[i]
    }

    /// Tells for each of `others` whether some of it lies in front of every patch of a flat range, or nothing of it in front of any; `None` where that
    /// is not certain, and pairs are to be looked at.
    pub(super) fn in_front(&self, of: Range<usize>, others: Range<usize>) -> Vec<Option<bool>> {
        let (origin, normal) = (self.corners[of.start][0], self.normals[of.start]);
        // How far the patches' own planes are from the first one's: shifted, and turned.
        let (mut shifted, mut turned, mut reach) = (0.0_f64, 0.0_f64, 0.0_f64);
        for i in of {
            let to = self.corners[i][0] - origin;
            shifted = shifted.max(normal.dot(to).abs());
            turned = turned.max(self.normals[i].distance(normal));
            reach = reach.max(to.length() + self.sizes[i]);
        }
        let sides = others.map(|j| {
            let (mut before, mut behind) = (false, true);
            for &v in &self.corners[j] {
                let to = v - origin;
                let slack = shifted + (turned + 1e-13) * (to.length() + reach);
                let height = normal.dot(to);
                before |= height > slack;
                behind &= height < -slack;
            }
            (before || behind).then_some(before)
        });
        sides.collect()
    }

    /// Tells whether all of patch j lies in front of the plane of patch i, or on it.
    pub(super) fn is_in_front(&self, i: usize, j: usize) -> bool {
        let (origin, normal) = (self.corners[i][0], self.normals[i]);
        let slack = 1e-9 * self.sizes[j];
        self.corners[j].iter().all(|&v| normal.dot(v - origin) >= -slack)
    }

    fn sees(&self, i: usize, j: usize) -> bool {
        let (origin, normal) = (self.corners[i][0], self.normals[i]);
        let enough = 1e-9 * self.sizes[j];
        self.corners[j].iter().any(|&v| {
            let to = v - origin;
            let height = normal.dot(to);
            height > 1e-14 * (to.length() + self.sizes[i]) || height > enough
        })
    }
}
