//! Conservation checks of solutions.

use super::{At, Audit, Law, Worst};
use crate::matrix::operator::Block;
use crate::matrix::roundings;
use crate::solver::{RadiositySystem, Solution, SolverError};

/// The input of an audit beside a system and its solution.
#[derive(Clone, Copy, Debug, Default)]
pub struct Given<'a> {
    /// The power that form factors without reciprocity create, m²; `None` where it is not known.
    ///
    /// See [`FormFactorAudit::gain`](super::FormFactorAudit::gain).
    pub gain: Option<&'a [f64]>,
    /// True if the audit must not make a pass over F because of its cost, as where it computes F again.
    pub costly: bool,
}

/// Checks a solution: its values, its irradiances and residual, the power balance, and bounds; one pass over F.
///
/// It is to be finite, its irradiances and residual are to be those stated, power is to be conserved, and no patch may be darker or brighter than
/// the patches of the scene would be in furnaces of their own.
///
/// With R = max |r_i A_i| as the solver states it, min_i (E_i − R / A_i) / (1 − ρ_i s_i) ≤ B ≤ max_i (E_i + R / A_i) / (1 − ρ_i s_i), s_i = Σ_j F_ij: for the
/// constant m on the right, (I − diag(ρ) F)(m − B) ≥ 0, and the inverse is not negative; in the same way for the one on the left. Energy:
/// |emitted − absorbed − escaped + Σ_i B_i g_i| = |Σ A r| ≤ sqrt(Σ A) sqrt(Σ A r²), with g the gain of form factors without reciprocity.
/// All is judged in units of each channel's greatest exitance and of the greatest area, so that no light is too bright or too dim for the arithmetic.
/// Source: Berman and Plemmons, "Nonnegative Matrices in the Mathematical Sciences", chapter 6, theorem 2.3. Departures: none.
///
/// # Errors
/// [`SolverError::Disk`] if F cannot be read.
///
/// # Panics
/// If the solution has not the shape of the system.
#[track_caller]
pub fn solution(system: &RadiositySystem, solution: &Solution, given: Given<'_>) -> Result<Audit, SolverError> {
    let (b, h) = (&solution.radiosity, &solution.irradiance);
    let n = system.n_patches();
    assert!(
        b.n_rows() == n && b.n_channels() == system.n_channels(),
        "one radiosity per patch and channel"
    );
    let units = Units::of(system.exitance(), system.areas());
    let scaled = Scaled {
        system,
        exitance: units.scaled(system.exitance()),
        radiosity: units.scaled(b),
        irradiance: units.scaled(h),
        units,
    };
    let reflecting = Reflecting {
        reflectance: system.reflectance(),
        exitance: &scaled.exitance,
        row_sums: system.row_sums(),
        light: &scaled.units.light,
    };
    let slack = |i: usize, c: usize| solution.residual_max_power / system.areas()[i] / scaled.units.light[c];
    let mut audit = Audit::default();
    let lights = [
        (&scaled.radiosity, 1.0),
        (&scaled.irradiance, greatest(system.row_sums())),
    ];
    audit.checks.push(if system.is_signed() {
        light(&lights, &scaled.units.light, None)
    } else {
        light(&lights, &scaled.units.light, Some(&|c| reflecting.below_zero(slack, c)))
    });
    if given.costly {
        let reason = "every pass computes the form factors again";
        audit.skip(Law::Irradiance, reason);
        audit.skip(Law::Residual, reason);
    } else {
        let mut f_b = Block::zeros(n, b.n_channels());
        system.operator().apply(&scaled.radiosity, &mut f_b);
        if let Some(error) = system.operator().failure() {
            return Err(error.clone().into());
        }
        audit.checks.push(scaled.irradiance(&f_b));
        audit.checks.push(scaled.residual(solution, &f_b));
    }
    match given.gain {
        Some(gain) if solution.energy.len() == b.n_channels() => match scaled.energy(solution, gain) {
            Some(check) => audit.checks.push(check),
            None => audit.skip(Law::Energy, "the power of so much light is above all numbers"),
        },
        Some(_) => audit.skip(Law::Energy, "the solution does not state it"),
        None => audit.skip(
            Law::Energy,
            "what form factors without reciprocity make or lose is not known",
        ),
    }
    furnaces(&mut audit, &reflecting, &scaled.radiosity, slack, true);
    Ok(audit)
}

/// Checks radiosities that were propagated from B = E: they are finite, at least the exitance, and at most that of the brightest furnace.
///
/// Whatever the number of passes, E ≤ B ≤ max_i E_i / (1 − ρ_i s_i), because F is not negative.
/// `reflectance`, `exitance`, `radiosity`, `irradiance`: ρ, E, B, H, \[n, c\]; `row_sums`: s_i, \[n\].
///
/// # Panics
/// If shapes differ.
#[must_use]
#[track_caller]
pub fn propagation(
    reflectance: &Block,
    exitance: &Block,
    row_sums: &[f64],
    radiosity: &Block,
    irradiance: &Block,
) -> Audit {
    assert!(
        exitance.values().len() == radiosity.values().len()
            && reflectance.values().len() == radiosity.values().len()
            && row_sums.len() == radiosity.n_rows(),
        "blocks of one shape, and one sum per row"
    );
    let mut audit = Audit::default();
    let units = Units::of(exitance, &[]);
    let [exitance, radiosity, irradiance] = [exitance, radiosity, irradiance].map(|block| units.scaled(block));
    let lights = [(&radiosity, 1.0), (&irradiance, 1.0)];
    audit.checks.push(light(&lights, &units.light, Some(&|_| 0.0)));
    let mut least = Worst::default();
    for (at, i, c) in places(&radiosity) {
        let (b, e) = (radiosity.row(i)[c], exitance.row(i)[c]);
        least.see_in(units.light[c], (e - b).max(0.0), 4.0 * f64::EPSILON * e, at);
    }
    audit.checks.push(least.check(Law::LeastRadiosity));
    let reflecting = Reflecting {
        reflectance,
        exitance: &exitance,
        row_sums,
        light: &units.light,
    };
    furnaces(&mut audit, &reflecting, &radiosity, |_, _| 0.0, false);
    audit
}

/// Checks that no light passes between regions of air that surfaces close off from each other.
///
/// `leak_power`: the power that passes, W, \[c\].
#[must_use]
pub fn sides(leak_power: &[f64]) -> Audit {
    let mut worst = Worst::default();
    for (c, power) in leak_power.iter().enumerate() {
        worst.see(*power, 0.0, At::default().channel(c));
    }
    Audit {
        checks: vec![worst.check(Law::Sides)],
        not_checked: Vec::new(),
    }
}

/// The bounds of a furnace's brightness; light in its units.
struct Reflecting<'a> {
    reflectance: &'a Block,
    exitance: &'a Block,
    row_sums: &'a [f64],
    /// The units, W·m⁻², \[c\].
    light: &'a [f64],
}

impl Reflecting<'_> {
    /// Returns min_i (1 − ρ_i s_i): at 0 and below there is no furnace.
    fn absorbed_min(&self, c: usize) -> f64 {
        let rows = self.row_sums.iter().enumerate();
        rows.fold(f64::INFINITY, |least, (i, sum)| {
            let own = 1.0 - self.reflectance.row(i)[c] * sum;
            if own.is_nan() { own } else { least.min(own) }
        })
    }

    /// Returns how far below 0 the residuals `slack` can bring a radiosity, in solutions of light.
    fn below_zero(&self, slack: impl Fn(usize, usize) -> f64, c: usize) -> f64 {
        let n = self.row_sums.len();
        let most = (0..n).map(|i| slack(i, c)).fold(0.0, f64::max);
        let absorbed = self.absorbed_min(c);
        if absorbed > rounding(n) { most / absorbed } else { most }
    }
}

/// Powers of two near each channel's greatest exitance, W·m⁻², \[c\], and the greatest area, m².
struct Units {
    light: Vec<f64>,
    area: f64,
}

/// Returns the power of two at or below the greatest of some values: a unit in which rounding does not change.
///
/// It is within the range of f64, so that its inverse is a number too.
fn unit_of(greatest: f64) -> f64 {
    if greatest.is_finite() && greatest > 0.0 {
        greatest.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

impl Units {
    fn of(exitance: &Block, areas: &[f64]) -> Self {
        let in_channel = |c: usize| {
            let values = (0..exitance.n_rows()).map(|i| exitance.row(i)[c].abs());
            unit_of(values.fold(0.0, f64::max))
        };
        Self {
            light: (0..exitance.n_channels()).map(in_channel).collect(),
            area: unit_of(greatest(areas)),
        }
    }

    /// Returns light in these units.
    fn scaled(&self, block: &Block) -> Block {
        let mut scaled = block.clone();
        for (k, value) in scaled.values_mut().iter_mut().enumerate() {
            *value /= self.light[k % self.light.len()];
        }
        scaled
    }
}

/// A system and its solution, light in units of its own.
struct Scaled<'a> {
    system: &'a RadiositySystem<'a>,
    exitance: Block,
    radiosity: Block,
    irradiance: Block,
    units: Units,
}

/// Returns the possible rounding of the sums of a pass, relative to their terms; see the operator of [`FormFactors`](crate::matrix::FormFactors).
fn rounding(n: usize) -> f64 {
    roundings(n) * f64::EPSILON
}

/// Returns the places of a block in storage order.
fn places(block: &Block) -> impl Iterator<Item = (At, usize, usize)> {
    let n_channels = block.n_channels();
    (0..block.values().len()).map(move |k| {
        let (i, c) = (k / n_channels, k % n_channels);
        (At::patch(i).channel(c), i, c)
    })
}

/// Checks blocks of light, each with a factor to `below_zero`.
///
/// That returns how far below 0 a radiosity may be in a channel; `None` where light has signs.
fn light(blocks: &[(&Block, f64)], units: &[f64], below_zero: Option<&dyn Fn(usize) -> f64>) -> super::Check {
    let mut worst = Worst::default();
    let allowed: Vec<f64> = (0..units.len()).map(|c| below_zero.map_or(0.0, |f| f(c))).collect();
    for &(block, factor) in blocks {
        for (at, i, c) in places(block) {
            let value = block.row(i)[c];
            let deviation = match (value.is_finite(), below_zero) {
                (false, _) => f64::INFINITY,
                (true, None) => 0.0,
                (true, Some(_)) => (-value).max(0.0),
            };
            worst.see_in(units[c], deviation, factor * allowed[c], at);
        }
    }
    worst.check(Law::Finite)
}

impl Scaled<'_> {
    fn irradiance(&self, f_b: &Block) -> super::Check {
        let rounding = rounding(self.system.n_patches());
        let mut worst = Worst::default();
        for (at, i, c) in places(f_b) {
            let unit = self.units.light[c];
            // The returned value may be too dim for all of its digits.
            let grain = f64::from_bits(1) / unit;
            let expected = f_b.row(i)[c];
            let deviation = (self.irradiance.row(i)[c] - expected).abs();
            worst.see_in(unit, deviation, rounding * expected.abs() + grain, at);
        }
        worst.check(Law::Irradiance)
    }

    fn residual(&self, solution: &Solution, f_b: &Block) -> super::Check {
        let unit = rounding(self.system.n_patches());
        let mut worst = Worst::default();
        for c in 0..f_b.n_channels() {
            let (mut of_r, mut of_rounding, mut of_e) = (0.0, 0.0, 0.0);
            for (i, area) in self.system.areas().iter().enumerate() {
                let area = area / self.units.area;
                let (e, rho) = (self.exitance.row(i)[c], self.system.reflectance().row(i)[c]);
                let (b, reflected) = (self.radiosity.row(i)[c], rho * f_b.row(i)[c]);
                of_r += area * (e - b + reflected).powi(2);
                of_rounding += area * (unit * (e.abs() + b.abs() + reflected.abs())).powi(2);
                of_e += area * e * e;
            }
            let relative = |sum: f64| if sum > 0.0 { (sum / of_e).sqrt() } else { sum };
            let allowed = solution.residual_l2 * (1.0 + unit) + 2.0 * relative(of_rounding);
            let at = At::default().channel(c);
            worst.see(relative(of_r), allowed, at);
        }
        worst.check(Law::Residual)
    }

    /// Checks the stated power of the solution, unless it is out of the range of numbers.
    fn energy(&self, solution: &Solution, gain: &[f64]) -> Option<super::Check> {
        let unit = rounding(self.system.n_patches());
        let area_unit = self.units.area;
        let area: f64 = self.system.areas().iter().map(|area| area / area_unit).sum();
        let mut worst = Worst::default();
        for (c, energy) in solution.energy.iter().enumerate() {
            let light_unit = self.units.light[c];
            let (mut made, mut moved, mut of_e) = (0.0, 0.0, 0.0);
            for (i, (gain_i, area_i)) in gain.iter().zip(self.system.areas()).enumerate() {
                let area_i = area_i / area_unit;
                let (b, e) = (self.radiosity.row(i)[c], self.exitance.row(i)[c]);
                made += b * (gain_i / area_unit);
                moved += area_i * (b.abs() + e.abs() + self.irradiance.row(i)[c].abs());
                of_e += area_i * e * e;
            }
            let power_unit = area_unit * light_unit;
            if power_unit <= 0.0 || (moved * power_unit).is_infinite() {
                return None;
            }
            let by_backs = energy.absorbed_by_backs.unwrap_or(0.0);
            let stated = [energy.emitted, -energy.absorbed, -by_backs, -energy.escaped]
                .map(|power| power / light_unit / area_unit);
            let deviation = (stated.iter().sum::<f64>() + made).abs();
            let allowed = solution.residual_l2 * (area * of_e).sqrt() + unit * moved;
            worst.see_in(power_unit, deviation, allowed, At::default().channel(c));
        }
        Some(worst.check(Law::Energy))
    }
}

/// Adds the checks against the darkest (if `least`) and the brightest furnace; `slack` is the greatest |r_i| in a channel.
fn furnaces(audit: &mut Audit, given: &Reflecting<'_>, b: &Block, slack: impl Fn(usize, usize) -> f64, least: bool) {
    let (mut below, mut above) = (Worst::default(), Worst::default());
    let unit = rounding(b.n_rows());
    for c in 0..b.n_channels() {
        let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
        let absorbed_min = given.absorbed_min(c);
        for (i, sum) in given.row_sums.iter().enumerate() {
            let (rho, e, r) = (given.reflectance.row(i)[c], given.exitance.row(i)[c], slack(i, c));
            let absorbed = 1.0 - rho * sum;
            lowest = lowest.min((e - r) / absorbed);
            highest = highest.max((e + r) / absorbed);
        }
        // Below this, 1 − ρ s is rounding, and there is no bound; the residual itself is still checked.
        if absorbed_min.is_nan() || absorbed_min <= unit {
            continue;
        }
        let allowed = 4.0 * unit * highest / absorbed_min;
        for i in 0..b.n_rows() {
            let at = At::patch(i).channel(c);
            let light = given.light[c];
            below.see_in(light, (lowest - b.row(i)[c]).max(0.0), allowed, at);
            above.see_in(light, (b.row(i)[c] - highest).max(0.0), allowed, at);
        }
    }
    for (worst, law, wanted) in [
        (below, Law::LeastRadiosity, least),
        (above, Law::GreatestRadiosity, true),
    ] {
        if !wanted {
        } else if worst.n_checked > 0 {
            audit.checks.push(worst.check(law));
        } else {
            audit.skip(law, "a patch reflects all light that it gets");
        }
    }
}
