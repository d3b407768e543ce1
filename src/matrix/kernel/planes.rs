//! A block of vectors in the layout of the inner loops.

use std::sync::OnceLock;

use super::aligned::{Aligned, apart};
use super::sizes::SIDE;
use crate::matrix::kernel::sizes::FOUR;
use crate::matrix::operator::Block;

/// A block of vectors, each channel in one piece that begins on a cache line, filled up with zeros to a multiple of [`SIDE`] rows.
#[derive(Debug)]
pub(in crate::matrix) struct Planes {
    n_rows: usize,
    values: Aligned<f64>,
    /// The same row by row, four channels at a time, once it has been read.
    fours: OnceLock<Vec<Aligned<f64>>>,
}

impl Planes {
    pub(in crate::matrix) fn of(x: &Block) -> Self {
        let (n_rows, n_channels) = (x.n_rows(), x.n_channels());
        let distance = apart(n_rows.next_multiple_of(SIDE));
        let mut values = Aligned::filled(distance * n_channels, 0.0);
        let planes = values.chunks_exact_mut(distance);
        for (c, plane) in planes.enumerate() {
            let channel = x.values().iter().skip(c).step_by(n_channels);
            plane.iter_mut().zip(channel).for_each(|(to, from)| *to = *from);
        }
        let fours = OnceLock::new();
        Self { n_rows, values, fours }
    }

    fn n_padded(&self) -> usize {
        self.n_rows.next_multiple_of(SIDE)
    }

    /// Returns the distance from one plane to the next.
    fn distance(&self) -> usize {
        apart(self.n_padded())
    }

    /// Returns the number of channels.
    pub(in crate::matrix) fn n_channels(&self) -> usize {
        self.values.len() / self.distance()
    }

    /// Returns the values of channels 0 to 3, 4 to 7 and so on of every row, filled up with zeros as the planes are.
    ///
    /// A gather of rows finds all channels of one row in the same cache line.
    pub(in crate::matrix) fn fours(&self) -> impl Iterator<Item = &[[f64; FOUR]]> {
        let of_group = |planes: &[f64]| {
            let mut values = Aligned::filled(self.n_padded() * FOUR, 0.0);
            for (c, plane) in planes.chunks_exact(self.distance()).enumerate() {
                for (row, value) in values.as_chunks_mut::<FOUR>().0.iter_mut().zip(plane) {
                    row[c] = *value;
                }
            }
            values
        };
        let groups = self
            .fours
            .get_or_init(|| self.values.chunks(FOUR * self.distance()).map(of_group).collect());
        groups.iter().map(|group| group.as_chunks::<FOUR>().0)
    }

    /// Returns the values of one channel.
    pub(in crate::matrix) fn channel(&self, c: usize) -> &[f64] {
        &self.padded(c)[..self.n_rows]
    }

    /// Returns the values of one channel, filled up with zeros to a multiple of [`SIDE`].
    pub(in crate::matrix) fn padded(&self, c: usize) -> &[f64] {
        &self.values[c * self.distance()..][..self.n_padded()]
    }
}
