//! Form factors in the Matrix Market format (`.mtx`), which SciPy, MATLAB, Julia and most solvers read.

use std::io::{self, Write};

use super::Description;
use crate::matrix::FormFactors;

/// Writes F as coordinates: a line `i j F_ij` for every entry that is not zero, i and j from 1, row by row.
///
/// The description stands in comments. Numbers have the fewest digits that read back as the same f64. Errors have no place.
/// Source: Boisvert, Pozo and Remington 1996, "The Matrix Market Exchange Formats". Departures: none.
pub(super) fn write(writer: &mut dyn Write, factors: &FormFactors, description: &Description) -> io::Result<()> {
    let n = factors.n_rows();
    let mut n_entries = 0_u64;
    for i in 0..n {
        factors.for_each_in_row(i, |_, value, _| n_entries += u64::from(value.abs() > 0.0));
    }
    writeln!(writer, "%%MatrixMarket matrix coordinate real general")?;
    for line in description.to_json().lines() {
        writeln!(writer, "% {line}")?;
    }
    writeln!(writer, "{n} {n} {n_entries}")?;
    for i in 0..n {
        let mut written = Ok(());
        factors.for_each_in_row(i, |j, value, _| {
            if written.is_ok() && value.abs() > 0.0 {
                written = writeln!(writer, "{} {} {value:?}", i + 1, j + 1);
            }
        });
        written?;
    }
    Ok(())
}
