//! Sums with twice the digits.

/// A sum in two numbers, as if calculated with twice the digits and then rounded.
///
/// Source: Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM J. Sci. Comput. 26 (2005), algorithms 3.1 (TwoSum), 3.3 (TwoProduct, here with a fused multiply-add) and 5.3 (Dot2).
/// Departures: none. Accuracy: 2⁻⁵³ relative, and n² 2⁻¹⁰⁶ of the sum of the sizes of n terms.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Twofold {
    high: f64,
    low: f64,
}

impl Twofold {
    /// Adds a number.
    pub(crate) fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let part = sum - self.high;
        self.low += (self.high - (sum - part)) + (x - part);
        self.high = sum;
    }

    /// Adds a product.
    pub(crate) fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.low += a.mul_add(b, -product);
        self.add(product);
    }

    /// Adds a multiple of another sum.
    pub(crate) fn add_multiple(&mut self, a: f64, of: &Self) {
        self.add_product(a, of.high);
        self.add_product(a, of.low);
    }

    /// Returns the sum.
    pub(crate) fn value(&self) -> f64 {
        self.high + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cancels_is_not_lost() {
        let mut sum = Twofold::default();
        for x in [1e16, 1.0, -1e16, 1e-20] {
            sum.add(x);
        }
        assert_eq!(sum.value().to_bits(), 1.0_f64.to_bits());
        // (1 + u)(1 − u) − 1 = −u², which a product in f64 rounds away.
        let u = 1e-9;
        let mut square = Twofold::default();
        square.add_product(1.0 + u, 1.0 - u);
        square.add(-1.0);
        let (a, b) = ((1.0 + u) - 1.0, 1.0 - (1.0 - u));
        let expected = a - b - a * b;
        assert!(
            (square.value() - expected).abs() < 1e-15 * expected.abs(),
            "{:e}",
            square.value()
        );
    }
}
