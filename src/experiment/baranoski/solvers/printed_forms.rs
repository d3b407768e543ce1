//! Runs the algorithms as printed in the paper, with their misprints.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use serde::Serialize;

use super::{Case, TOLERANCE};
use crate::experiment::ExperimentError;
use crate::experiment::solved::solved;
use crate::matrix::FormFactors;
use crate::matrix::operator::{Block, LinearOperator};

/// How a printed algorithm ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "PrintedFormVerdict"))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It meets the tolerance on the true residual.
    Converges,
    /// It comes to rest, or goes on, away from the solution.
    WrongAnswer,
    /// Its numbers grow without bound.
    Diverges,
}

/// A printed algorithm and what came of it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PrintedForm {
    /// Its name.
    pub name: &'static str,
    /// The misprint.
    pub slip: &'static str,
    /// Steps done, n of them in a pass.
    pub n_steps: u64,
    /// How it ends.
    pub verdict: Verdict,
    /// The true max |r_i A_i| at the end, W.
    pub residual_max_power: f64,
    /// RMS error at the end, W·m⁻².
    pub error_rms: f64,
    /// How it must end, where that is known.
    pub expected: Option<Verdict>,
    /// False if it ends otherwise.
    pub inside: bool,
}

/// The growth of the residual that counts as divergence.
const DIVERGED_FROM: f64 = 1e6;

/// The limit of passes, sufficient for the slowest divergence, that of Chebyshev's method in case A.
const MAX_PASSES: usize = 1000;

/// One channel of the system G B = E.
struct System<'a> {
    factors: &'a FormFactors,
    areas: &'a [f64],
    rho: &'a [f64],
    e: &'a [f64],
    /// The solution.
    reference: &'a [f64],
}

impl System<'_> {
    /// Returns F x.
    fn gather(&self, x: &[f64]) -> Vec<f64> {
        let mut image = Block::zeros(x.len(), 1);
        self.factors.apply(&Block::from_values(x.to_vec(), 1), &mut image);
        image.values().to_vec()
    }

    /// Returns G x.
    fn g(&self, x: &[f64]) -> Vec<f64> {
        let gathered = self.gather(x);
        let terms = x.iter().zip(&gathered).zip(self.rho);
        terms.map(|((x, f), rho)| x - rho * f).collect()
    }

    fn residual(&self, b: &[f64]) -> Vec<f64> {
        self.e.iter().zip(self.g(b)).map(|(e, g)| e - g).collect()
    }

    /// Returns max |r A|, or infinity if it is NaN.
    fn max_power(&self, r: &[f64]) -> f64 {
        let powers = r.iter().zip(self.areas).map(|(r, a)| (r * a).abs());
        powers.fold(0.0, |m, p| if p.is_nan() { f64::INFINITY } else { m.max(p) })
    }

    fn total(&self, x: &[f64]) -> f64 {
        x.iter().zip(self.areas).map(|(x, a)| x * a).sum()
    }

    /// Returns the mean reflectance ρ_avg.
    fn rho_avg(&self) -> f64 {
        self.total(self.rho) / self.areas.iter().sum::<f64>()
    }

    /// Returns the ambient start B = E + ρ Ambient.
    fn ambient_start(&self) -> Vec<f64> {
        let ambient = self.total(self.e) / (self.areas.iter().sum::<f64>() * (1.0 - self.rho_avg()));
        self.e.iter().zip(self.rho).map(|(e, rho)| e + rho * ambient).collect()
    }
}

/// Runs the printed forms of a case.
pub(super) fn run(
    case: &Case,
    factors: &FormFactors,
    reflectance: &Block,
    exitance: &Block,
    reference: &Block,
) -> Result<Vec<PrintedForm>, ExperimentError> {
    let system = System {
        factors,
        areas: factors.areas(),
        rho: reflectance.values(),
        e: exitance.values(),
        reference: reference.values(),
    };
    // The paper's two failures need the same reflectance everywhere and E = 1.
    let uniform = vec![case.rho_avg; system.rho.len()];
    let unit: Vec<f64> = system.e.iter().map(|e| f64::from(u8::from(*e > 0.0))).collect();
    let plain = System {
        rho: &uniform,
        e: &unit,
        ..system
    };
    let plain = System {
        reference: &solve(&plain)?,
        ..plain
    };
    let fails = case.scene == "sphere-room-r1";
    Ok(vec![
        judge(
            &system,
            "gauss-seidel",
            "line 5 subtracts the reflected light",
            Some(Verdict::WrongAnswer),
            gauss_seidel(&system),
        ),
        judge(
            &plain,
            "overshooting (Feda), uniform ρ, E = 1",
            "line 13 sets ΔB_i to −ρ_i Ambient",
            fails.then_some(Verdict::Diverges),
            overshooting(&plain),
        ),
        judge(
            &system,
            "chebyshev",
            "line 17 takes the residual of the radiosities before",
            Some(Verdict::Diverges),
            chebyshev(&system),
        ),
        judge(
            &system,
            "cg",
            "V = ρ/A, and line 3 takes E − V G B",
            None,
            conjugate_gradients(&system),
        ),
    ])
}

fn solve(system: &System) -> Result<Vec<f64>, ExperimentError> {
    use crate::solver::{RadiositySystem, Tolerance};
    let block = |values: &[f64]| Block::from_values(values.to_vec(), 1);
    let whole = RadiositySystem::new(
        system.factors,
        system.areas.to_vec(),
        block(system.rho),
        block(system.e),
    )?;
    let solution = solved(&whole, "pcg", Tolerance::ResidualL2(1e-12))?;
    Ok(solution.radiosity.values().to_vec())
}

fn judge(
    system: &System,
    name: &'static str,
    slip: &'static str,
    expected: Option<Verdict>,
    (b, n_steps): (Vec<f64>, u64),
) -> PrintedForm {
    let residual_max_power = system.max_power(&system.residual(&b));
    let squares: Vec<f64> = b
        .iter()
        .zip(system.reference)
        .map(|(b, exact)| (b - exact).powi(2))
        .collect();
    let error_rms = (system.total(&squares) / system.areas.iter().sum::<f64>()).sqrt();
    let verdict = if residual_max_power <= TOLERANCE {
        Verdict::Converges
    } else if residual_max_power.is_finite() && residual_max_power < DIVERGED_FROM * system.max_power(system.e) {
        Verdict::WrongAnswer
    } else {
        Verdict::Diverges
    };
    PrintedForm {
        name,
        slip,
        n_steps,
        verdict,
        residual_max_power,
        error_rms,
        expected,
        inside: expected.is_none_or(|expected| expected == verdict),
    }
}

/// Runs section 1.2: B_i = E_i − ρ_i Σ F_ij B_j, in patch order, until nothing changes.
fn gauss_seidel(system: &System) -> (Vec<f64>, u64) {
    let mut b = system.e.to_vec();
    let mut n_steps = 0;
    for _ in 0..MAX_PASSES {
        let mut moved = 0.0_f64;
        for i in 0..b.len() {
            let mut gathered = 0.0;
            system.factors.for_each_in_row(i, |j, f, _| {
                if j != i {
                    gathered += f * b[j];
                }
            });
            let new = system.e[i] - system.rho[i] * gathered;
            moved = moved.max((new - b[i]).abs() * system.areas[i]);
            b[i] = new;
            n_steps += 1;
        }
        if moved <= TOLERANCE {
            break;
        }
    }
    (b, n_steps)
}

/// Runs section 1.2, Feda's algorithm, with R_i read as ρ_i; returns the displayed B̂ + ΔB.
fn overshooting(system: &System) -> (Vec<f64>, u64) {
    let n = system.e.len();
    let (mut shot, mut unshot) = (vec![0.0; n], system.e.to_vec());
    let lost = system.areas.iter().sum::<f64>() * (1.0 - system.rho_avg());
    let most = DIVERGED_FROM * 10.0 * system.max_power(system.e);
    let mut n_steps = 0;
    while n_steps < (MAX_PASSES * n) as u64 {
        let total = system.total(&unshot);
        let ambient = total / lost;
        let overshot = |i: usize| (unshot[i] + system.rho[i] * ambient).min(total / system.areas[i]);
        let power = |i: usize| (overshot(i) * system.areas[i]).abs();
        let best = (0..n)
            .max_by(|&a, &b| power(a).total_cmp(&power(b)).then(b.cmp(&a)))
            .unwrap_or(0);
        let light = overshot(best);
        shot[best] += light;
        let area = system.areas[best];
        system.factors.for_each_in_row(best, |j, f, _| {
            unshot[j] += system.rho[j] * f * area / system.areas[j] * light;
        });
        unshot[best] = -system.rho[best] * ambient;
        n_steps += 1;
        let power = system.max_power(&unshot);
        if power <= TOLERANCE || power.is_infinite() || power > most {
            break;
        }
    }
    (shot.iter().zip(&unshot).map(|(a, b)| a + b).collect(), n_steps)
}

/// Runs section 3.3, with D = r / γ before the loop, which is not printed at all.
fn chebyshev(system: &System) -> (Vec<f64>, u64) {
    let rho = system.rho_avg();
    let (mu, nu) = (1.0 - rho, 1.0 + rho);
    let alpha = 2.0 / (nu - mu);
    let gamma = (nu + mu) / (nu - mu) / alpha;
    let mut b = system.ambient_start();
    let mut r = system.residual(&b);
    let mut d: Vec<f64> = r.iter().map(|r| gamma * r).collect();
    b.iter_mut().zip(&d).for_each(|(b, d)| *b += d);
    r = system.residual(&b);
    let mut omega = 4.0 / (nu + mu);
    let mut n_passes = 1;
    while n_passes < MAX_PASSES {
        omega = 1.0 / (gamma - omega / (4.0 * alpha * alpha));
        for (d, r) in d.iter_mut().zip(&r) {
            *d = omega * r + (gamma * omega - 1.0) * *d;
        }
        let before = b.clone();
        b.iter_mut().zip(&d).for_each(|(b, d)| *b += d);
        r = system.residual(&before);
        n_passes += 1;
        let power = system.max_power(&r);
        if power <= TOLERANCE || power > 10.0 * DIVERGED_FROM * system.max_power(system.e) {
            break;
        }
    }
    (b, (n_passes * system.e.len()) as u64)
}

/// Runs section 3.2, with V = ρ / A as in its text; sums begin at zero.
fn conjugate_gradients(system: &System) -> (Vec<f64>, u64) {
    let v: Vec<f64> = system.rho.iter().zip(system.areas).map(|(rho, a)| rho / a).collect();
    let scaled = |x: &[f64]| -> Vec<f64> { system.g(x).iter().zip(&v).map(|(g, v)| v * g).collect() };
    let dot = |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(x, y)| x * y).sum() };
    let mut b = system.e.to_vec();
    let mut r: Vec<f64> = system.e.iter().zip(scaled(&b)).map(|(e, g)| e - g).collect();
    let mut d = r.clone();
    let mut phi = dot(&r, &r);
    let mut n_passes = 0;
    while n_passes < MAX_PASSES {
        let w = scaled(&d);
        let alpha = phi / dot(&w, &d);
        b.iter_mut().zip(&d).for_each(|(b, d)| *b += alpha * d);
        r.iter_mut().zip(&w).for_each(|(r, w)| *r -= alpha * w);
        let next = dot(&r, &r);
        let beta = next / phi;
        phi = next;
        d.iter_mut().zip(&r).for_each(|(d, r)| *d = r + beta * *d);
        n_passes += 1;
        let power = system.max_power(&r);
        if power <= TOLERANCE || power > 10.0 * DIVERGED_FROM * system.max_power(system.e) {
            break;
        }
    }
    (b, (n_passes * system.e.len()) as u64)
}
