//! Form factors made from exchange areas: symmetric from the start.

use super::choice::StorageChoice;
use super::error::MatrixError;
use super::form_factors::{FormFactors, expect_areas};
use super::regroup::Regrouped;
use super::symmetric;
use super::tile::{Entry, RowTally, RowTile, index};
use crate::matrix::kernel::sizes::block_rows;

impl FormFactors {
    /// Stores the exchange areas a_ij = A_i F_ij = A_j F_ji that a method emitted, each pair once.
    ///
    /// `areas` in m², one per patch; `upper` the rows 0 to n − 1 of the upper triangle in order: row i holds entries (j, a_ij, error)
    /// with j ≥ i, in m². Reciprocity holds to the last bit. Standard errors are those of a_ij.
    ///
    /// # Errors
    /// As [`from_tiles`](Self::from_tiles); an entry below the diagonal is a [`MatrixError::BelowDiagonal`].
    pub fn from_exchange_tiles(
        areas: Vec<f64>,
        upper: impl IntoIterator<Item = RowTile>,
        storage: StorageChoice<'_>,
    ) -> Result<Self, MatrixError> {
        expect_areas(&areas)?;
        let n = areas.len();
        let area_max = areas.iter().copied().fold(0.0, f64::max);
        let mut rows = Regrouped::new(upper.into_iter());
        let blocks = block_rows(n).map(|range| Ok::<_, MatrixError>(rows.next_rows(range, n)?.divided(|_| area_max)));
        let exchange = symmetric::from_rows(&areas, storage, blocks)?;
        rows.expect_end(n)?;
        Ok(Self::of(areas, exchange, vec![RowTally::default(); n], storage))
    }

    /// Returns the exchange areas (j, a_ij, error), j > i, of row i above the diagonal, in m², as [`from_exchange_tiles`](Self::from_exchange_tiles) takes them.
    ///
    /// Stored once more with the same areas and precision, they give the same numbers to the last bit. `None` where exchange areas are not stored.
    pub(crate) fn exchange_row(&self, i: usize) -> Option<Vec<Entry>> {
        if !self.is_symmetric() {
            return None;
        }
        let area_max = self.areas().iter().copied().fold(0.0, f64::max);
        let mut row = Vec::new();
        self.for_each_number(i, i + 1..self.n_rows(), &mut |j, stored, error| {
            row.push((index(j), undivided(stored, area_max), error * area_max));
        });
        Some(row)
    }
}

/// Returns x such that x / `divisor` is `quotient` to the last bit, for a quotient that was computed so.
///
/// The product is off by a rounding of its own and by that of the division: some ulps to either side are enough.
fn undivided(quotient: f64, divisor: f64) -> f64 {
    let product = quotient * divisor;
    let (mut up, mut down) = (product, product);
    for _ in 0..4 {
        for x in [up, down] {
            if (x / divisor).to_bits() == quotient.to_bits() {
                return x;
            }
        }
        (up, down) = (up.next_up(), down.next_down());
    }
    product
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::matrix::operator::{Block, LinearOperator};

    #[test]
    fn both_triangles_come_from_one() {
        let mut upper = RowTile::new(0);
        upper.push_row(&[(1, 0.3, 0.01), (2, 0.1, 0.0)], RowTally::default());
        upper.push_row(&[(2, 0.25, 0.0)], RowTally::default());
        let mut last = RowTile::new(2);
        last.push_row(&[], RowTally::default());
        let areas = vec![2.0, 1.0, 0.5];
        let factors = FormFactors::from_exchange_tiles(areas, [upper, last], StorageChoice::default()).unwrap();
        assert!(factors.is_symmetric());
        for (i, j, expected) in [
            (0, 1, 0.15),
            (1, 0, 0.3),
            (2, 0, 0.2),
            (2, 1, 0.5),
            (1, 2, 0.25),
            (1, 1, 0.0),
        ] {
            assert!((factors.get(i, j) - expected).abs() < 1e-15, "{i} {j}");
        }
        assert!((factors.std_error(1, 0) - 0.01).abs() < 1e-8 && (factors.std_error(0, 1) - 0.005).abs() < 1e-8);
        let mut sums = Block::zeros(3, 1);
        factors.apply(&Block::from_values(vec![1.0; 3], 1), &mut sums);
        assert!((sums.values()[2] - 0.7).abs() < 1e-15);
        assert!(factors.reciprocal_areas().is_some());
    }

    #[test]
    fn rows_taken_out_and_stored_again_are_the_same_to_the_last_bit() {
        use crate::matrix::choice::{Layout, Place, Precision};
        let n = 200_u32;
        let areas: Vec<f64> = (0..n).map(|i| 0.37 + 0.013 * f64::from(i)).collect();
        let mut upper = RowTile::new(0);
        for i in 0..n {
            let entry = |j: u32| {
                (
                    j,
                    (f64::from(i * 31 + 7) * f64::from(j)).sin().abs() / 3.0,
                    1e-7 / f64::from(j),
                )
            };
            let row: Vec<Entry> = (i + 1..n).map(entry).collect();
            upper.push_row(&row, RowTally::default());
        }
        for precision in [Precision::F64, Precision::F32] {
            let storage = StorageChoice {
                layout: Layout::Auto,
                precision,
                place: Place::default(),
                ranks: None,
            };
            let first = FormFactors::from_exchange_tiles(areas.clone(), [upper.clone()], storage).unwrap();
            let mut again = RowTile::new(0);
            for i in 0..areas.len() {
                again.push_row(&first.exchange_row(i).unwrap(), RowTally::default());
            }
            let second = FormFactors::from_exchange_tiles(areas.clone(), [again], storage).unwrap();
            for i in 0..areas.len() {
                for j in 0..areas.len() {
                    assert_eq!(first.get(i, j).to_bits(), second.get(i, j).to_bits(), "{i} {j}");
                    assert_eq!(first.std_error(i, j).to_bits(), second.std_error(i, j).to_bits());
                }
            }
        }
        let rows = FormFactors::from_tiles(vec![1.0], [upper_of_one()], StorageChoice::default()).unwrap();
        assert!(rows.exchange_row(0).is_none());
    }

    fn upper_of_one() -> RowTile {
        let mut tile = RowTile::new(0);
        tile.push_row(&[], RowTally::default());
        tile
    }

    #[test]
    fn the_lower_triangle_and_missing_rows_are_refused() {
        let mut tile = RowTile::new(0);
        tile.push_row(&[], RowTally::default());
        let missing = FormFactors::from_exchange_tiles(vec![1.0; 2], [tile.clone()], StorageChoice::default());
        assert!(matches!(missing, Err(MatrixError::RowCount { .. })));
        tile.push_row(&[(0, 0.1, 0.0)], RowTally::default());
        let below = FormFactors::from_exchange_tiles(vec![1.0; 2], [tile], StorageChoice::default());
        assert!(matches!(below, Err(MatrixError::BelowDiagonal { .. })));
    }
}
