//! Form factors between surfaces, from those between their patches.

use std::ops::Range;

use super::form_factors::FormFactors;
use super::tile::laplace;
use crate::threads;

/// Surfaces whose rows are computed at the same time.
const AT_ONCE: usize = 256;

/// The most sums of patches that are held for that.
const NUMBERS_AT_ONCE: usize = 1 << 24;

/// Form factors between surfaces: the fraction of the light leaving S, equally bright all over, that reaches T.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceFormFactors {
    /// The number of surfaces.
    pub n_surfaces: usize,
    /// A_S, m².
    pub areas: Vec<f64>,
    /// F_ST, row-major \[n_surfaces, n_surfaces\].
    pub form_factor: Vec<f64>,
    /// An estimate of the absolute error of each F_ST, same shape.
    pub error: Vec<f64>,
    /// The fraction of the light leaving S that no front receives, 1 − Σ_T F_ST: it escapes or meets back faces, up to the errors of the rows.
    pub lost_factor: Vec<f64>,
}

/// Form factors from one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceRow {
    /// A_S, m².
    pub area: f64,
    /// F_ST of every surface T.
    pub form_factor: Vec<f64>,
    /// An estimate of the absolute error of each F_ST.
    pub error: Vec<f64>,
    /// 1 − Σ_T F_ST.
    pub lost_factor: f64,
}

/// Form factors between surfaces one row at a time, where all of them may be too many: see [`FormFactors::surface_rows`].
#[derive(Clone, Debug)]
pub struct SurfaceRows<'a> {
    factors: &'a FormFactors,
    patch_surface: &'a [u32],
    /// The patches of each surface.
    patches: Vec<Vec<usize>>,
}

impl FormFactors {
    /// Returns the form factors between surfaces, with errors that account for the common rays of patches.
    ///
    /// F_ST = Σ_{i∈S} A_i F_iT / A_S with F_iT = Σ_{j∈T} F_ij. `patch_surface` names the surface of each patch; a
    /// surface without patches has zeros.
    ///
    /// Error: within a row made of N rays the entries compete for the same rays, so F_iT is itself one binomial fraction.
    /// Its variance is p (1 − p) / N with p = (N F_iT + 1) / (N + 2), which does not vanish where no ray, or every ray,
    /// hit T; N is [`effective_rays`](super::RowTally::effective_rays). Stratified rays err less than this. Rows are
    /// independent: error² = Σ (A_i / A_S)² variance_i. Rows without rays, and all rows of a symmetrised or balanced
    /// matrix, where each number comes from two rows, contribute the sum of their entries' standard errors,
    /// Σ (A_i / A_S) Σ_j, as if all were off in the same direction. Patches no ray of which has met T add the error of such a row. So does the error of an entry of a row of rays
    /// beyond its noise, the bias of a rule.
    /// Source: sums of multinomial counts. Departures: none.
    ///
    /// Memory: 16 n_surfaces² bytes, and as much again while they are built; [`surface_rows`](Self::surface_rows) needs neither.
    ///
    /// # Panics
    /// If `patch_surface` does not name one of the surfaces for every patch.
    #[must_use]
    #[track_caller]
    pub fn surface_form_factors(&self, patch_surface: &[u32], n_surfaces: usize) -> SurfaceFormFactors {
        let rows: Vec<SurfaceRow> = self.surface_rows(patch_surface, n_surfaces).iter().collect();
        SurfaceFormFactors {
            n_surfaces,
            areas: rows.iter().map(|row| row.area).collect(),
            form_factor: rows.iter().flat_map(|row| row.form_factor.iter().copied()).collect(),
            error: rows.iter().flat_map(|row| row.error.iter().copied()).collect(),
            lost_factor: rows.iter().map(|row| row.lost_factor).collect(),
        }
    }

    /// Returns the form factors of [`surface_form_factors`](Self::surface_form_factors) one row at a time.
    ///
    /// # Panics
    /// If `patch_surface` does not name one of the surfaces for every patch.
    #[must_use]
    #[track_caller]
    pub fn surface_rows<'a>(&'a self, patch_surface: &'a [u32], n_surfaces: usize) -> SurfaceRows<'a> {
        assert_eq!(patch_surface.len(), self.n_rows(), "one surface per patch");
        assert!(
            patch_surface.iter().all(|&s| (s as usize) < n_surfaces),
            "every surface is one of n_surfaces"
        );
        let mut patches = vec![Vec::new(); n_surfaces];
        for (i, &surface) in patch_surface.iter().enumerate() {
            patches[surface as usize].push(i);
        }
        SurfaceRows {
            factors: self,
            patch_surface,
            patches,
        }
    }
}

impl SurfaceRows<'_> {
    /// Returns the rows of all surfaces in order, each computed when needed. Collective.
    pub fn iter(&self) -> impl Iterator<Item = SurfaceRow> {
        let n = self.patches.len();
        let starts = (0..n).step_by(AT_ONCE);
        starts.flat_map(move |start| self.rows(start..n.min(start + AT_ONCE)))
    }

    /// Returns 1 − Σ_T F_ST of every surface S, with far less work than the rows. Collective.
    #[must_use]
    pub fn lost_factors(&self) -> Vec<f64> {
        let row_sums = self.factors.row_sums();
        let lost = |patches: &Vec<usize>| {
            let area = self.area(patches);
            patches
                .iter()
                .map(|&i| self.factors.areas[i] / area * (1.0 - row_sums[i]))
                .sum()
        };
        self.patches.iter().map(lost).collect()
    }

    fn area(&self, patches: &[usize]) -> f64 {
        patches.iter().map(|&i| self.factors.areas[i]).sum()
    }

    /// Returns the rows of some surfaces; each rank adds the sums of its own patches.
    fn rows(&self, some: Range<usize>) -> Vec<SurfaceRow> {
        let n_surfaces = self.patches.len();
        let n_numbers = 2 * n_surfaces + 1;
        let surfaces = &self.patches[some];
        let mut all: Vec<usize> = surfaces.concat();
        all.sort_unstable();
        let of_rank = self.factors.own_rows();
        let nothing = |patches: &Vec<usize>| {
            let row = SurfaceRow {
                area: self.area(patches),
                form_factor: vec![0.0; n_surfaces],
                error: vec![0.0; n_surfaces],
                lost_factor: 0.0,
            };
            (row, vec![0.0; n_surfaces])
        };
        let mut rows: Vec<(SurfaceRow, Vec<f64>)> = surfaces.iter().map(nothing).collect();
        for part in all.chunks((NUMBERS_AT_ONCE / n_numbers).max(1)) {
            let own: Vec<usize> = part.iter().copied().filter(|i| of_rank.contains(i)).collect();
            let own = threads::collect_from(&own, |&i| self.sums_of_patch(i));
            // Ranks have rows in order, and so the patches come in order.
            let sums = self.factors.gathered(own.concat());
            let sums: Vec<&[f64]> = sums.chunks_exact(n_numbers).collect();
            let (first, last) = (part[0], part[part.len() - 1]);
            threads::for_each_chunk(true, &mut rows, 1, |surface, of_one| {
                let ((row, variance), patches) = (&mut of_one[0], &surfaces[surface]);
                let begin = patches.partition_point(|i| *i < first);
                for &i in patches[begin..].iter().take_while(|i| **i <= last) {
                    let numbers = sums[part.partition_point(|other| *other < i)];
                    self.add(row, variance, i, numbers);
                }
            });
        }
        let finish = |(mut row, variance): (SurfaceRow, Vec<f64>)| {
            row.error
                .iter_mut()
                .zip(variance)
                .for_each(|(error, v)| *error += v.sqrt());
            row
        };
        rows.into_iter().map(finish).collect()
    }

    /// Returns the sums of a patch's form factors to each surface, of their errors, and of all form factors.
    fn sums_of_patch(&self, i: usize) -> Vec<f64> {
        let (factors, n_surfaces) = (self.factors, self.patches.len());
        let mut numbers = vec![0.0; 2 * n_surfaces + 1];
        let (sums, errors) = numbers.split_at_mut(n_surfaces);
        let n_rays = factors.tallies[i].effective_rays().filter(|_| !factors.is_symmetric());
        factors.for_each_in_row(i, |j, value, std_error| {
            let to = self.patch_surface[j] as usize;
            sums[to] += value;
            errors[n_surfaces] += value;
            errors[to] += match n_rays {
                None => std_error,
                Some(_) => factors.beyond_noise(i, value, std_error),
            };
        });
        numbers
    }

    /// Adds patch i to the row of its surface, whose `error` is that without noise, and to the variances of its noise.
    fn add(&self, row: &mut SurfaceRow, variance: &mut [f64], i: usize, numbers: &[f64]) {
        let (factors, n_surfaces) = (self.factors, self.patches.len());
        let (sums, errors) = numbers.split_at(n_surfaces);
        let n_rays = factors.tallies[i].effective_rays().filter(|_| !factors.is_symmetric());
        let weight = factors.areas[i] / row.area;
        // No count proves that there is nothing, whatever was done to the counts later: where errors are added up, the entries that no ray hit are one more cell.
        let counted = factors.tallies[i].effective_rays();
        for t in 0..n_surfaces {
            row.form_factor[t] += weight * sums[t];
            if let Some(n) = counted {
                let seen = n_rays.map_or(0.0, |_| sums[t]);
                let p = laplace(n, seen).clamp(0.0, 1.0);
                variance[t] += weight * weight * p * (1.0 - p) / n;
            }
            row.error[t] += weight * errors[t];
        }
        row.lost_factor += weight * (1.0 - errors[n_surfaces]);
    }
}
