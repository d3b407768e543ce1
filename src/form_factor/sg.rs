//! `sg`: shooting from Gauss points.

use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::Arc;

use super::bounds::Unoccluded;
use super::entry::{MethodEntry, Work};
use super::on_the_fly::Rows;
use super::point_errors::{Found, PointErrors};
use super::settings::{FIVE_POINTS, MethodSettings, SHOT_RAYS, SOBOL};
use super::shooting::{Shooter, Shot, n_nets};
use super::{ComputeResult, FormFactorMethod, Input, Reciprocity, rows, upper_bounds};
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::geometry::sampling::{PointStream, Sequence};
use crate::matrix::{Entry, RowTally, RowTile, StorageChoice};
use crate::mesh::PatchId;
use crate::progress::Progress;

/// Shooting from q × q Gauss points, each with its Gauss weight ("SG5", "SG10"; printed as SD5, SD10 in places).
///
/// F_ij ≈ Σ_p w_p (rays from point p whose first hit is the front of j) / m, with the same number m of rays for every point.
/// Biased by the Gauss rule's own error, which does not fall with the number of rays: the inner integral has a kink or a jump
/// where j touches or is hidden from a part of i.
/// Error of an entry: the noise, by Laplace's rule as points differ in weight, with k^(−1/8) for the k hits of a point's rays where these are of a sequence, plus an estimate of the rule's own error.
/// From 3 points a side on that is the distance of the rules through every other line of points (along either side of the patch), less twice its noise. For patches near each other or
/// behind each other's planes it is also the distance of the rule from the factor without occluders, as far as they are visible: where the points miss an edge between them, that alone shows it.
/// An entry that no ray hit states 1.5 / N and the factor without occluders that the points miss, up to that factor, with sqrt(2/((n + 2)(n + 3))) of it for the part that n = q² points may all miss.
/// From 1 and 2 points, where there is no such rule: the error of [`Hemicube`](super::Hemicube), also of patches that no ray hit, for the price of a closed form for each pair.
/// Source: Baranoski, Bramley and Shirley 1995, appendix A. Departures: the directions come from a Sobol sequence by default;
/// rays are rounded up to a whole number for each point.
#[derive(Clone, Copy, Debug)]
pub struct GaussShooting {
    /// q, the number of Gauss points along each side.
    pub points: NonZeroUsize,
    /// The number of rays of each patch; rounded up to a multiple of q².
    pub rays: u64,
    /// The source of the numbers.
    pub sequence: Sequence,
    /// The seed of all streams.
    pub seed: u64,
}

pub(super) const ENTRY: MethodEntry = MethodEntry {
    name: "sg",
    summary: "Shooting from Q × Q Gauss points",
    settings: &[SHOT_RAYS, SOBOL, FIVE_POINTS],
    work: Work::RowsOfRays,
    make: |s| GaussShooting::boxed(s.points(), s),
};

pub(super) const OF_5_POINTS: MethodEntry = MethodEntry {
    name: "sg5",
    summary: "Shooting from 5 × 5 Gauss points",
    settings: &[SHOT_RAYS, SOBOL],
    make: |s| GaussShooting::boxed(NonZeroUsize::new(5), s),
    ..ENTRY
};

pub(super) const OF_10_POINTS: MethodEntry = MethodEntry {
    name: "sg10",
    summary: "Shooting from 10 × 10 Gauss points",
    settings: &[SHOT_RAYS, SOBOL],
    make: |s| GaussShooting::boxed(NonZeroUsize::new(10), s),
    ..ENTRY
};

impl GaussShooting {
    fn boxed(points: Option<NonZeroUsize>, settings: &MethodSettings) -> Option<Box<dyn FormFactorMethod>> {
        Some(Box::new(Self {
            points: points?,
            rays: settings.rays()?,
            sequence: settings.sequence()?,
            seed: settings.seed,
        }))
    }
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

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        if GaussProduct::new(self.points).coarser().is_none() {
            let errors = PointErrors::new(input);
            let errors = RuleErrors::OfFew(&errors);
            return rows::by_rows(input, storage, progress, None, |rows| self.tile(input, rows, &errors));
        }
        let bounds = upper_bounds(input.mesh, Some(self.points));
        let errors = RuleErrors::OfNear(&bounds);
        rows::by_rows(input, storage, progress, Some(Arc::clone(&bounds) as _), |rows| {
            self.tile(input, rows, &errors)
        })
    }

    fn rows<'a>(&'a self, input: Input<'a>) -> Option<Rows<'a>> {
        // The errors of rows that are not stored are not used.
        Some(Box::new(move |rows| self.tile(input, rows, &RuleErrors::Unasked)))
    }
}

impl GaussShooting {
    fn tile(&self, input: Input<'_>, rows: Range<usize>, errors: &RuleErrors<'_>) -> RowTile {
        let mut tile = RowTile::new(rows.start);
        let rule = GaussProduct::new(self.points);
        let changes = rule.coarser();
        let q = self.points.get();
        let mut shooter = Shooter::new(input, n_nets(self.sequence, q * q), changes.is_some());
        let rays_per_point = self.rays_per_point();
        for i in rows {
            let patch = &input.mesh.patches[i];
            let points = rule.on_polygon(&input.mesh.polygon(PatchId::from_index(i)));
            let shots = points.iter().enumerate().flat_map(|(p, point)| {
                let mut stream = PointStream::new(self.sequence, self.seed, (i * points.len() + p) as u64);
                let WeightedPoint { position, weight } = *point;
                let change = |node: usize| changes.as_ref().map_or(0.0, |of_node| of_node[node]);
                let coarser = [change(p % q), change(p / q)];
                (0..rays_per_point).map(move |_| {
                    let [_, _, u, v] = stream.next_point();
                    Shot {
                        point: position,
                        direction: [u, v],
                        weight,
                        coarser,
                    }
                })
            });
            let (entries, tally) = shooter.row(patch, shots);
            match errors {
                RuleErrors::Unasked => tile.push_row(entries, tally),
                RuleErrors::OfNear(bounds) => {
                    for (j, factor, error) in &mut *entries {
                        *error += bounds.rule_error(i, *j as usize, &points, *factor);
                    }
                    tile.push_row(entries, tally);
                }
                RuleErrors::OfFew(errors) => {
                    let entries = with_errors(entries, &tally, |found| errors.of_row(i, &points, found), input);
                    tile.push_row(&entries, tally);
                }
            }
        }
        tile
    }
}

/// The estimate of the rule's errors, beside the rules through every other line.
enum RuleErrors<'a> {
    /// None, for rows that are not stored.
    Unasked,
    /// The closed form at the points, for patches near each other.
    OfNear(&'a Unoccluded),
    /// That of [`PointErrors`], for rules without a coarser one.
    OfFew(&'a PointErrors<'a>),
}

/// Adds the errors from `errors_of` to the noise of a row's entries, and those of patches that no ray hit.
fn with_errors(
    entries: &[Entry],
    tally: &RowTally,
    errors_of: impl Fn(&[Found]) -> Vec<f64>,
    input: Input<'_>,
) -> Vec<Entry> {
    let n = input.mesh.n_patches();
    let n_rays = tally.effective_rays().unwrap_or(0.0);
    let (mut found, mut noise) = (vec![Found::default(); n], vec![0.0; n]);
    for &(j, factor, of_entry) in entries {
        // A count of rays of equal weight.
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number of rays"
        )]
        let n_rays = (n_rays * factor).ceil() as u64;
        found[j as usize] = Found { factor, n_rays };
        noise[j as usize] = of_entry;
    }
    let errors = errors_of(&found);
    (0_u32..)
        .zip(found.iter().zip(noise).zip(errors))
        .map(|(j, ((found, noise), error))| (j, found.factor, noise + error))
        .collect()
}
