//! Checks the numbers of patches, as far as they follow from the scene.

use super::answer::Centre;
use super::layers::Layers;
use super::sheet::Sheet;

/// Counts the pixels with a wrong patch, or the fewest that explain the contradictions.
///
/// The patches of a face have consecutive numbers. The number of patches of a face is not in the file, so in the order of patches each face must appear only once.
pub(super) fn count_wrong(layers: &Layers<'_>, sheets: &[Sheet], image_width: usize) -> usize {
    let Some(patches) = layers.patch else { return 0 };
    let centres = sheets.iter().flat_map(|sheet| {
        let of_pixel = |(k, centre): (usize, &Centre)| match *centre {
            Centre::Face { face, alone: true, .. } => Some((patches[sheet.index(k, image_width)], face)),
            _ => None,
        };
        sheet.centres.iter().enumerate().filter_map(of_pixel)
    });
    let mut faces: Vec<(u32, u32)> = centres.collect();
    faces.sort_unstable();
    let mut runs: Vec<u32> = faces.into_iter().map(|(_, face)| face).collect();
    runs.dedup();
    let n_runs = runs.len();
    runs.sort_unstable();
    runs.dedup();
    n_runs - runs.len()
}
