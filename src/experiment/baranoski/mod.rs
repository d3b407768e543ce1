//! Reproduces [`BARANOSKI_1995`](crate::references::BARANOSKI_1995): table 2, the solvers side by side, in [`solvers`]; and appendix A, the accuracy of form factors by shooting and by quadrature.
//!
//! A closed cube, each face cut into n × n patches (n = 6, 9, 13). Tables 3 to 6 list the sums of the form factors of each face, tables 7 and 8 form
//! factors between faces, for quadrature (PDM) and shooting (SR, SG5, SG10).
//!
//! The paper's numbers show a fact that it does not state: in every shooting table the sum of face 1 is 1 to the last digit and the others are not. Each pair of
//! faces was shot once, from the face with the lower number, and the other direction filled in by reciprocity. The same is done here, with pseudo-random numbers.
//! Tables 7 and 8 belong to the runs of table 6. The error of tables 3 to 6 is 100 Σ |1 − Σ of face|.
//!
//! The paper prints one run each. Here every figure is an ensemble of runs, set beside its exact expectation and standard deviation, which are known in a cube, and
//! with the percentile of the paper's number in the ensemble.
//! PDM: the paper's digits follow from no known form of the method. Ours is the plain product of 5 × 5 Gauss points on both patches.
//! Departures: PDM as said; the random numbers are ours.

mod ensemble;
mod expected;
mod figures;
mod printed;
mod report;
pub mod solvers;

pub use figures::{Figure, LEVEL, TableResult, reproduce};
pub use report::{BaranoskiDocument, DEFAULT_SEEDS, findings};

/// Form factors F_IJ between the six faces, by the paper's numbers of the faces minus one; only I < J is used.
pub(crate) type PairFactors = [[f64; 6]; 6];

/// The tables of appendix A.
pub const TABLES: std::ops::RangeInclusive<u8> = 3..=8;

/// The table of the solvers.
pub const TABLE_OF_SOLVERS: u8 = 2;

/// The least number of seeds for an ensemble.
pub const MIN_SEEDS: u64 = 30;

/// Returns the sums of all faces if every pair was shot once, from the lower number: Σ_{J<I} F_JI + Σ_{J>I} F_IJ.
///
/// The faces have equal areas, so reciprocity is F_IJ = F_JI.
fn face_sums(factors: &PairFactors) -> [f64; 6] {
    std::array::from_fn(|i| {
        let lower: f64 = (0..i).map(|j| factors[j][i]).sum();
        let own: f64 = factors[i][i + 1..].iter().sum();
        lower + own
    })
}

/// Returns 100 Σ |1 − sum|, the paper's "Σ of relative error (%)".
fn error_percent(sums: &[f64; 6]) -> f64 {
    100.0 * sums.iter().map(|sum| (1.0 - sum).abs()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pair_counts_for_both_faces_and_once() {
        let mut factors = [[f64::NAN; 6]; 6];
        for (i, row) in factors.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate().skip(i + 1) {
                *value = 2f64.powi(i32::try_from(6 * i + j).unwrap_or(0));
            }
        }
        let sums = face_sums(&factors);
        assert!((sums[0] - (2.0 + 4.0 + 8.0 + 16.0 + 32.0)).abs() < 1e-12);
        assert!((sums[2] - (4.0 + 256.0 + 32768.0 + 65536.0 + 131_072.0)).abs() < 1e-9);
        assert!((error_percent(&[1.0, 0.99, 1.02, 1.0, 1.0, 1.0]) - 3.0).abs() < 1e-12);
    }
}
