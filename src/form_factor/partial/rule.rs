//! A triangle rule of degree 8 that estimates its own error from the decay of its integrand's polynomial degrees.

use std::sync::LazyLock;

use glam::DVec2;

/// The two parts of a function that are integrated from the same points: the visible and the hidden part of the form factor.
pub(super) type Parts = [f64; 2];

/// The integrals over one cell and their estimated errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Estimate {
    /// The integral of each part, in units of f times m²; NaN, as the error, for a part that was not evaluated.
    pub(super) integral: Parts,
    /// The estimates of their absolute errors.
    pub(super) error: Parts,
    /// The number of points at which f was evaluated.
    pub(super) n_evaluations: usize,
}

impl Estimate {
    /// Applies `rule`, which returns an integral and its error, to the values of each part; a part that is 0 everywhere is known.
    pub(super) fn of_parts<const N: usize>(
        values: &[Parts; N],
        mut rule: impl FnMut(usize, &[f64; N]) -> [f64; 2],
    ) -> Self {
        let [visible, hidden] = [0, 1].map(|part| {
            let own = values.map(|parts| parts[part]);
            if own.iter().all(|x| x.abs() <= 0.0) {
                [0.0; 2]
            } else {
                rule(part, &own)
            }
        });
        Self {
            integral: [visible[0], hidden[0]],
            error: [visible[1], hidden[1]],
            n_evaluations: N,
        }
    }

    /// Returns the integrals over an area of values that are by area.
    fn times(self, area: f64) -> Self {
        Self {
            integral: self.integral.map(|x| area * x),
            error: self.error.map(|x| area * x),
            ..self
        }
    }

    /// Counts the points on the border, and their values of a part that is 0 on all others.
    fn with_border(mut self, border: &[Parts; N_BORDER], area: f64) -> Self {
        self.n_evaluations += N_BORDER;
        for part in 0..2 {
            let most = border.iter().map(|parts| parts[part]).fold(0.0, f64::max);
            if most > 0.0 && self.error[part] == 0.0 {
                self.error[part] = area * UNSEEN_STRIP * most;
            }
        }
        self
    }

    /// Returns the error of the part that is known better: where the sum of both has a closed form, one is enough.
    pub(super) fn least_error(&self) -> f64 {
        self.error[0].min(self.error[1])
    }
}

/// The number of points of the rule.
const N_POINTS: usize = 19;

/// The most evaluations that one triangle takes.
pub(super) const MAX_EVALUATIONS: usize = N_POINTS + N_BORDER;

/// The number of those points that make a rule of degree 5.
const N_FIRST: usize = 7;

/// The points that permutations of the barycentric coordinates (a, b, 1 − a − b) make, and the sum of their weights.
struct Orbit {
    a: f64,
    b: f64,
    weight: f64,
}

const CENTROID_WEIGHT: f64 = 0.037_861_091_200_314_68;

/// The orbits of three points (a = b) and the one of six: with the centroid they integrate degree 8.
///
/// They solve the moment equations of the ten symmetric polynomials up to degree 8, with the first two orbits those of Radon's rule
/// (computed with 40 digits): the points of D. P. Laurie, "CUBTRI", ACM TOMS 8(2), 1982. All weights are positive and all points inside.
const ORBITS: [Orbit; 5] = [
    Orbit {
        a: 0.101_286_507_323_456_34,
        b: 0.101_286_507_323_456_34,
        weight: 0.112_861_276_239_548_92,
    },
    Orbit {
        a: 0.470_142_064_105_115_1,
        b: 0.470_142_064_105_115_1,
        weight: 0.235_072_056_732_352,
    },
    Orbit {
        a: 0.029_480_860_884_439_568,
        b: 0.029_480_860_884_439_568,
        weight: 0.040_332_802_125_496_205,
    },
    Orbit {
        a: 0.232_102_326_775_050_38,
        b: 0.232_102_326_775_050_38,
        weight: 0.348_814_438_970_897_7,
    },
    Orbit {
        a: 0.029_480_860_884_439_568,
        b: 0.232_102_326_775_050_38,
        weight: 0.225_058_334_731_390_5,
    },
];

/// The sums of the weights in Radon's rule of degree 5: the centroid, then the first two orbits, (155 ∓ √15)/400.
const FIRST_WEIGHTS: [f64; 3] = [0.225, 0.377_817_541_634_481_5, 0.397_182_458_365_518_5];

/// The factor from the parts of a loose rule's spectrum to its error.
///
/// A jump between two of its points may be off by √2 times the part of degree two that it leaves.
pub(super) const SAFETY: f64 = 1.5;

/// Points a thousandth within the corners of the triangle and the middles of its sides, in the second and the third barycentric coordinate: beyond all points of the rule.
///
/// On the border itself a view may be degenerate: a point there lies in the plane of an occluder, or on an edge that it shares with the target.
const BORDER: [[f64; 2]; N_BORDER] = border(INSET);

/// Returns points so far within the border of a triangle, as a part of its heights.
pub(super) const fn border(inset: f64) -> [[f64; 2]; N_BORDER] {
    let (near, far, half, low) = (inset / 3.0, 1.0 - inset * 2.0 / 3.0, 0.5 - inset / 6.0, inset / 3.0);
    [
        [near, near],
        [far, near],
        [near, far],
        [half, low],
        [half, half],
        [low, half],
    ]
}

/// The distance of a border point from the border, as a part of the height.
pub(super) const INSET: f64 = 1e-3;

pub(super) const N_BORDER: usize = 6;

/// The greatest distance of a smooth function from its polynomial on the border, in units of the parts beyond it.
///
/// The polynomials of degree d are (d + 1)^{3/2} in norm at a corner: 14.7 for degree 5, 8 for degree 3.
const SMOOTH_ON_BORDER: f64 = 20.0;

/// The fraction of the triangle that a strip along its border may cover without a point of the rule.
const UNSEEN_STRIP: f64 = 0.2;

/// The number of points of the rule for loose tolerances: the centroid and those on the border.
const N_LOOSE: usize = 1 + N_BORDER;

/// Returns the sums of the weights of the corners and of the middles of the sides with which they and the centroid integrate degree 3.
///
/// About the centroid the middle of a side is −1/2 of the opposite corner. The moments of degree 2 and 3 require c + s/4 = 1/4 and c − s/8 = 1/10
/// on the border itself; r² and r³ account for the distance of the points from it.
fn loose_weights() -> (f64, f64) {
    let r = 1.0 - INSET;
    let (second, third) = (0.25 / (r * r), 0.1 / (r * r * r));
    let sides = (second - third) * 8.0 / 3.0;
    (second - 0.25 * sides, sides)
}

/// Points, their weights, and discrete orthonormal polynomials on them.
struct Nodes<const N: usize> {
    /// The second and the third barycentric coordinate.
    points: [[f64; 2]; N],
    /// The weights; 1 in sum.
    weights: [f64; N],
    /// The weights times the polynomials of some degree, of the next, and of all higher ones: Σ_k f(k) row(k) is a coefficient of f.
    spectrum: [Vec<[f64; N]>; 3],
    /// Σ_k f(k) row(k) is the value on a point of the border of the polynomial through f, up to the degree before the higher ones.
    border: [[f64; N]; N_BORDER],
}

struct Rule {
    loose: Nodes<N_LOOSE>,
    first: Nodes<N_FIRST>,
    all: Nodes<N_POINTS>,
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
        let (corners, sides) = loose_weights();
        let loose = [
            1.0 - corners - sides,
            corners / 3.0,
            corners / 3.0,
            corners / 3.0,
            sides / 3.0,
            sides / 3.0,
            sides / 3.0,
        ];
        let [centroid, inner, outer] = FIRST_WEIGHTS;
        let [inner, outer] = [inner / 3.0, outer / 3.0];
        Self {
            loose: Nodes::new(
                std::array::from_fn(|k| if k == 0 { points[0] } else { BORDER[k - 1] }),
                loose,
                1,
            ),
            first: Nodes::new(
                std::array::from_fn(|k| points[k]),
                [centroid, inner, inner, inner, outer, outer, outer],
                1,
            ),
            all: Nodes::new(
                std::array::from_fn(|k| points[k]),
                std::array::from_fn(|k| weights[k]),
                3,
            ),
        }
    }
}

impl<const N: usize> Nodes<N> {
    /// Makes the monomials orthonormal on the points, by Gram and Schmidt, twice for accuracy; the spectrum begins with `degree`.
    fn new(points: [[f64; 2]; N], weights: [f64; N], degree: i32) -> Self {
        let dot = |u: &[f64; N], v: &[f64; N]| (0..N).map(|k| weights[k] * u[k] * v[k]).sum::<f64>();
        // Values on the points, and on the border.
        let mut basis: Vec<([f64; N], [f64; N_BORDER])> = Vec::new();
        let mut spectrum = [const { Vec::new() }; 3];
        let mut border = [[0.0; N]; N_BORDER];
        for d in 0..=degree + 3 {
            for j in 0..=d {
                let monomial = |[x, y]: [f64; 2]| (x - 1.0 / 3.0).powi(d - j) * (y - 1.0 / 3.0).powi(j);
                let (mut v, mut outer) = (points.map(monomial), BORDER.map(monomial));
                let before = dot(&v, &v).sqrt();
                for _ in 0..2 {
                    for (u, u_outer) in &basis {
                        let part = dot(u, &v);
                        v.iter_mut().zip(u).for_each(|(x, y)| *x -= part * y);
                        outer.iter_mut().zip(u_outer).for_each(|(x, y)| *x -= part * y);
                    }
                }
                let norm = dot(&v, &v).sqrt();
                // There are more monomials of the last degrees than dimensions left.
                if norm < 1e-9 * before {
                    continue;
                }
                v.iter_mut().chain(&mut outer).for_each(|x| *x /= norm);
                basis.push((v, outer));
                if d < degree + 2 {
                    for (row, at_border) in border.iter_mut().zip(outer) {
                        (0..N).for_each(|k| row[k] += weights[k] * v[k] * at_border);
                    }
                }
                if let Ok(part) = usize::try_from(d - degree) {
                    spectrum[part.min(2)].push(std::array::from_fn(|k| weights[k] * v[k]));
                }
            }
        }
        Self {
            points,
            weights,
            spectrum,
            border,
        }
    }

    /// Returns the greatest distance of `border`, the values there, from the polynomial through `values`.
    fn miss(&self, values: &[f64; N], border: &[f64; N_BORDER]) -> f64 {
        let expected = |row: &[f64; N]| row.iter().zip(values).map(|(x, y)| x * y).sum::<f64>();
        let misses = border
            .iter()
            .zip(&self.border)
            .map(|(at, row)| (at - expected(row)).abs());
        misses.fold(0.0, f64::max)
    }

    /// Returns the mean of values on the points, and the norms of the parts of the spectrum.
    fn analyse(&self, values: &[f64; N]) -> (f64, [f64; 3]) {
        let dot = |row: &[f64; N]| row.iter().zip(values).map(|(x, y)| x * y).sum::<f64>();
        let norm = |rows: &Vec<[f64; N]>| rows.iter().map(|row| dot(row).powi(2)).sum::<f64>().sqrt();
        (dot(&self.weights), self.spectrum.each_ref().map(norm))
    }
}

/// Integrates f over a triangle; `enough` is an error per area that is good enough.
///
/// The values on the points are resolved into discrete orthonormal polynomials. With e₃, e₄ the norms of the parts of degree 3 and 4, and e₅ that of
/// all higher ones, r = max(e₄/e₃, e₅/e₄) is the decay of the degrees, and the error of degree 8 is taken as area · e₅ · min(1, max((4r)⁴, 1/100)): where
/// the function is smooth, its degrees 9 and up are about e₅ r⁴; where it is not, e₅ bounds them in all but
/// few cases. Rounding adds 4 ulps of the largest value. Each norm is over several coefficients, so that none is small by accident.
/// The approach is that of null rules (J. Berntsen and T. O. Espelid, "Error estimation in automatic quadrature routines", ACM TOMS 17(2), 1991), with
/// constants found by measurement on occluded form factors.
///
/// A kink in a strip along the border, beyond all points, leaves no trace in the spectrum. The function is therefore also evaluated just within the corners
/// and the middles of the sides; where it is farther from its polynomial of the degrees below e₅ than 20 e₅, more than a smooth function can be, a fifth of the excess is added.
///
/// Seven of the points are Radon's rule of degree 5, evaluated first. Its error is taken as area · (e₂ + e₃), the parts that it integrates exactly where the function is
/// smooth: seven points see too little of the spectrum to separate smooth functions from others.
///
/// Both parts of f are integrated; the seven points are enough if they are for one of the two. Without `may_bend` f is analytic in the triangle and within its size around: it has no kink, and is not evaluated near the border.
pub(super) fn integrate(
    corners: [DVec2; 3],
    enough: f64,
    may_bend: bool,
    mut f: impl FnMut(DVec2) -> Parts,
) -> Estimate {
    let rule = &*RULE;
    let (a, e, g) = (corners[0], corners[1] - corners[0], corners[2] - corners[0]);
    let area = 0.5 * e.perp_dot(g).abs();
    let mut at = |[x, y]: [f64; 2]| f(a + e * x + g * y);
    let first: [Parts; N_FIRST] = std::array::from_fn(|k| at(rule.all.points[k]));
    let by_points = Estimate::of_parts(&first, |_, values| {
        let (mean, [_, second, third]) = rule.first.analyse(values);
        [mean, second + third + if may_bend { 0.0 } else { rounding(values) }]
    });
    let mut border = None;
    if by_points.least_error() <= enough {
        if !may_bend {
            return by_points.times(area);
        }
        let border = *border.insert(BORDER.map(&mut at));
        let estimate = Estimate::of_parts(&first, |part, values| {
            let error = by_points.error[part];
            let beyond = rule.first.miss(values, &border.map(|parts| parts[part])) - SMOOTH_ON_BORDER * error;
            [
                area * by_points.integral[part],
                area * (error + UNSEEN_STRIP * beyond.max(0.0) + rounding(values)),
            ]
        })
        .with_border(&border, area);
        if estimate.least_error() <= enough * area {
            return estimate;
        }
    }
    let values: [Parts; N_POINTS] =
        std::array::from_fn(|k| if k < N_FIRST { first[k] } else { at(rule.all.points[k]) });
    let border = border.or_else(|| may_bend.then(|| BORDER.map(&mut at)));
    let estimate = Estimate::of_parts(&values, |part, values| {
        let (mean, [third, fourth, beyond]) = rule.all.analyse(values);
        let ratio = (fourth / third).max(beyond / fourth);
        let gain = if ratio < 0.25 {
            (4.0 * ratio).powi(4).max(0.01)
        } else {
            1.0
        };
        let unseen = border.map_or(0.0, |border| {
            rule.all.miss(values, &border.map(|parts| parts[part])) - SMOOTH_ON_BORDER * beyond
        });
        [
            area * mean,
            area * (beyond * gain + UNSEEN_STRIP * unseen.max(0.0) + rounding(values)),
        ]
    });
    match border {
        Some(border) => estimate.with_border(&border, area),
        None => estimate,
    }
}

/// Integrates f over a triangle by a rule of degree 3 whose points lie on the border and at the centroid; for functions whose kinks are sides of the triangle.
///
/// The error is taken as 3/2 area · (e₂ + e₃), the parts that the rule integrates exactly where the function is smooth, as for [`quad::integrate`](super::quad::integrate).
pub(super) fn integrate_loosely(corners: [DVec2; 3], mut f: impl FnMut(DVec2) -> Parts) -> Estimate {
    let nodes = &RULE.loose;
    let (a, e, g) = (corners[0], corners[1] - corners[0], corners[2] - corners[0]);
    let area = 0.5 * e.perp_dot(g).abs();
    let values = nodes.points.map(|[x, y]| f(a + e * x + g * y));
    Estimate::of_parts(&values, |_, values| {
        let (mean, [_, second, third]) = nodes.analyse(values);
        [area * mean, area * (SAFETY * (second + third) + rounding(values))]
    })
}

/// Returns 4 ulps of the largest value.
pub(super) fn rounding(values: &[f64]) -> f64 {
    4.0 * f64::EPSILON * values.iter().fold(0.0_f64, |m, v| m.max(v.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integral of one function, which stands for both parts.
    #[derive(Debug)]
    struct One {
        integral: f64,
        error: f64,
        n_evaluations: usize,
    }

    impl One {
        fn of(estimate: Estimate) -> Self {
            Self {
                integral: estimate.integral[0],
                error: estimate.error[0],
                n_evaluations: estimate.n_evaluations,
            }
        }
    }

    fn integrate(corners: [DVec2; 3], enough: f64, f: impl Fn(DVec2) -> f64) -> One {
        One::of(super::integrate(corners, enough, true, |p| [f(p); 2]))
    }

    fn integrate_loosely(corners: [DVec2; 3], f: impl Fn(DVec2) -> f64) -> One {
        One::of(super::integrate_loosely(corners, |p| [f(p); 2]))
    }

    #[test]
    fn the_loose_rule_is_exact_up_to_degree_3_and_covers_kinks_and_jumps() {
        let unit = [DVec2::ZERO, DVec2::X, DVec2::Y];
        for degree in 0..=3 {
            for i in 0..=degree {
                let found = integrate_loosely(unit, |p| p.x.powi(i) * p.y.powi(degree - i));
                let exact = 0.5 * mean_of_monomial(i, degree - i);
                assert!((found.integral - exact).abs() < 1e-15, "{i} of {degree}: {found:?}");
            }
        }
        let linear = integrate_loosely(unit, |p| 2.0 + p.x - 3.0 * p.y);
        assert!(linear.error < 1e-14, "{linear:?}");
        for k in 0..100 {
            let at = f64::from(k) / 100.0 + 0.003;
            for turn in 0..3 {
                let mut corners = unit;
                corners.rotate_left(turn);
                let kink = integrate_loosely(corners, |p| (p.x - at).max(0.0));
                assert!(
                    (kink.integral - (1.0 - at).powi(3) / 6.0).abs() <= kink.error,
                    "{at} {kink:?}"
                );
                let jump = integrate_loosely(corners, |p| f64::from(p.x > at));
                assert!(
                    (jump.integral - 0.5 * (1.0 - at).powi(2)).abs() <= jump.error,
                    "{at} {jump:?}"
                );
            }
        }
    }

    /// The mean of x^i y^j over the triangle (0,0) (1,0) (0,1) is 2 i! j! / (i + j + 2)!.
    fn mean_of_monomial(i: i32, j: i32) -> f64 {
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        2.0 * factorial(i) * factorial(j) / factorial(i + j + 2)
    }

    #[test]
    fn polynomials_up_to_degree_8_are_exact_and_of_degree_9_are_not() {
        let unit = [DVec2::ZERO, DVec2::X, DVec2::Y];
        let value = |i: i32, j: i32| integrate(unit, 0.0, |p| p.x.powi(i) * p.y.powi(j)).integral;
        for degree in 0..=8 {
            for i in 0..=degree {
                let exact = 0.5 * mean_of_monomial(i, degree - i);
                assert!((value(i, degree - i) - exact).abs() < 2e-16, "{i} of {degree}");
            }
        }
        assert!((value(9, 0) - 0.5 * mean_of_monomial(9, 0)).abs() > 1e-8);
    }

    #[test]
    fn the_spectrum_tells_degrees_apart() {
        // 4, 5, and what 19 points leave beyond degree 4.
        let n_rows = RULE.all.spectrum.each_ref().map(Vec::len);
        assert_eq!(n_rows, [4, 5, 4]);
        let n_first = RULE.first.spectrum.each_ref().map(Vec::len);
        assert_eq!(n_first, [2, 3, 1]);
        let flat = [DVec2::new(-1.0, 0.5), DVec2::new(2.0, 0.0), DVec2::new(0.5, 3.0)];
        for degree in 0..=4 {
            let estimate = integrate(flat, 0.0, |p| (p.x - 0.3 * p.y).powi(degree));
            assert!(estimate.error < 1e-11, "{degree}: {estimate:?}");
        }
    }

    #[test]
    fn the_error_covers_smooth_functions_kinks_and_jumps() {
        let triangle = [DVec2::new(0.2, 0.1), DVec2::new(1.0, 0.3), DVec2::new(0.4, 0.9)];
        let smooth = |p: DVec2| (1.5 * p.x - p.y).exp() / (1.0 + p.length_squared());
        let kinked = |p: DVec2| (p.x - 0.52).abs();
        let jumping = |p: DVec2| f64::from(p.x + 0.1 * p.y > 0.6);
        let functions: [(&dyn Fn(DVec2) -> f64, f64); 3] = [(&smooth, 1e-5), (&kinked, 1e-2), (&jumping, 0.2)];
        for (f, most) in functions {
            let whole = integrate(triangle, 0.0, f);
            let exact = finely(triangle, f, 9);
            assert!((whole.integral - exact).abs() <= whole.error, "{whole:?} {exact}");
            assert!(whole.error < most, "{whole:?}");
        }
    }

    #[test]
    fn a_kink_beyond_all_points_is_seen_on_the_border() {
        let unit = [DVec2::ZERO, DVec2::X, DVec2::Y];
        for turn in 0..3 {
            let mut corners = unit;
            corners.rotate_left(turn);
            for width in [0.02, 0.005] {
                // A strip along one side, and a corner; between the points there is a plane, or nothing.
                let strip = |p: DVec2| 0.3 + 0.1 * p.y + (width - p.x).max(0.0);
                let corner = |p: DVec2| (p.x + p.y - 1.0 + width).max(0.0);
                let tip = |p: DVec2| (width - p.x - p.y).max(0.0);
                let exact = [
                    0.15 + 0.1 / 6.0 + 0.5 * width * width - width.powi(3) / 6.0,
                    0.5 * width * width - width.powi(3) / 6.0,
                    width.powi(3) / 6.0,
                ];
                let functions: [&dyn Fn(DVec2) -> f64; 3] = [&strip, &corner, &tip];
                for (f, exact) in functions.into_iter().zip(exact) {
                    for enough in [0.0, 1.0] {
                        let found = integrate(corners, enough, f);
                        assert!(
                            (found.integral - exact).abs() <= found.error,
                            "{turn} {width} {enough} {found:?} {exact}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn seven_points_are_enough_where_they_say_so() {
        let triangle = [DVec2::new(0.2, 0.1), DVec2::new(0.5, 0.15), DVec2::new(0.3, 0.4)];
        let unit = [DVec2::ZERO, DVec2::X, DVec2::Y];
        for degree in 0..=5 {
            let first = integrate(unit, f64::INFINITY, |p| p.x.powi(degree));
            assert!((first.integral - 0.5 * mean_of_monomial(degree, 0)).abs() < 1e-15);
        }
        let smooth = |p: DVec2| (1.5 * p.x - p.y).exp() / (1.0 + p.length_squared());
        let kinked = |p: DVec2| (p.x - 0.32).abs();
        let functions: [(&dyn Fn(DVec2) -> f64, f64); 2] = [(&smooth, 0.2), (&kinked, 0.2)];
        for (f, enough) in functions {
            let first = integrate(triangle, enough, f);
            let exact = finely(triangle, f, 7);
            assert_eq!(first.n_evaluations, N_FIRST + N_BORDER);
            assert!((first.integral - exact).abs() <= first.error, "{first:?} {exact}");
            assert_eq!(integrate(triangle, 1e-9, f).n_evaluations, N_POINTS + N_BORDER);
        }
    }

    fn finely(triangle: [DVec2; 3], f: &dyn Fn(DVec2) -> f64, levels: u32) -> f64 {
        if levels == 0 {
            return integrate(triangle, 0.0, f).integral;
        }
        let [a, b, c] = triangle;
        let (p, q, r) = (a.midpoint(b), b.midpoint(c), c.midpoint(a));
        let parts = [[a, p, r], [p, b, q], [r, q, c], [p, q, r]];
        parts.map(|part| finely(part, f, levels - 1)).iter().sum()
    }
}
