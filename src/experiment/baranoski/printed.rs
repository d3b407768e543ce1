//! Tables 3 to 8 of the paper, digit by digit, and their misprints.

/// A printed number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Printed {
    /// The value as printed.
    pub(super) value: f64,
    /// The correct number, with the reason, if it is a misprint.
    pub(super) misprint: Option<(f64, &'static str)>,
}

impl Printed {
    /// Returns the number, corrected if it is a misprint.
    pub(super) fn corrected(&self) -> f64 {
        self.misprint.map_or(self.value, |(value, _)| value)
    }
}

const fn ok(value: f64) -> Printed {
    Printed { value, misprint: None }
}

const fn not(value: f64, corrected: f64, reason: &'static str) -> Printed {
    Printed {
        value,
        misprint: Some((corrected, reason)),
    }
}

/// A column of tables 3 to 6: one method.
#[derive(Clone, Copy, Debug)]
pub(super) struct SumColumn {
    /// The method's name in the paper.
    pub(super) method: &'static str,
    /// Σ of face 1 to face 6.
    pub(super) sums: [Printed; 6],
    /// "Σ of relative error (%)": 100 Σ |1 − Σ of face|.
    pub(super) error: Printed,
}

/// One of tables 3 to 6.
#[derive(Clone, Copy, Debug)]
pub(super) struct SumTable {
    /// Its number.
    pub(super) number: u8,
    /// The number n of the n × n patches on every face of the cube.
    pub(super) divisions: u32,
    /// The number of rays of each patch.
    pub(super) rays: u64,
    pub(super) columns: &'static [SumColumn],
}

/// A column of tables 7 and 8: one method.
#[derive(Clone, Copy, Debug)]
pub(super) struct FactorColumn {
    /// The method's name in the paper.
    pub(super) method: &'static str,
    /// Form factor and its printed relative error in per cent, in the order of the pairs.
    pub(super) factors: &'static [(Printed, f64)],
}

/// Table 7 or 8.
#[derive(Clone, Copy, Debug)]
pub(super) struct FactorTable {
    /// Its number.
    pub(super) number: u8,
    /// The pairs of faces, numbered from 1.
    pub(super) pairs: &'static [(usize, usize)],
    /// The value that the printed relative errors refer to.
    pub(super) reference: f64,
    pub(super) columns: &'static [FactorColumn],
}

const fn same(method: &'static str, sum: f64, error: f64) -> SumColumn {
    SumColumn {
        method,
        sums: [ok(sum); 6],
        error: ok(error),
    }
}

const fn column(method: &'static str, from_second: [Printed; 5], error: Printed) -> SumColumn {
    let [b, c, d, e, f] = from_second;
    SumColumn {
        method,
        sums: [ok(1.0), b, c, d, e, f],
        error,
    }
}

const FROM_ERRORS: &str = "the printed error column demands it";
const FROM_FACTORS: &str = "the sum of the printed form factors of tables 7 and 8 demands it";
const NOT_THE_SUM: &str = "the printed faces add up to this";

/// Tables 3 to 6.
#[rustfmt::skip]
pub(super) const SUMS: [SumTable; 4] = [
    SumTable { number: 3, divisions: 6, rays: 1000, columns: &[
        same("PDM", 1.013_652, 8.19),
        column("SR", [ok(0.997_333), not(1.00114, 1.0114, FROM_ERRORS), ok(0.998_056), ok(1.00367), ok(1.00464)], ok(2.43)),
        column("SG5", [ok(1.00186), ok(1.00233), ok(0.999), ok(1.00728), ok(1.00431)], ok(1.68)),
        column("SG10", [ok(1.00194), ok(1.00292), ok(0.998_778), ok(1.01075), ok(1.00333)], ok(2.02)),
    ] },
    SumTable { number: 4, divisions: 9, rays: 1000, columns: &[
        same("PDM", 1.009_103, 5.46),
        column("SR", [ok(0.997_815), ok(1.0009), ok(1.00023), ok(1.00049), ok(0.998_506)], ok(0.53)),
        column("SG5", [ok(0.998_494), ok(1.00328), ok(0.997_444), ok(1.00523), ok(1.00448)], ok(1.70)),
        column("SG10", [ok(0.998_852), ok(1.00312), ok(0.997_938), ok(1.00502), ok(1.00373)], ok(1.51)),
    ] },
    SumTable { number: 5, divisions: 13, rays: 1000, columns: &[
        same("PDM", 1.006_303, 3.78),
        column("SR", [ok(1.00034), ok(1.00208), ok(0.999_124), ok(1.00108), ok(0.995_243)], ok(0.91)),
        column("SG5", [ok(1.00032), ok(1.0047), ok(0.997_692), ok(0.999_473), ok(0.999_568)], not(0.78, 0.83, NOT_THE_SUM)),
        column("SG10", [ok(1.00042), ok(1.00472), ok(0.997_704), ok(0.998_828), ok(1.00027)], not(0.81, 0.89, NOT_THE_SUM)),
    ] },
    SumTable { number: 6, divisions: 13, rays: 625, columns: &[
        same("PDM", 1.006_303, 3.78),
        column("SR", [ok(1.00016), not(0.97264, 0.997_264, FROM_ERRORS), ok(0.999_451), ok(1.00034), ok(1.00235)], ok(0.61)),
        column("SG5", [ok(1.00301), not(0.98485, 0.998_485, FROM_ERRORS), ok(0.994_348), ok(0.998_968), ok(1.00153)], ok(1.27)),
    ] },
];

/// Tables 7 and 8, which belong to the runs of table 6: their rows add up to its sums.
#[rustfmt::skip]
pub(super) const FACTORS: [FactorTable; 2] = [
    FactorTable {
        number: 7, pairs: &[(1, 6), (2, 3), (4, 5)],
        reference: 0.1998,
        columns: &[
            FactorColumn { method: "PDM", factors: &[(ok(0.199_841), 0.02); 3] },
            FactorColumn { method: "SR", factors: &[
                (not(0.199_044, 0.199_195, FROM_FACTORS), 0.38),
                (not(0.199_044, 0.199_026, FROM_FACTORS), 0.38),
                (ok(0.199_195), 0.30),
            ] },
            FactorColumn { method: "SG5", factors: &[(ok(0.198_570), 0.62), (ok(0.199_508), 0.15), (ok(0.200_398), 0.30)] },
        ],
    },
    FactorTable {
        number: 8, pairs: &[(1, 2), (1, 3), (1, 4), (1, 5), (2, 4), (2, 5), (2, 6), (3, 4), (3, 5), (3, 6), (4, 6), (5, 6)],
        reference: 0.200_043,
        columns: &[
            FactorColumn { method: "PDM", factors: &[(ok(0.201_615), 0.78); 12] },
            FactorColumn { method: "SR", factors: &[
                (ok(0.200_502), 0.23), (ok(0.200_634), 0.30), (ok(0.199_044), 0.50), (ok(0.200_625), 0.29),
                (ok(0.198_892), 0.58), (ok(0.201_051), 0.50), (ok(0.200_691), 0.32), (ok(0.200_161), 0.06),
                (ok(0.198_305), 0.86), (ok(0.199_138), 0.45), (ok(0.202_159), 1.06), (ok(0.201_164), 0.56),
            ] },
            FactorColumn { method: "SG5", factors: &[
                (ok(0.202_556), 1.26), (ok(0.202_622), 1.30), (ok(0.196_781), 1.63), (ok(0.199_470), 0.29),
                (ok(0.198_692), 0.68), (ok(0.200_312), 0.13), (ok(0.201_941), 0.95), (ok(0.198_343), 0.85),
                (ok(0.197_955), 1.04), (ok(0.200_057), 0.007), (ok(0.200_133), 0.05), (ok(0.200_833), 0.40),
            ] },
        ],
    },
];

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Tests that the error column is 100 Σ |1 − Σ of face| with corrected misprints, to two printed decimals.
    #[test]
    fn errors_follow_from_the_faces() {
        for table in SUMS {
            for column in table.columns {
                let sum: f64 = column.sums.iter().map(|s| (1.0 - s.corrected()).abs()).sum();
                let error = column.error.corrected();
                assert!(
                    (100.0 * sum - error).abs() < 0.0101,
                    "table {}, {}",
                    table.number,
                    column.method
                );
                // With misprinted faces, the printed ones do not give the printed error, which confirms the mark.
                let printed: f64 = column.sums.iter().map(|s| (1.0 - s.value).abs()).sum();
                let marked = column.error.misprint.is_some() || column.sums.iter().any(|s| s.misprint.is_some());
                assert_eq!(
                    (100.0 * printed - column.error.value).abs() > 0.03,
                    marked,
                    "table {}, {}",
                    table.number,
                    column.method
                );
            }
        }
    }

    /// Tests that the form factors of tables 7 and 8 add up to the sums of table 6, and to those of no other table.
    #[test]
    fn tables_7_and_8_belong_to_table_6() {
        for method in ["SR", "SG5"] {
            let sums = |table: &SumTable| table.columns.iter().find(|c| c.method == method).unwrap().sums;
            let differences: Vec<f64> = [&SUMS[3], &SUMS[2]]
                .map(|table| {
                    let difference = |face: usize| {
                        let of_table = |t: &FactorTable| -> f64 {
                            let column = t.columns.iter().find(|c| c.method == method).unwrap();
                            let pairs = t.pairs.iter().zip(column.factors);
                            pairs
                                .filter(|((i, j), _)| *i == face || *j == face)
                                .map(|(_, (f, _))| f.corrected())
                                .sum()
                        };
                        (FACTORS.iter().map(of_table).sum::<f64>() - sums(table)[face - 1].corrected()).abs()
                    };
                    (1..=6).map(difference).fold(0.0, f64::max)
                })
                .to_vec();
            assert!(differences[0] < 1e-5, "{method}: {differences:?}");
            assert!(differences[1] > 1e-3, "{method}: {differences:?}");
        }
    }

    /// Tests that the relative errors of tables 7 and 8 refer to rounded values, 0.1998 and 0.200043.
    #[test]
    fn relative_errors_follow_from_the_form_factors() {
        for table in FACTORS {
            for column in table.columns {
                for (printed, error) in column.factors {
                    let measured = 100.0 * (printed.value / table.reference - 1.0).abs();
                    assert!(
                        (measured - error).abs() < 0.011,
                        "table {}, {}: {measured}, {error}",
                        table.number,
                        column.method
                    );
                }
            }
        }
    }
}
