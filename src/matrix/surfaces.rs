//! Form factors between surfaces, from those between their patches.

use rayon::prelude::*;

use super::form_factors::FormFactors;
use super::tile::laplace;

/// Surfaces whose rows are calculated at the same time.
const AT_ONCE: usize = 256;

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
    /// The fraction of the light leaving S that no front receives, 1 − Σ_T F_ST: it escapes or meets black backs, up to the errors of the rows.
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

/// Form factors between surfaces a row at a time, where all of them may be too many: see [`FormFactors::surface_rows`].
#[derive(Clone, Debug)]
pub struct SurfaceRows<'a> {
    factors: &'a FormFactors,
    patch_surface: &'a [u32],
    /// The patches of each surface.
    patches: Vec<Vec<usize>>,
}

impl FormFactors {
    /// Returns the form factors between surfaces, with errors that respect what the patches' rays have in common.
    ///
    /// F_ST = Σ_{i∈S} A_i F_iT / A_S with F_iT = Σ_{j∈T} F_ij. `patch_surface` names the surface of each patch; a
    /// surface without patches has zeros.
    ///
    /// Error: within a row made of N rays the entries compete for the same rays, so F_iT is itself one binomial fraction.
    /// Its variance is p (1 − p) / N with p = (N F_iT + 1) / (N + 2), which does not vanish where no ray, or every ray,
    /// hit T; N is [`effective_rays`](super::RowTally::effective_rays). Stratified rays err less than this. Rows are
    /// independent: error² = Σ (A_i / A_S)² variance_i. Rows without rays, and all rows of a symmetrised or balanced
    /// matrix, where each number comes from two rows, contribute the sum of their entries' standard errors,
    /// Σ (A_i / A_S) Σ_j, as if all were off in the same direction, beside the error of a row that no ray of which has met T, for the patches that none has. So does what an entry of a row of rays states beyond its noise: the bias of a rule.
    /// Source: sums of multinomial counts. Departures: none.
    ///
    /// Memory: 16 n_surfaces² bytes, and as much again while they are put together; [`surface_rows`](Self::surface_rows) does without.
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

    /// Returns what gives [`surface_form_factors`](Self::surface_form_factors) a row at a time.
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
    /// Returns the rows of all surfaces in order, each when it is due.
    pub fn iter(&self) -> impl Iterator<Item = SurfaceRow> {
        self.patches.chunks(AT_ONCE).flat_map(|some| {
            let rows = some.par_iter().map(|patches| self.row(patches));
            rows.collect::<Vec<_>>()
        })
    }

    /// Returns 1 − Σ_T F_ST of every surface S: far less work than the rows.
    #[must_use]
    pub fn lost_factors(&self) -> Vec<f64> {
        self.patches
            .par_iter()
            .map(|patches| self.lost_factor(patches))
            .collect()
    }

    fn lost_factor(&self, patches: &[usize]) -> f64 {
        let area = |i: usize| self.factors.areas[i];
        let whole: f64 = patches.iter().map(|&i| area(i)).sum();
        let lost = |&i: &usize| area(i) / whole * (1.0 - self.factors.row_sum(i));
        patches.iter().map(lost).sum()
    }

    fn row(&self, patches: &[usize]) -> SurfaceRow {
        let (factors, n_surfaces) = (self.factors, self.patches.len());
        let area: f64 = patches.iter().map(|&i| factors.areas[i]).sum();
        let mut form_factor = vec![0.0; n_surfaces];
        let mut variance = vec![0.0; n_surfaces];
        let mut common = vec![0.0; n_surfaces];
        let (mut sums, mut errors) = (vec![0.0; n_surfaces], vec![0.0; n_surfaces]);
        for &i in patches {
            sums.fill(0.0);
            errors.fill(0.0);
            let n_rays = factors.tallies[i].effective_rays().filter(|_| !factors.is_symmetric());
            factors.for_each_in_row(i, |j, value, std_error| {
                let to = self.patch_surface[j] as usize;
                sums[to] += value;
                errors[to] += match n_rays {
                    None => std_error,
                    Some(_) => factors.beyond_noise(i, value, std_error),
                };
            });
            let weight = factors.areas[i] / area;
            // No count proves that there is nothing, whatever became of the counts afterwards: where errors are added up, what no ray hit is one more cell.
            let counted = factors.tallies[i].effective_rays();
            for t in 0..n_surfaces {
                form_factor[t] += weight * sums[t];
                if let Some(n) = counted {
                    let seen = n_rays.map_or(0.0, |_| sums[t]);
                    let p = laplace(n, seen).clamp(0.0, 1.0);
                    variance[t] += weight * weight * p * (1.0 - p) / n;
                }
                common[t] += weight * errors[t];
            }
        }
        let error = variance.iter().zip(&common).map(|(v, c)| v.sqrt() + c).collect();
        SurfaceRow {
            area,
            form_factor,
            error,
            lost_factor: self.lost_factor(patches),
        }
    }
}
