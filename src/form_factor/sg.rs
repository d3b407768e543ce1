//! `sg`: shooting from Gauss points.

use std::num::NonZeroUsize;
use std::ops::Range;

use super::on_the_fly::Rows;
use super::shooting::{Shooter, Shot};
use super::{Computed, FormFactorError, FormFactorMethod, Input, Reciprocity, rows};
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::geometry::sampling::{PointStream, Sequence};
use crate::matrix::{RowTile, StorageChoice};
use crate::mesh::PatchId;
use crate::progress::Progress;

/// Shooting from q × q Gauss points, each with its Gauss weight ("SG5", "SG10"; printed as SD5, SD10 in places).
///
/// F_ij ≈ Σ_p w_p (rays from point p whose first hit is the front of j) / m, with the same number m of rays for every point.
/// Biased by the Gauss rule's own error, which does not fall with the number of rays: the inner integral has a kink or a jump
/// where j touches or is hidden from a part of i. The standard error covers the noise only, without the gain of stratification.
/// Source: Baranoski, Bramley and Shirley 1995, appendix A. Departures: the directions come from a Sobol sequence by default;
/// rays are rounded up to a whole number for each point.
#[derive(Clone, Copy, Debug)]
pub struct GaussShooting {
    /// q, the number of Gauss points along each side.
    pub points: NonZeroUsize,
    /// The number of rays of each patch; rounded up to a multiple of q².
    pub rays: u64,
    /// The kind of numbers.
    pub sequence: Sequence,
    /// The seed of all streams.
    pub seed: u64,
}

impl GaussShooting {
    fn rays_per_point(&self) -> u64 {
        let n_points = (self.points.get() * self.points.get()) as u64;
        self.rays.div_ceil(n_points)
    }
}

impl FormFactorMethod for GaussShooting {
    fn name(&self) -> &'static str {
        "sg"
    }

    fn reciprocity(&self) -> Reciprocity {
        Reciprocity::NotPromised
    }

    fn compute(
        &self,
        input: Input<'_>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> Result<Computed, FormFactorError> {
        rows::by_rows(input, storage, progress, |rows| self.tile(input, rows))
    }

    fn rows<'a>(&'a self, input: Input<'a>) -> Option<Rows<'a>> {
        Some(Box::new(move |rows| self.tile(input, rows)))
    }
}

impl GaussShooting {
    fn tile(&self, input: Input<'_>, rows: Range<usize>) -> RowTile {
        let mut tile = RowTile::new(rows.start);
        let mut shooter = Shooter::new(input);
        let rule = GaussProduct::new(self.points);
        let rays_per_point = self.rays_per_point();
        for i in rows {
            let patch = &input.mesh.patches[i];
            let points = rule.on_polygon(&input.mesh.polygon(PatchId::from_index(i)));
            let shots = points.iter().enumerate().flat_map(|(p, point)| {
                let mut stream = PointStream::new(self.sequence, self.seed, (i * points.len() + p) as u64);
                let WeightedPoint { position, weight } = *point;
                (0..rays_per_point).map(move |_| {
                    let [_, _, u, v] = stream.next_point();
                    Shot {
                        point: position,
                        direction: [u, v],
                        weight,
                    }
                })
            });
            let (entries, tally) = shooter.row(patch, shots);
            tile.push_row(entries, tally);
        }
        tile
    }
}
