//! `sor`: Gauss-Seidel with steps longer by a factor ω.

use super::ambient::Ambient;
use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::gauss_seidel::run_sweeps;
use super::history::Monitor;
use super::scaled::Scaled;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Value};

/// Successive overrelaxation, all channels together.
///
/// B_i ← (1 − ω) B_i + ω (E_i + ρ_i Σ_{j≠i} F_ij B_j) / (1 − ρ_i F_ii), i = 1 ... n in patch order with the newest B_j; ω = 1 is Gauss-Seidel.
///
/// Where A_i F_ij is symmetric it converges for every ω in (0, 2) if the system is positive definite (Ostrowski and Reich); for other form factors the
/// theory of M-matrices guarantees that for ω ≤ 1 alone. Estimates, rows and determinism are as in [`GaussSeidel`](super::GaussSeidel).
///
/// The default is ω(ρ) with ρ = Σ A ρ s / Σ A of each connected component and channel, s_i = Σ_j F_ij:
///
/// ρ = 2 (ω − 1) ln(ω − 1) / (ω (ω − 2)), 1 ≤ ω < 2.
///
/// It is the best ω of a room in which all patches see all alike, F_ij = A_j / Σ A, as n → ∞: the one slow mode of a sweep has the
/// factor z with ln z = ω ρ (z − 1) / (z − 1 + ω), all others have 1 − ω, and with z = ω − 1 both fall equally fast, by about
/// 1 − sqrt(6 (1 − ρ)) a pass where ρ is near 1; with ω = 1 it would be 1 − 2 (1 − ρ). A room that loses nothing has no slow mode, as its mean is free, and gets ω = 1.
///
/// In the six cases of the paper's table 2 it takes 3, 4, 7, 10, 7 and 9 passes for Gauss-Seidel's 3, 5, 12, 25, 13 and 27, and ends with a fifth of the error or less from
/// case C on (`radiosity reproduce baranoski --tables 2`).
///
/// No ω lets the residual fall faster than by |ω − 1| a pass in the long run (Kahan), and between two of its least values it may rise for long. The patience of
/// [`SolveOptions::patience`] is at least the number of passes that |ω − 1| takes for a factor of 100: 44 at ω = 1.9, 459 at 1.99.
///
/// Memory: 2 vectors. Work: one sweep a pass.
/// Source: Baranoski, Bramley and Shirley 1995, section 3.1.
/// Departures: the reflected light is added (a minus sign is printed); F_ii ≠ 0 is allowed; the default ω, which the paper leaves open, is ours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sor {
    /// ω, or `None` for the rule above.
    pub omega: Option<f64>,
}

/// The relaxation factor ω.
pub static OMEGA: Setting = Setting {
    name: "omega",
    help: "Relaxation factor, between 0 and 2 [default: by the mean reflectance]",
    letter: "W",
    kind: Kind::Number,
};

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "sor",
    summary: "Gauss-Seidel with overrelaxation",
    settings: &[OMEGA.optional()],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: true,
    make: |s| {
        let omega = s.values.get(&OMEGA).and_then(Value::number);
        Some(Box::new(Sor { omega }))
    },
};

impl Solver for Sor {
    fn name(&self) -> &'static str {
        "sor"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        if let Some(value) = self.omega.filter(|omega| !(*omega > 0.0 && *omega < 2.0)) {
            return Err(SolverError::Omega { value });
        }
        let rows = system.rows_for(self.name())?;
        let scaled = Scaled::new(system);
        let rooms = Ambient::new(&scaled);
        // ω, [components, c].
        let mut omega = rooms.mean_reflectance();
        for room in 0..omega.n_rows() {
            for (c, value) in omega.row_mut(room).iter_mut().enumerate() {
                let rule = if rooms.lost(room, c) > 0.0 {
                    best_omega(*value)
                } else {
                    1.0
                };
                *value = self.omega.unwrap_or(rule);
            }
        }
        let options = SolveOptions {
            patience: options.patience.max(least_patience(&omega)),
            ..*options
        };
        let relax = |i: usize, c: usize, old: f64, gathered: f64| old + omega.row(rooms.room(i))[c] * (gathered - old);
        run_sweeps(&scaled, rows, &options, monitor, relax)
    }
}

/// Returns the passes in which |ω − 1|, the greatest of all, falls to a hundredth.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "both logarithms are negative, and the cast saturates where ω is 2 but for rounding"
)]
fn least_patience(omega: &Block) -> usize {
    let factor = omega.values().iter().map(|w| (w - 1.0).abs()).fold(0.0, f64::max);
    (0.01_f64.ln() / factor.ln()).ceil() as usize
}

/// Returns the ω of [`Sor`]'s rule: bisection, as ρ grows with ω.
fn best_omega(rho: f64) -> f64 {
    let (mut low, mut high) = (1.0, 2.0);
    for _ in 0..f64::MANTISSA_DIGITS {
        let omega: f64 = 0.5 * (low + high);
        if 2.0 * (omega - 1.0) * (omega - 1.0).ln() / (omega * (omega - 2.0)) < rho {
            low = omega;
        } else {
            high = omega;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patience_is_a_factor_of_100() {
        let passes = |omega: f64| least_patience(&Block::from_values(vec![1.0, omega], 1));
        assert_eq!([passes(1.0), passes(1.9), passes(1.99), passes(0.1)], [0, 44, 459, 44]);
    }

    #[test]
    fn the_rule_solves_its_equation_and_grows() {
        // By hand: ω = 3/2 gives 2 · ½ · ln ½ / (3/2 · −½) = 4/3 ln 2.
        assert!((best_omega(4.0 / 3.0 * std::f64::consts::LN_2) - 1.5).abs() < 1e-14);
        assert!((best_omega(0.0) - 1.0).abs() < 1e-14);
        // 2 − ω = sqrt(6 (1 − ρ)) to second order.
        assert!((2.0 - best_omega(1.0 - 1e-8) - 6e-8_f64.sqrt()).abs() < 1e-7);
        assert!(best_omega(1.0) < 2.0 && best_omega(1.1) < 2.0);
    }
}
