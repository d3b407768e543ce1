//! The system in the units of the solvers, and its residual.

use std::borrow::Cow;

use super::stop::{Norms, Tolerance, worst};
use super::system::RadiositySystem;
use super::twofold::Twofold;
use super::vectors::inner;
use crate::matrix::operator::{Block, RowAccess};
use crate::matrix::roundings;

/// A system in units near its greatest area and, per channel, its greatest exitance. The units are powers of two, so
/// that radiosities scale back exactly, and squares stay in range whatever the units of the scene are.
pub(super) struct Scaled<'a> {
    pub(super) system: &'a RadiositySystem<'a>,
    /// A.
    pub(super) areas: Vec<f64>,
    /// E.
    pub(super) exitance: Block,
    /// sqrt(Σ A E²) of each channel.
    exitance_l2: Vec<f64>,
    /// `None` where all patches are in one enclosure.
    rooms: Option<Rooms<'a>>,
}

/// The patches by connected component: no light passes between two of these.
struct Rooms<'a> {
    labels: &'a [u32],
    /// max |E| over each component, \[components, c\].
    units: Block,
    /// sqrt(Σ A E²) over each component in its unit, \[components, c\]; 0 where it emits nothing.
    exitance_l2: Block,
}

impl<'a> Rooms<'a> {
    fn of(system: &'a RadiositySystem, areas: &[f64], exitance: &Block) -> Option<Self> {
        let components = system.components();
        if components.n_components == 1 {
            return None;
        }
        let labels = components.labels.as_slice();
        let mut units = Block::zeros(components.n_components, exitance.n_channels());
        for (i, &label) in labels.iter().enumerate() {
            let of_room = units.row_mut(label as usize).iter_mut();
            of_room
                .zip(exitance.row(i))
                .for_each(|(unit, e)| *unit = unit.max(e.abs()));
        }
        let mut rooms = Self {
            labels,
            exitance_l2: units.clone(),
            units,
        };
        rooms.exitance_l2 = rooms.l2(areas, exitance);
        Some(rooms)
    }

    /// Returns sqrt(Σ A x²) over each component in its unit; 0 where it emits nothing.
    fn l2(&self, areas: &[f64], x: &Block) -> Block {
        let mut sums = Block::zeros(self.units.n_rows(), x.n_channels());
        for (i, (&label, area)) in self.labels.iter().zip(areas).enumerate() {
            let terms = x.row(i).iter().zip(self.units.row(label as usize));
            for (sum, (value, unit)) in sums.row_mut(label as usize).iter_mut().zip(terms) {
                if *unit > 0.0 {
                    *sum += area * (value / unit).powi(2);
                }
            }
        }
        sums.values_mut().iter_mut().for_each(|sum| *sum = sum.sqrt());
        sums
    }

    /// Returns for each channel the greatest of the relative norms of the components that emit, and of `least`; NaN where one is NaN.
    fn worst(&self, areas: &[f64], residual: &Block, least: &[f64]) -> Vec<f64> {
        let norms = self.l2(areas, residual);
        let mut greatest = least.to_vec();
        for room in 0..norms.n_rows() {
            for (c, most) in greatest.iter_mut().enumerate() {
                let (norm, light) = (norms.row(room)[c], self.exitance_l2.row(room)[c]);
                if light > 0.0 && !most.is_nan() {
                    let relative = norm / light;
                    *most = if relative.is_nan() {
                        relative
                    } else {
                        most.max(relative)
                    };
                }
            }
        }
        greatest
    }
}

/// The residual and the irradiance of given radiosities.
pub(super) struct TrueResidual {
    /// r = E − B + ρ H.
    pub(super) residual: Block,
    /// H = F B.
    pub(super) irradiance: Block,
    pub(super) norms: Norms,
    /// Whether it was calculated with twice the digits, or rounding counts in the norms: see [`Scaled::sharpened`].
    pub(super) is_sharp: bool,
}

/// The share of the tolerance that rounding in the residual may have without more digits.
const UNNOTICED: f64 = 0.1;

impl<'a> Scaled<'a> {
    pub(super) fn new(system: &'a RadiositySystem<'a>) -> Self {
        let areas: Vec<f64> = system.areas().iter().map(|a| a / system.area_unit()).collect();
        let mut exitance = system.exitance().clone();
        for_each_channel(&mut exitance, system.exitance_units(), |e, unit| *e /= unit);
        let exitance_l2 = l2(&areas, &exitance);
        Self {
            rooms: Rooms::of(system, &areas, &exitance),
            system,
            areas,
            exitance,
            exitance_l2,
        }
    }

    /// Returns whether all patches are in one enclosure.
    pub(super) fn is_one_room(&self) -> bool {
        self.rooms.is_none()
    }

    /// Returns zeros in the shape of B.
    pub(super) fn zeros(&self) -> Block {
        Block::zeros(self.system.n_patches(), self.system.n_channels())
    }

    /// Returns whether a channel emits nothing, and so has no light.
    pub(super) fn is_dark(&self, channel: usize) -> bool {
        self.exitance_l2[channel] <= 0.0
    }

    /// Removes the mean from `radiosity` in components whose mean is undetermined; returns whether there are any.
    pub(super) fn remove_free_means(&self, radiosity: &mut Block) -> bool {
        let mut any = false;
        for c in 0..self.system.n_channels() {
            for component in self.system.singular_components(c) {
                let labels = &self.system.components().labels;
                let members: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == component).collect();
                let area: f64 = members.iter().map(|&i| self.areas[i]).sum();
                let power: f64 = members.iter().map(|&i| self.areas[i] * radiosity.row(i)[c]).sum();
                any |= power.abs() > 0.0;
                for i in members {
                    radiosity.row_mut(i)[c] -= power / area;
                }
            }
        }
        any
    }

    /// Calculates the residual of `radiosity` with one pass over F.
    pub(super) fn true_residual(&self, radiosity: &Block) -> TrueResidual {
        let mut irradiance = self.zeros();
        self.system.operator().apply(radiosity, &mut irradiance);
        self.residual_of(radiosity, irradiance)
    }

    /// Calculates the residual of `radiosity`, of which `irradiance` = F B.
    pub(super) fn residual_of(&self, radiosity: &Block, irradiance: Block) -> TrueResidual {
        let mut residual = self.exitance.clone();
        let terms = radiosity.values().iter().zip(self.system.reflectance().values());
        for ((r, (b, rho)), h) in residual.values_mut().iter_mut().zip(terms).zip(irradiance.values()) {
            *r += rho * h - b;
        }
        let norms = self.norms(&residual);
        TrueResidual {
            residual,
            irradiance,
            norms,
            is_sharp: false,
        }
    }

    /// Returns the residual of `radiosity` accurately enough to decide on the tolerance.
    ///
    /// In bright rooms r is the difference of far greater numbers, and may be rounding, or be rounded to 0. Where it meets the tolerance and rounding, about
    /// (max(16 n^½, n / 8) + 70)^½ 2⁻⁵³ (|E| + |B| + ρ |H|), is above a tenth of that, r is calculated anew with sums and products in twice the digits, row by row. Without
    /// rows, rounding is added to the norms.
    /// Source: for the size of rounding, Higham and Mary, "A new approach to probabilistic rounding error analysis", SIAM J. Sci. Comput. 41 (2019).
    pub(super) fn sharpened(&self, tolerance: Tolerance, radiosity: &Block, truth: TrueResidual) -> TrueResidual {
        let is_met = |norms: &Norms, limit: f64| worst(&tolerance.excess(norms)) <= limit;
        if truth.is_sharp || !is_met(&truth.norms, 1.0) {
            return truth;
        }
        let mut rounding = self.sizes(radiosity, &truth.irradiance);
        let share = roundings(self.areas.len()).sqrt() * 0.5 * f64::EPSILON;
        rounding.values_mut().iter_mut().for_each(|size| *size *= share);
        let norms = self.norms(&rounding);
        if is_met(&norms, UNNOTICED) {
            return truth;
        }
        let sharp = self.sharp_residual(radiosity).unwrap_or_else(|| TrueResidual {
            norms: truth.norms.map_with(&norms, |r, more| r + more),
            ..truth
        });
        TrueResidual {
            is_sharp: true,
            ..sharp
        }
    }

    /// Calculates the residual with sums and products in twice the digits; `None` without rows.
    fn sharp_residual(&self, radiosity: &Block) -> Option<TrueResidual> {
        let n_channels = radiosity.n_channels();
        let of_rows = self.system.operator().of_rows(&|rows: &dyn RowAccess, i| {
            let mut sums = vec![Twofold::default(); n_channels];
            rows.visit_row(i, &mut |j, f| {
                for (sum, b) in sums.iter_mut().zip(radiosity.row(j)) {
                    sum.add_product(f, *b);
                }
            });
            let of_channel = |(c, h): (usize, &Twofold)| {
                let mut r = Twofold::default();
                r.add_multiple(self.system.reflectance().row(i)[c], h);
                r.add(self.exitance.row(i)[c]);
                r.add(-radiosity.row(i)[c]);
                [r.value(), h.value()]
            };
            sums.iter().enumerate().flat_map(of_channel).collect()
        })?;
        let (residual, irradiance) = of_rows.as_chunks().0.iter().map(|&[r, h]: &[f64; 2]| (r, h)).unzip();
        let residual = Block::from_values(residual, n_channels);
        Some(TrueResidual {
            norms: self.norms(&residual),
            residual,
            irradiance: Block::from_values(irradiance, n_channels),
            is_sharp: true,
        })
    }

    /// Returns |E| + |B| + ρ F |B|, to which the rounding of a residual is proportional.
    ///
    /// `irradiance` is F B; where B has both signs, the row sum times the greatest |B| replaces it.
    pub(super) fn sizes(&self, radiosity: &Block, irradiance: &Block) -> Block {
        let system = self.system;
        let mut sizes = self.exitance.clone();
        let of_signed = system.is_signed().then(|| self.greatest_arriving(radiosity));
        let arriving = of_signed.as_ref().unwrap_or(irradiance);
        let terms = radiosity
            .values()
            .iter()
            .zip(system.reflectance().values())
            .zip(arriving.values());
        for (size, ((b, rho), h)) in sizes.values_mut().iter_mut().zip(terms) {
            *size = size.abs() + b.abs() + rho * h.abs();
        }
        sizes
    }

    /// Returns the row sum times the greatest |B|.
    fn greatest_arriving(&self, radiosity: &Block) -> Block {
        let n_channels = radiosity.n_channels();
        let mut greatest = vec![0.0_f64; n_channels];
        for row in radiosity.values().chunks_exact(n_channels) {
            greatest
                .iter_mut()
                .zip(row)
                .for_each(|(most, b)| *most = most.max(b.abs()));
        }
        let of_row = |sum: &f64| greatest.iter().map(|most| sum * most).collect::<Vec<_>>();
        Block::from_values(self.system.row_sums().iter().flat_map(of_row).collect(), n_channels)
    }

    /// Returns the norms of a residual, in SI units.
    pub(super) fn norms(&self, residual: &Block) -> Norms {
        let n_channels = residual.n_channels();
        let mut max_power = vec![0.0; n_channels];
        let mut max = vec![0.0; n_channels];
        let mut euclidean = vec![0.0; n_channels];
        for c in 0..n_channels {
            let channel: Cow<[f64]> = if n_channels == 1 {
                residual.values().into()
            } else {
                residual.values().iter().skip(c).step_by(n_channels).copied().collect()
            };
            [max_power[c], max[c], euclidean[c]] = magnitudes(&self.areas, &channel);
        }
        let mut relative = l2(&self.areas, residual);
        for (c, norm) in relative.iter_mut().enumerate() {
            let unit = self.system.exitance_units()[c];
            max[c] *= unit;
            euclidean[c] = euclidean[c].sqrt() * unit;
            // One after the other: their product alone may be out of range.
            max_power[c] = max_power[c] * self.system.area_unit() * unit;
            if norm.is_nan() {
                // f64::max ignores NaN; the sum of squares does not.
                max[c] = f64::NAN;
                max_power[c] = f64::NAN;
            } else if *norm > 0.0 {
                *norm /= self.exitance_l2[c];
            }
        }
        let of_rooms = |rooms: &Rooms| rooms.worst(&self.areas, residual, &relative);
        Norms {
            room_l2: self.rooms.as_ref().map_or_else(|| relative.clone(), of_rooms),
            l2: relative,
            max_power,
            max,
            euclidean,
        }
    }

    /// Returns a block of radiosities or irradiances in solver units.
    #[expect(clippy::wrong_self_convention, reason = "it converts the block, not the system")]
    pub(super) fn from_si(&self, mut block: Block) -> Block {
        for_each_channel(&mut block, self.system.exitance_units(), |value, unit| *value /= unit);
        block
    }

    /// Returns a block of radiosities or irradiances in W·m⁻².
    pub(super) fn to_si(&self, mut block: Block) -> Block {
        for_each_channel(&mut block, self.system.exitance_units(), |value, unit| *value *= unit);
        block
    }
}

/// Returns max A |r|, max |r| and Σ r².
fn magnitudes(areas: &[f64], residual: &[f64]) -> [f64; 3] {
    /// The number of independent sums and maxima.
    const LANES: usize = 8;
    let mut found = [[0.0_f64; LANES]; 3];
    let mut add = |lane: usize, area: f64, r: f64| {
        found[0][lane] = found[0][lane].max(r.abs() * area);
        found[1][lane] = found[1][lane].max(r.abs());
        found[2][lane] += r * r;
    };
    let (area_chunks, last_areas) = areas.as_chunks::<LANES>();
    let (chunks, last) = residual.as_chunks::<LANES>();
    for (of_areas, of_residual) in area_chunks.iter().zip(chunks) {
        for lane in 0..LANES {
            add(lane, of_areas[lane], of_residual[lane]);
        }
    }
    for (lane, (&area, &r)) in last_areas.iter().zip(last).enumerate() {
        add(lane, area, r);
    }
    let [max_power, max, squares] = found;
    let greatest = |lanes: [f64; LANES]| lanes.into_iter().fold(0.0, f64::max);
    [greatest(max_power), greatest(max), squares.into_iter().sum()]
}

fn for_each_channel(block: &mut Block, units: &[f64], change: impl Fn(&mut f64, f64)) {
    for (value, &unit) in block.values_mut().iter_mut().zip(units.iter().cycle()) {
        change(value, unit);
    }
}

/// Returns sqrt(Σ A x²) of each channel.
pub(super) fn l2(areas: &[f64], x: &Block) -> Vec<f64> {
    inner(areas, x, x).into_iter().map(f64::sqrt).collect()
}
