//! Tolerances of pixels by the errors of their neighbours.

use super::answer::PixelAnswer;
use super::layers::Judged;
use super::points::Reference;
use super::sheet::Sheet;

/// The distance of the neighbours of a pixel, in pixels: 24 of them.
const REACH: usize = 2;

/// The greatest ratio of a pixel's error to the root mean square of its neighbours' errors.
///
/// Normal errors exceed it with a probability of 1e-11 (Student's t, 24 degrees of freedom). In 37 correct images of a black cube with one bright wall,
/// 64 × 64 pixels a wall and 4096 rays a pixel, half of them of either sequence, the largest of 900 000 pixels was 6.2.
const DEVIATIONS: f64 = 12.0;

/// The least expected numbers of a pixel's rays that hit emitters, and that miss them, for errors to count as similar in neighbouring pixels.
const MIN_COUNT: f64 = 30.0;

/// Reduces the statistical part of each pixel's tolerance to the spread of its neighbours' errors.
///
/// Scrambled points are far better than their proven bound, by a factor that depends on the outlines of the emitters among the
/// rays: it is nearly the same in adjacent pixels.
pub(super) fn narrow(sheet: &Sheet, judged: &mut [Judged], reference: &Reference<'_>) {
    let (columns, rows) = (sheet.width, sheet.height());
    let side = 2 * REACH + 1;
    if reference.n_rays == 0 || columns < side || rows < side {
        return;
    }
    // For each checked pixel the error, and the plane if it shows only one.
    let errors: Vec<Option<([f64; 3], Option<u32>)>> = (sheet.answers.iter())
        .zip(judged.iter())
        .map(|(answer, pixel)| answer.is_checked().then_some((pixel.error, plane(answer))))
        .collect();
    for (k, (answer, pixel)) in sheet.answers.iter().zip(judged.iter_mut()).enumerate() {
        let (Some((exact, _)), Some(own)) = (answer.irradiance(), plane(answer)) else {
            continue;
        };
        // At the border the neighbourhood is shifted inwards.
        let (left, top) = (
            (k % columns).saturating_sub(REACH).min(columns - side),
            (k / columns).saturating_sub(REACH).min(rows - side),
        );
        let around = (0..side * side)
            .map(|m| (top + m / side) * columns + left + m % side)
            .filter(|&m| m != k);
        let mut squares = [0.0; 3];
        let all_alike = around.into_iter().all(|m| {
            errors[m].is_some_and(|(error, plane)| {
                squares.iter_mut().zip(error).for_each(|(sum, e)| *sum += e * e);
                plane == Some(own)
            })
        });
        if !all_alike {
            continue;
        }
        for c in 0..3 {
            let (hits, misses) = reference.expected_counts(c, exact[c]);
            if hits < MIN_COUNT || misses < MIN_COUNT {
                continue;
            }
            let mean_square = squares[c] / (side * side - 1) as f64;
            let spread = (mean_square + reference.of_one_ray(c).powi(2)).sqrt();
            pixel.parts[0][c] = pixel.parts[0][c].min(DEVIATIONS * spread);
            pixel.outside |= !pixel.is_within(c);
        }
    }
}

fn plane(answer: &PixelAnswer) -> Option<u32> {
    answer.shown().and_then(|shown| shown.plane)
}
