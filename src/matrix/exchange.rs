//! Form factors made from exchange areas: symmetric from the start.

use super::regroup::Regrouped;
use super::{FormFactors, MatrixError, RowTally, RowTile, StorageChoice, expect_areas, symmetric};

impl FormFactors {
    /// Stores the exchange areas a_ij = A_i F_ij = A_j F_ji that a method emitted, each pair once.
    ///
    /// `areas` in m², one per patch; `upper` the rows 0 to n − 1 of the upper triangle in order: row i holds entries (j, a_ij, error)
    /// with j ≥ i, in m². Reciprocity holds to the last bit. Standard errors are those of a_ij.
    ///
    /// # Errors
    /// As [`from_tiles`](Self::from_tiles); an entry below the diagonal is a [`MatrixError::Column`].
    pub fn from_exchange_tiles(
        areas: Vec<f64>,
        upper: impl IntoIterator<Item = RowTile>,
        storage: StorageChoice<'_>,
    ) -> Result<Self, MatrixError> {
        expect_areas(&areas)?;
        let n = areas.len();
        let area_max = areas.iter().copied().fold(0.0, f64::max);
        let mut rows = Regrouped::new(upper.into_iter());
        let blocks = symmetric::block_rows(n).map(|range| {
            let mut block = RowTile::new(range.start);
            let mut entries = Vec::new();
            for _ in range {
                let (tile, k) = rows.next_row(n)?;
                entries.clear();
                entries.extend(
                    tile.row(k)
                        .iter()
                        .map(|&(j, a, error)| (j, a / area_max, error / area_max)),
                );
                block.push_row(&entries, RowTally::default());
            }
            Ok::<_, MatrixError>(block)
        });
        let exchange = symmetric::from_rows(n, storage, blocks)?;
        rows.expect_end(n)?;
        Ok(Self::from_symmetric(
            areas,
            exchange,
            vec![RowTally::default(); n],
            storage,
        ))
    }
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
    fn the_lower_triangle_and_missing_rows_are_refused() {
        let mut tile = RowTile::new(0);
        tile.push_row(&[], RowTally::default());
        let missing = FormFactors::from_exchange_tiles(vec![1.0; 2], [tile.clone()], StorageChoice::default());
        assert!(matches!(missing, Err(MatrixError::RowCount { .. })));
        tile.push_row(&[(0, 0.1, 0.0)], RowTally::default());
        let below = FormFactors::from_exchange_tiles(vec![1.0; 2], [tile], StorageChoice::default());
        assert!(matches!(below, Err(MatrixError::Column { .. })));
    }
}
