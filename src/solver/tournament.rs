//! The patch with the greatest priority, while a few or all priorities change at a time.

/// Children of a node: one cache line of f64.
const FAN: usize = 8;

/// Numbers of which the greatest is read repeatedly: a tree of winners.
///
/// After k numbers have changed, finding the greatest takes O(min(k log n, n)).
pub(super) struct Tournament {
    values: Vec<f64>,
    /// The winner of every group of [`FAN`] values, then of every group of these, up to the one of all.
    levels: Vec<Vec<u32>>,
    /// Groups of the lowest level in which something changed.
    changed: Vec<u32>,
    /// Room for the groups of the next level.
    scratch: Vec<u32>,
}

impl Tournament {
    /// Returns a tournament of `n` ≥ 1 zeros.
    pub(super) fn new(n: usize) -> Self {
        let mut levels = Vec::new();
        let mut size = n;
        loop {
            size = size.div_ceil(FAN);
            levels.push(vec![0; size]);
            if size == 1 {
                break;
            }
        }
        let groups = index(levels[0].len());
        Self {
            values: vec![0.0; n],
            levels,
            changed: (0..groups).collect(),
            scratch: Vec::new(),
        }
    }

    /// Changes a number; cheapest in ascending order of i.
    pub(super) fn set(&mut self, i: usize, value: f64) {
        self.values[i] = value;
        let group = index(i / FAN);
        if self.changed.last() != Some(&group) {
            self.changed.push(group);
        }
    }

    /// Returns the place of the greatest number, the first of equal ones, and the number.
    pub(super) fn winner(&mut self) -> (usize, f64) {
        for level in 0..self.levels.len() {
            self.scratch.clear();
            for &group in &self.changed {
                let first = group as usize * FAN;
                let winner = if level == 0 {
                    let places = first..self.values.len().min(first + FAN);
                    first_greatest(&self.values, places)
                } else {
                    let below = &self.levels[level - 1];
                    let places = below[first..below.len().min(first + FAN)].iter();
                    first_greatest(&self.values, places.map(|&place| place as usize))
                };
                self.levels[level][group as usize] = index(winner);
                let above = group / index(FAN);
                if self.scratch.last() != Some(&above) {
                    self.scratch.push(above);
                }
            }
            std::mem::swap(&mut self.changed, &mut self.scratch);
        }
        self.changed.clear();
        let best = self.levels[self.levels.len() - 1][0] as usize;
        (best, self.values[best])
    }
}

fn first_greatest(values: &[f64], places: impl Iterator<Item = usize>) -> usize {
    let (mut best, mut greatest) = (usize::MAX, f64::NEG_INFINITY);
    for place in places {
        if values[place] > greatest || best == usize::MAX {
            (best, greatest) = (place, values[place]);
        }
    }
    best
}

#[expect(clippy::cast_possible_truncation, reason = "patches are numbered in u32")]
fn index(place: usize) -> u32 {
    place as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::sampling::Random;

    #[test]
    fn the_winner_is_the_first_greatest_after_any_changes() {
        let mut bits = Random(1);
        // The low bits of such a generator repeat.
        let mut random = |n: u64| (bits.bits() >> 22) % n;
        for n in [1_usize, 2, 7, 8, 9, 63, 64, 65, 513, 1000] {
            let mut tournament = Tournament::new(n);
            let mut values = vec![0.0; n];
            assert_eq!(tournament.winner().0, 0);
            for round in 0..200 {
                let n_changes = if round % 3 == 0 { n } else { 3 };
                for k in 0..n_changes {
                    let i = if round % 3 == 0 {
                        k
                    } else {
                        usize::try_from(random(n as u64)).expect("below n")
                    };
                    // Few different values, so that there are ties.
                    values[i] = random(5) as f64;
                    tournament.set(i, values[i]);
                }
                let expected = first_greatest(&values, 0..n);
                assert_eq!(tournament.winner(), (expected, values[expected]), "{n}, {round}");
            }
        }
    }
}
