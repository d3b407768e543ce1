//! `sr`: shooting from random points.

use std::ops::Range;

use super::entry::{MethodEntry, Work};
use super::on_the_fly::Rows;
use super::settings::{SHOT_RAYS, SOBOL};
use super::shooting::{Shooter, Shot, n_nets};
use super::{ComputeResult, FormFactorMethod, Input, Reciprocity, rows, upper_bounds};
use crate::geometry::sampling::{PointStream, Sequence, UniformOnPolygon};
use crate::matrix::{RowTile, StorageChoice};
use crate::mesh::PatchId;
use crate::progress::Progress;

/// Shooting with a random distribution of starting points ("SR").
///
/// F_ij ≈ (rays from i whose first hit is the front of j) / N; the points are uniform on the patch, the directions have the density cos θ / π.
/// Unbiased but for the lift of the starting points (see [`Visibility::offset`](crate::visibility::Visibility::offset));
/// standard error sqrt(F (1 − F) / N) with [`Sequence::Random`], and (N F)^(−1/8) of that with [`Sequence::Sobol`] from one hit on: of k cells of a net in four dimensions, the border of
/// a patch passes through about k^(3/4), and these alone are uncertain. The mean square of the true error is 0.3 to 1.0 of that (1,024 to 16,384 rays, one to 8,000 hits, six scenes).
/// An entry that no ray hit states 1.5 / N, or the factor without occluders where that is less.
/// Reciprocity holds to the noise only; rows sum to 1 less the fraction that escaped or met a back face.
/// Source: Baranoski, Bramley and Shirley 1995, appendix A. Departures: the Sobol sequence is the default.
#[derive(Clone, Copy, Debug)]
pub struct RandomShooting {
    /// N, the number of rays of each patch.
    pub rays: u64,
    /// The source of the numbers.
    pub sequence: Sequence,
    /// The seed of all streams.
    pub seed: u64,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "sr",
    summary: "Shooting from random points",
    settings: &[SHOT_RAYS, SOBOL],
    work: Work::RowsOfRays,
    make: |s| {
        Some(Box::new(RandomShooting {
            rays: s.rays()?,
            sequence: s.sequence()?,
            seed: s.seed,
        }))
    },
};

impl FormFactorMethod for RandomShooting {
    fn name(&self) -> &'static str {
        "sr"
    }

    fn reciprocity(&self) -> Reciprocity {
        Reciprocity::ToNoise
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        let bounds = upper_bounds(input.mesh, None);
        rows::by_rows(input, storage, progress, Some(bounds), |rows| self.tile(input, rows))
    }

    fn rows<'a>(&'a self, input: Input<'a>) -> Option<Rows<'a>> {
        Some(Box::new(move |rows| self.tile(input, rows)))
    }
}

impl RandomShooting {
    fn tile(&self, input: Input<'_>, rows: Range<usize>) -> RowTile {
        let mut tile = RowTile::new(rows.start);
        let mut shooter = Shooter::new(input, n_nets(self.sequence, 1), false);
        for i in rows {
            let patch = &input.mesh.patches[i];
            let map = UniformOnPolygon::new(&input.mesh.polygon(PatchId::from_index(i)));
            let mut stream = PointStream::new(self.sequence, self.seed, i as u64);
            let shots = (0..self.rays).map(|_| {
                let [s, t, u, v] = stream.next_point();
                Shot {
                    point: map.point(s, t),
                    direction: [u, v],
                    weight: 1.0,
                    coarser: [0.0; 2],
                }
            });
            let (entries, tally) = shooter.row(patch, shots);
            tile.push_row(entries, tally);
        }
        tile
    }
}
