#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use rayon::ThreadPoolBuilder;

use super::factor::{PANEL, WIDTH};
use super::substitution::{SMALL, STEP, TOGETHER};
use super::update::{BLOCK, COLUMNS, ROWS};
use super::*;

/// Numbers from −½ to ½ without a pattern.
fn number(i: usize, j: usize) -> f64 {
    let mixed = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (j as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// A well-conditioned matrix whose rows need exchanging.
fn shifted(n: usize) -> impl Fn(usize, usize) -> f64 {
    move |i, j| number(i, j) + if (i + 1) % n == j { (n as f64).sqrt() } else { 0.0 }
}

/// Sizes about the edges of all blocks.
fn sizes() -> Vec<usize> {
    let edges = [STEP, COLUMNS, ROWS, 2 * ROWS, SMALL + STEP, 3 * ROWS, PANEL / 2, PANEL];
    let mut sizes: Vec<usize> = edges.iter().flat_map(|edge| edge - 1..=edge + 1).collect();
    sizes.extend([0, 1, 2, 3, PANEL + ROWS, PANEL + WIDTH + COLUMNS + 1, 2 * PANEL + 3]);
    sizes.push(2 * PANEL + WIDTH + 5);
    sizes.push(PANEL + BLOCK * ROWS + ROWS + 1);
    sizes
}

fn image(n: usize, entry: &impl Fn(usize, usize) -> f64, x: &[f64]) -> Vec<f64> {
    (0..n).map(|i| (0..n).map(|j| entry(i, j) * x[j]).sum()).collect()
}

/// Returns the greatest |P M − L U| in units of n ε |L| |U|.
fn backward_error(n: usize, entry: &impl Fn(usize, usize) -> f64) -> f64 {
    let lu = Lu::new(Dense::from_fn(n, entry));
    let mut rows: Vec<usize> = (0..n).collect();
    for (k, &other) in lu.exchanges.iter().enumerate() {
        rows.swap(k, other);
    }
    let mut worst = 0.0_f64;
    for j in 0..n {
        let column = &lu.packed.values[j * n..(j + 1) * n];
        let (mut product, mut magnitude) = (vec![0.0; n], vec![0.0; n]);
        for (k, u) in column[..=j].iter().enumerate() {
            product[k] += u;
            magnitude[k] += u.abs();
            let l = &lu.packed.values[k * n..(k + 1) * n];
            for i in k + 1..n {
                assert!(l[i].abs() <= 1.0, "{n}: {}", l[i]);
                product[i] += l[i] * u;
                magnitude[i] += (l[i] * u).abs();
            }
        }
        for i in 0..n {
            let error = (product[i] - entry(rows[i], j)).abs();
            worst = worst.max(error / (n as f64 * f64::EPSILON / 2.0 * magnitude[i]));
        }
    }
    worst
}

#[test]
fn factors_multiply_to_the_matrix() {
    for n in sizes() {
        for worst in [backward_error(n, &number), backward_error(n, &shifted(n))] {
            // The bound, and as much again for the product of this test.
            assert!(worst < 2.0, "{n}: {worst}");
        }
        // Rows of very different magnitude, in no order.
        let graded = |i: usize, j: usize| 10.0_f64.powf((i * 7 % 25) as f64 - 12.0) * number(i, j);
        let worst = backward_error(n, &graded);
        assert!(worst < 2.0, "{n}, graded: {worst}");
    }
}

#[test]
fn known_solutions_are_found() {
    for n in sizes() {
        let entry = shifted(n);
        let x: Vec<f64> = (0..(TOGETHER + 3) * n).map(|k| 1.0 + number(k, 0)).collect();
        let lu = Lu::new(Dense::from_fn(n, &entry));
        let mut found: Vec<f64> = x.chunks(n.max(1)).flat_map(|x| image(n, &entry, x)).collect();
        let images = found.clone();
        lu.solve(&mut found);
        for (a, wanted) in found.iter().zip(&x) {
            // The condition number is below 100.
            assert!((a - wanted).abs() < 1e-14 * (10.0 + n as f64), "{n}: {a} {wanted}");
        }
        for (found, image) in found.chunks(n.max(1)).zip(images.chunks(n.max(1))) {
            let mut alone = image.to_vec();
            lu.solve(&mut alone);
            assert_eq!(bits(&alone), bits(found), "{n}");
        }
    }
}

#[test]
fn a_graded_matrix_is_solved_to_a_small_residual() {
    let n = 100;
    let scale = |i: usize| 10.0_f64.powf((i * 7 % 25) as f64 - 12.0);
    let (even, entry) = (shifted(n), |i: usize, j: usize| scale(i) * shifted(n)(i, j));
    let wanted: Vec<f64> = (0..n).map(|k| 1.0 + number(k, 0)).collect();
    let mut x = image(n, &entry, &wanted);
    Lu::new(Dense::from_fn(n, entry)).solve(&mut x);
    let (a, b) = (image(n, &even, &x), image(n, &even, &wanted));
    for (a, b) in a.iter().zip(&b) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Returns the bytes of factors and solutions.
fn bytes(n: usize, arch: Arch) -> (Vec<u64>, Vec<usize>) {
    let lu = Lu::with(Dense::from_fn(n, number), arch);
    let mut x: Vec<f64> = (0..3 * n).map(|k| number(k, 1)).collect();
    lu.solve(&mut x);
    ([bits(&lu.packed.values), bits(&x)].concat(), lu.exchanges)
}

#[test]
fn the_bytes_are_the_same_with_every_instruction_set() {
    let mut sets = vec![Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    sets.extend(pulp::x86::V3::try_new().map(Arch::V3));
    for n in [1, 5, ROWS + 1, PANEL + 1, 2 * PANEL + 3] {
        for set in &sets {
            assert!(bytes(n, *set) == bytes(n, Arch::new()), "{n}, {set:?}");
        }
    }
}

#[test]
fn the_bytes_are_the_same_at_any_number_of_threads() {
    for n in [PANEL + 1, 2 * PANEL + WIDTH + 5, 3 * PANEL + 2 * WIDTH + 7] {
        let of = |n_threads: usize| {
            let pool = ThreadPoolBuilder::new()
                .num_threads(n_threads)
                .build()
                .expect("threads");
            pool.install(|| bytes(n, Arch::new()))
        };
        let one = of(1);
        assert!(one == of(2) && one == of(3), "{n}");
    }
}

#[test]
fn a_matrix_without_inverse_has_no_finite_solution() {
    for n in [1, 2, 20, PANEL + 20] {
        let solve = |entry: &dyn Fn(usize, usize) -> f64| {
            let mut x: Vec<f64> = (0..n).map(|k| 1.0 + number(k, 0)).collect();
            Lu::new(Dense::from_fn(n, entry)).solve(&mut x);
            x
        };
        let place = (n / 2, n / 3);
        let with = |value: f64| solve(&move |i, j| if (i, j) == place { value } else { number(i, j) });
        for x in [
            solve(&|_, _| 0.0),
            solve(&|i, j| if j == n / 2 { 0.0 } else { number(i, j) }),
            solve(&|i, j| if i == n / 2 { 0.0 } else { number(i, j) }),
            solve(&|_, _| f64::NAN),
            with(f64::NAN),
        ] {
            assert!(x.iter().any(|x| !x.is_finite()), "{n}");
        }
        // An infinite entry may have a solution: nothing is wrong if there is one.
        for value in [f64::INFINITY, f64::NEG_INFINITY] {
            let _ = with(value);
            let _ = solve(&|_, _| value);
        }
    }
}
