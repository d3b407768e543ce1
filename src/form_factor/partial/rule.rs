//! A triangle rule of degree 8 that looks at how fast the degrees of its integrand fall, and so at its own error.

use std::sync::LazyLock;

use glam::DVec2;

/// The integral over one triangle and what its error may be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// The value of degree 8, in units of f times m².
    pub(super) integral: f64,
    /// The estimate of its absolute error.
    pub(super) error: f64,
}

/// The number of points of the rule.
pub(super) const N_POINTS: usize = 19;

/// The points that permutations of the barycentric coordinates (a, b, 1 − a − b) make, and the sum of their weights.
struct Orbit {
    a: f64,
    b: f64,
    weight: f64,
}

const CENTROID_WEIGHT: f64 = 0.037_861_091_200_314_683;

/// The orbits of three points (a = b) and the one of six.
const ORBITS: [Orbit; 5] = [
    Orbit {
        a: 0.101_286_507_323_456_34,
        b: 0.101_286_507_323_456_34,
        weight: 0.112_861_276_239_548_92,
    },
    Orbit {
        a: 0.470_142_064_105_115_09,
        b: 0.470_142_064_105_115_09,
        weight: 0.235_072_056_732_352_01,
    },
    Orbit {
        a: 0.029_480_860_884_439_567,
        b: 0.029_480_860_884_439_567,
        weight: 0.040_332_802_125_496_206,
    },
    Orbit {
        a: 0.232_102_326_775_050_37,
        b: 0.232_102_326_775_050_37,
        weight: 0.348_814_438_970_897_69,
    },
    Orbit {
        a: 0.029_480_860_884_439_567,
        b: 0.232_102_326_775_050_37,
        weight: 0.225_058_334_731_390_49,
    },
];

/// A vector over the points of the rule.
type OnPoints = [f64; N_POINTS];

/// The points, their weights, and discrete orthonormal polynomials on them.
struct Rule {
    /// The second and the third barycentric coordinate.
    points: [[f64; 2]; N_POINTS],
    /// The weights; 1 in sum.
    weights: OnPoints,
    /// The weights times the polynomials of degree 3, of degree 4, and of all that is beyond: Σ_k f(k) row(k) is a coefficient of f.
    spectrum: [Vec<OnPoints>; 3],
}

static RULE: LazyLock<Rule> = LazyLock::new(Rule::new);

impl Rule {
    fn new() -> Self {
        let mut points = vec![[1.0 / 3.0, 1.0 / 3.0]];
        let mut weights = vec![CENTROID_WEIGHT];
        for &Orbit { a, b, weight } in &ORBITS {
            let c = 1.0 - a - b;
            let cyclic = [[b, c], [c, a], [a, b]];
            points.extend(cyclic);
            weights.extend([weight / 3.0; 3]);
            #[expect(clippy::float_cmp, reason = "equal by construction")]
            if a != b {
                let count = weights.len();
                weights[count - 3..].fill(weight / 6.0);
                points.extend(cyclic.map(|[x, y]| [y, x]));
                weights.extend([weight / 6.0; 3]);
            }
        }
        let mut rule = Self {
            points: std::array::from_fn(|k| points[k]),
            weights: std::array::from_fn(|k| weights[k]),
            spectrum: [const { Vec::new() }; 3],
        };
        rule.fill_spectrum();
        rule
    }

    /// Makes the monomials orthonormal on the points, by Gram and Schmidt, twice for accuracy.
    fn fill_spectrum(&mut self) {
        let weights = self.weights;
        let dot = |u: &OnPoints, v: &OnPoints| (0..N_POINTS).map(|k| weights[k] * u[k] * v[k]).sum::<f64>();
        let mut basis: Vec<OnPoints> = Vec::new();
        for degree in 0..=5 {
            for j in 0..=degree {
                let mut v: OnPoints = self
                    .points
                    .map(|[x, y]| (x - 1.0 / 3.0).powi(degree - j) * (y - 1.0 / 3.0).powi(j));
                let before = dot(&v, &v).sqrt();
                for _ in 0..2 {
                    for u in &basis {
                        let part = dot(u, &v);
                        v.iter_mut().zip(u).for_each(|(x, y)| *x -= part * y);
                    }
                }
                let norm = dot(&v, &v).sqrt();
                // There are more monomials of degree 5 than dimensions left.
                if norm < 1e-9 * before {
                    continue;
                }
                v.iter_mut().for_each(|x| *x /= norm);
                basis.push(v);
                if let 3..=5 = degree {
                    let row = std::array::from_fn(|k| weights[k] * v[k]);
                    self.spectrum[usize::try_from(degree - 3).unwrap_or(0)].push(row);
                }
            }
        }
    }
}

/// Integrates f over a triangle.
pub(super) fn integrate(corners: [DVec2; 3], mut f: impl FnMut(DVec2) -> f64) -> Estimate {
    let rule = &*RULE;
    let (a, e, g) = (corners[0], corners[1] - corners[0], corners[2] - corners[0]);
    let area = 0.5 * e.perp_dot(g).abs();
    let values: OnPoints = rule.points.map(|[x, y]| f(a + e * x + g * y));
    let dot = |row: &OnPoints| row.iter().zip(&values).map(|(x, y)| x * y).sum::<f64>();
    let [third, fourth, beyond] = rule
        .spectrum
        .each_ref()
        .map(|rows| rows.iter().map(|row| dot(row).powi(2)).sum::<f64>().sqrt());
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let ratio = (fourth / third).max(beyond / fourth);
    let gain = if ratio < 0.25 {
        (4.0 * ratio).powi(4).max(0.01)
    } else {
        1.0
    };
    Estimate {
        integral: area * dot(&rule.weights),
        error: area * (beyond * gain + 4.0 * f64::EPSILON * largest),
    }
}
