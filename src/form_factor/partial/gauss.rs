//! Products of Gauss rules on convex quadrilaterals, for functions that are analytic there and within the cell's size around.

use glam::DVec2;

use super::rule::{Estimate, Parts, rounding};

/// A Gauss–Legendre rule of N points of \[−1, 1\] whose weights add up to 1, and the orthonormal Legendre polynomials on its points.
struct Line<const N: usize> {
    places: [f64; N],
    /// Weight times polynomial: `rows[m][k]` for degree m at point k.
    rows: [[f64; N]; N],
}

impl<const N: usize> Line<N> {
    const fn new(places: [f64; N], weights: [f64; N], roots: [f64; N]) -> Self {
        let mut rows = [[0.0; N]; N];
        let mut k = 0;
        while k < N {
            let x = places[k];
            // (m + 1) P_{m+1} = (2 m + 1) x P_m − m P_{m−1}, and √(2 m + 1) P_m has the norm 1.
            let (mut before, mut own, mut m) = (0.0, 1.0, 0);
            while m < N {
                rows[m][k] = weights[k] * roots[m] * own;
                let degree = m as f64;
                (before, own) = (own, ((2.0 * degree + 1.0) * x * own - degree * before) / (degree + 1.0));
                m += 1;
            }
            k += 1;
        }
        Self { places, rows }
    }

    /// Returns the coefficients of values in the polynomials.
    fn resolve(&self, values: [f64; N]) -> [f64; N] {
        self.rows
            .each_ref()
            .map(|row| row.iter().zip(&values).map(|(x, y)| x * y).sum())
    }
}

/// √(2 m + 1).
const ROOTS: [f64; 4] = [
    1.0,
    1.732_050_807_568_877_2,
    2.236_067_977_499_79,
    2.645_751_311_064_590_7,
];

/// The points ∓√(3/5) and 0.
static THREE: Line<3> = Line::new(
    [-0.774_596_669_241_483_4, 0.0, 0.774_596_669_241_483_4],
    [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0],
    [ROOTS[0], ROOTS[1], ROOTS[2]],
);

/// The points ∓√(3/7 ± 2/7 √(6/5)), with weights (18 ∓ √30)/72.
static FOUR: Line<4> = Line::new(
    [
        -0.861_136_311_594_052_6,
        -0.339_981_043_584_856_3,
        0.339_981_043_584_856_3,
        0.861_136_311_594_052_6,
    ],
    [
        0.173_927_422_568_726_93,
        0.326_072_577_431_273_07,
        0.326_072_577_431_273_07,
        0.173_927_422_568_726_93,
    ],
    ROOTS,
);

/// Integrates f over a convex quadrilateral from 9 points, and from 16 where their error is above `enough`.
///
/// With c_mn the coefficients of f times the element of area in orthonormal Legendre polynomials of the points, the error is taken as the norm of those whose higher degree is N − 1, with N points a side:
/// the rule integrates them exactly, and the first that it misses has the degree 2N.
pub(super) fn integrate([a, b, c, d]: [DVec2; 4], enough: f64, mut f: impl FnMut(DVec2) -> Parts) -> Estimate {
    let mut look = |s: f64, t: f64| {
        let (s, t) = (0.5 + 0.5 * s, 0.5 + 0.5 * t);
        let (left, right) = (a + (d - a) * t, b + (c - b) * t);
        let upwards = (d - a) + ((c - b) - (d - a)) * s;
        let element = (right - left).perp_dot(upwards).abs();
        f(left + (right - left) * s).map(|value| value * element)
    };
    let first = product::<3, 9>(&THREE, &mut look);
    if first.least_error() <= enough {
        return first;
    }
    let second = product::<4, 16>(&FOUR, look);
    Estimate {
        n_evaluations: first.n_evaluations + second.n_evaluations,
        ..second
    }
}

/// Integrates over the square by N × N = M points.
fn product<const N: usize, const M: usize>(line: &Line<N>, mut f: impl FnMut(f64, f64) -> Parts) -> Estimate {
    let values: [Parts; M] = std::array::from_fn(|k| f(line.places[k % N], line.places[k / N]));
    Estimate::of_parts(&values, |_, values| {
        let rows: [[f64; N]; N] = std::array::from_fn(|t| line.resolve(std::array::from_fn(|s| values[N * t + s])));
        let coefficients: [[f64; N]; N] = std::array::from_fn(|m| line.resolve(rows.map(|row| row[m])));
        let last = coefficients[N - 1]
            .iter()
            .chain(coefficients[..N - 1].iter().map(|column| &column[N - 1]));
        let square: f64 = last.map(|c| c * c).sum();
        [coefficients[0][0], square.sqrt() + rounding(values)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [DVec2; 4] = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];

    const QUAD: [DVec2; 4] = [
        DVec2::new(-1.0, 0.5),
        DVec2::new(2.0, 0.0),
        DVec2::new(1.5, 2.0),
        DVec2::new(0.5, 3.0),
    ];

    /// Integrates one function as both parts.
    fn integrate(corners: [DVec2; 4], enough: f64, f: impl Fn(DVec2) -> f64) -> Estimate {
        super::integrate(corners, enough, |p| [f(p); 2])
    }

    #[test]
    fn nine_points_are_exact_up_to_degree_5_and_sixteen_up_to_7() {
        for (enough, degree, n_evaluations) in [(f64::INFINITY, 5, 9), (0.0, 7, 25)] {
            for i in 0..=degree {
                for j in 0..=degree {
                    let found = integrate(SQUARE, enough, |p| p.x.powi(i) * p.y.powi(j));
                    let exact = 1.0 / f64::from((i + 1) * (j + 1));
                    assert!((found.integral[0] - exact).abs() < 1e-15, "{i} {j} {found:?}");
                    assert_eq!(found.n_evaluations, n_evaluations);
                }
            }
            let beyond = integrate(SQUARE, enough, |p| p.x.powi(degree + 1)).integral[0];
            assert!((beyond - 1.0 / f64::from(degree + 2)).abs() > 1e-5);
        }
        let area = integrate(QUAD, 0.0, |_| 1.0);
        assert!(
            (area.integral[0] - 4.875).abs() < 1e-14 && area.error[0] < 1e-12,
            "{area:?}"
        );
    }

    #[test]
    fn the_error_covers_singularities_three_radii_away() {
        // 1/r^k about places around, from three radii on: as form factors behave beside an edge or a target.
        let middle = QUAD.iter().sum::<DVec2>() / 4.0;
        let radius = QUAD.iter().map(|v| v.distance(middle)).fold(0.0, f64::max);
        for k in 0..40 {
            let place = middle + DVec2::from_angle(f64::from(k) * 0.7) * radius * (3.0 + 0.1 * f64::from(k));
            for power in [1, 2, 4] {
                let f = |p: DVec2| (radius / p.distance(place)).powi(power);
                let exact: f64 = finely(QUAD, &f, 5);
                for enough in [f64::INFINITY, 0.0] {
                    let found = integrate(QUAD, enough, f);
                    let off = (found.integral[0] - exact).abs();
                    assert!(off <= found.error[0], "{k} {power} {off:e} {found:?}");
                    assert!(
                        found.error[0] < if enough > 0.0 { 0.2 } else { 0.05 } * exact,
                        "{found:?}"
                    );
                }
            }
        }
    }

    fn finely([a, b, c, d]: [DVec2; 4], f: &dyn Fn(DVec2) -> f64, levels: u32) -> f64 {
        if levels == 0 {
            return integrate([a, b, c, d], 0.0, f).integral[0];
        }
        let (ab, bc, cd, da) = (a.midpoint(b), b.midpoint(c), c.midpoint(d), d.midpoint(a));
        let m = ab.midpoint(cd);
        let parts = [[a, ab, m, da], [ab, b, bc, m], [m, bc, c, cd], [da, m, cd, d]];
        parts.map(|part| finely(part, f, levels - 1)).iter().sum()
    }
}
