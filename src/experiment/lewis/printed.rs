//! The paper's numbers, and those of an independent program for the same problem.

/// One line of table 2: l, the iterations of Gauss-Seidel and multigrid, their times on a SPARCstation 2 in s, and the ratio of these.
pub(super) struct PrintedLine {
    pub(super) level: u32,
    pub(super) iterations: [usize; 2],
    pub(super) times_s: Option<[f64; 2]>,
    pub(super) ratio: Option<f64>,
}

#[rustfmt::skip]
pub(super) const TABLE_2: [PrintedLine; 4] = [
    PrintedLine { level: 1, iterations: [11, 4], times_s: None, ratio: None },
    PrintedLine { level: 2, iterations: [11, 4], times_s: Some([0.13, 0.10]), ratio: Some(0.769) },
    PrintedLine { level: 3, iterations: [11, 4], times_s: Some([2.0, 1.0]), ratio: Some(0.500) },
    PrintedLine { level: 4, iterations: [12, 4], times_s: Some([35.0, 15.0]), ratio: Some(0.429) },
];

/// The counts of an independent program: l, iterations and multiplications of Gauss-Seidel and multigrid.
pub(super) struct Expected {
    pub(super) level: u32,
    pub(super) iterations: [usize; 2],
    pub(super) multiply_adds: [f64; 2],
}

#[rustfmt::skip]
pub(super) const EXPECTED: [Expected; 6] = [
    Expected { level: 1, iterations: [11, 4], multiply_adds: [6.34e3, 8.64e3] },
    Expected { level: 2, iterations: [11, 4], multiply_adds: [1.01e5, 6.11e4] },
    Expected { level: 3, iterations: [11, 4], multiply_adds: [1.62e6, 8.23e5] },
    Expected { level: 4, iterations: [12, 4], multiply_adds: [2.83e7, 1.29e7] },
    Expected { level: 5, iterations: [12, 4], multiply_adds: [4.53e8, 2.05e8] },
    Expected { level: 6, iterations: [12, 4], multiply_adds: [7.25e9, 3.28e9] },
];

/// The values of max |r| after each cycle at l = 4, by the same program.
pub(super) const MULTIGRID_RESIDUALS: [f64; 8] = [
    5.571e-3, 6.029e-4, 7.661e-5, 1.081e-5, 1.492e-6, 2.035e-7, 2.769e-8, 3.763e-9,
];

/// The values of max |r| after each sweep of Gauss-Seidel at l = 4, by the same program.
pub(super) const GAUSS_SEIDEL_RESIDUALS: [f64; 12] = [
    3.253e-2, 1.361e-2, 6.770e-3, 3.221e-3, 1.470e-3, 6.583e-4, 2.922e-4, 1.291e-4, 5.695e-5, 2.509e-5, 1.104e-5,
    4.861e-6,
];

/// Means of the solution over the walls at l = 0, 3 and 4, by the same program.
#[rustfmt::skip]
pub(super) const WALL_MEANS: [(u32, [f64; 6]); 3] = [
    (0, [0.025_926_661_7, 0.072_224_272_0, 0.049_932_830_0, 0.092_978_373_2, 0.112_348_867_6, 0.320_682_200_9]),
    (3, [0.024_413_582_0, 0.070_834_220_0, 0.047_374_014_7, 0.091_193_218_0, 0.113_734_641_0, 0.320_329_636_4]),
    (4, [0.025_008_182_0, 0.072_187_937_7, 0.048_525_134_9, 0.092_998_457_7, 0.116_539_703_7, 0.322_128_072_9]),
];

/// The cycles at l = 1 to 4 of forms that the paper prints or that are easily mistaken for them, by the same program.
pub(super) const JACOBI_CYCLES: [usize; 4] = [7, 6, 6, 6];
pub(super) const PLUS_SIGN_CYCLES: [usize; 4] = [50, 7, 51, 7];
