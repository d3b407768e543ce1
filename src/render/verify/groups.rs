//! Sums and means over many pixels.

use super::answer::PixelAnswer;
use super::layers::Judged;
use super::points::Reference;
use super::report::WallReport;
use super::sheet::Sheet;
use super::tolerance;
use crate::geometry::polygon;
use crate::render::unfolded::Tile;

/// The expected number of hits of a wall from which the spread of its errors is used.
const MIN_HITS: f64 = 1000.0;

/// Sums over all pixels.
#[derive(Default)]
pub(super) struct Tally {
    pub(super) n_pixels: usize,
    pub(super) n_background: usize,
    pub(super) n_backs: usize,
    pub(super) n_checked: usize,
    pub(super) n_drawn: usize,
    pub(super) n_outside: usize,
    pub(super) n_misplaced: usize,
    pub(super) n_inconsistent: usize,
    pub(super) max_error: f64,
    pub(super) squares: f64,
    pub(super) max_parts: [f64; 3],
}

impl Tally {
    pub(super) fn of<'a>(pixels: impl Iterator<Item = (&'a PixelAnswer, &'a Judged)>) -> Self {
        let mut tally = Self::default();
        for (answer, pixel) in pixels {
            tally.add(answer, pixel);
        }
        tally
    }

    fn add(&mut self, answer: &PixelAnswer, pixel: &Judged) {
        self.n_pixels += usize::from(answer.on_surface() && !answer.is_back());
        self.n_background += usize::from(!answer.on_surface());
        self.n_backs += usize::from(answer.is_back());
        self.n_checked += usize::from(answer.is_checked());
        self.n_drawn += usize::from(answer.is_checked() && answer.drawn().is_some());
        self.n_outside += usize::from(pixel.outside);
        self.n_misplaced += usize::from(pixel.misplaced);
        self.n_inconsistent += usize::from(pixel.inconsistent);
        for c in 0..3 {
            self.max_error = self.max_error.max(pixel.error[c].abs());
            self.squares += pixel.error[c] * pixel.error[c];
            for (max, part) in self.max_parts.iter_mut().zip(&pixel.parts) {
                *max = max.max(part[c]);
            }
        }
    }
}

/// The mean of the checked pixels of a group, one channel.
#[derive(Clone, Copy, Debug, Default)]
struct GroupMean {
    n_checked: usize,
    /// The mean of the exact answers.
    expected: f64,
    /// The mean error.
    error: f64,
    statistical: f64,
    /// The statistical, offset and rounding parts of the tolerance.
    tolerance: f64,
}

impl GroupMean {
    fn new<'a>(
        pixels: impl Iterator<Item = (&'a PixelAnswer, &'a Judged)>,
        channel: usize,
        reference: &Reference<'_>,
        log_odds: f64,
    ) -> Self {
        let (mut group, mut squares, mut offset, mut rounding) = (Self::default(), 0.0, 0.0, 0.0);
        // The error of redrawn shadow rays, their number, and their bias.
        let (mut known, mut n_mixed, mut bias) = (0.0, 0.0, 0.0);
        for (answer, judged) in pixels {
            let Some((exact, change)) = answer.irradiance() else {
                continue;
            };
            group.n_checked += 1;
            group.expected += exact[channel];
            group.error += judged.error[channel];
            squares += judged.error[channel].powi(2);
            offset += change[channel];
            rounding += judged.parts[2][channel];
            if let Some(drawn) = answer.drawn() {
                known += judged.parts[0][channel];
                n_mixed += drawn.n_mixed;
                bias += drawn.bias[channel];
            }
        }
        let m = group.n_checked.max(1) as f64;
        group.expected /= m;
        group.error /= m;
        group.statistical = reference.statistical(channel, group.expected, m, log_odds);
        if reference.expected_hits(channel, group.expected) * m >= MIN_HITS {
            group.statistical = group.statistical.min(tolerance::self_normalised(squares, m, log_odds));
        }
        if known > 0.0 {
            // Drawing the rays again does not show that their mean is right.
            let by_spread = tolerance::self_normalised(squares, m, log_odds) + bias / m;
            let is_trusted = n_mixed >= MIN_HITS;
            group.statistical = if is_trusted {
                by_spread.min(known / m)
            } else {
                known / m
            };
        }
        group.tolerance = group.statistical + (offset / m).abs() + rounding / m;
        group
    }

    fn is_right(&self) -> bool {
        self.error.abs() <= self.tolerance
    }
}

/// Counts the pixel rows and columns of a sheet whose mean is wrong.
pub(super) fn count_wrong_strips(sheet: &Sheet, judged: &[Judged], reference: &Reference<'_>, log_odds: f64) -> usize {
    let (columns, rows) = (sheet.width, sheet.height());
    let is_wrong = |start: usize, step: usize, n: usize| {
        let strip = || sheet.answers.iter().zip(judged).skip(start).step_by(step).take(n);
        (0..3).any(|c| !GroupMean::new(strip(), c, reference, log_odds).is_right())
    };
    let wrong_rows = (0..rows).filter(|row| is_wrong(row * columns, 1, columns)).count();
    let wrong_columns = (0..columns).filter(|column| is_wrong(*column, columns, rows)).count();
    wrong_rows + wrong_columns
}

/// Returns the report on a tile of an unfolded view.
pub(super) fn tile_report(
    tile: &Tile,
    sheet: &Sheet,
    judged: &[Judged],
    reference: &Reference<'_>,
    log_odds: f64,
) -> WallReport {
    let mut report = part_report(&tile.name, &sheet.answers.iter().zip(judged), reference, log_odds);
    if report.n_checked == sheet.answers.len() {
        let shaded = sheet.answers.iter().any(PixelAnswer::is_shaded);
        report.exact = exact_mean(tile, shaded, reference);
    }
    report.quadrature = report
        .exact
        .map(|exact| std::array::from_fn(|c| report.expected[c] - exact[c]));
    for (c, missed) in report.quadrature.iter().flatten().enumerate() {
        report.error[c] += missed;
        report.tolerance[c] += missed.abs();
    }
    report
}

/// Returns the report on pixels that show one surface.
pub(super) fn part_report<'a>(
    name: &str,
    pixels: &(impl Iterator<Item = (&'a PixelAnswer, &'a Judged)> + Clone),
    reference: &Reference<'_>,
    log_odds: f64,
) -> WallReport {
    let means = [0, 1, 2].map(|c| GroupMean::new(pixels.clone(), c, reference, log_odds));
    WallReport {
        name: name.to_owned(),
        n_checked: means[0].n_checked,
        mean: means.map(|mean| mean.expected + mean.error),
        expected: means.map(|mean| mean.expected),
        exact: None,
        quadrature: None,
        error: means.map(|mean| mean.error),
        tolerance: means.map(|mean| mean.tolerance),
        statistical: means.map(|mean| mean.statistical),
        passed: means.iter().all(GroupMean::is_right),
    }
}

/// Returns Σ_j E_j A F_j / A for a tile that its surface fills, or `None` where no closed form is known.
fn exact_mean(tile: &Tile, shaded: bool, reference: &Reference<'_>) -> Option<[f64; 3]> {
    let rectangle = tile.rectangle();
    let area = polygon::area_vector(&rectangle).length();
    if (reference.surface_area(tile) - area).abs() > 1e-9 * area {
        return None;
    }
    let mut mean = [0.0; 3];
    for (emitter, exitance) in &reference.emitters {
        let exchange_area = reference.exchange_area(tile, shaded, emitter)?;
        for c in 0..3 {
            mean[c] += exitance[c] * exchange_area / area;
        }
    }
    Some(mean)
}
