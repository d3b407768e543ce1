//! Rectangles of an image with the expected content of their pixels.

use glam::DVec3;

use super::answer::{Centre, PixelAnswer, Shown};
use super::error::VerifyError;
use super::faces::{Faces, Seen};
use super::light::Light;
use super::points::Reference;
use super::region::SeenFrom;
use crate::render::samples::PixelSamples;
use crate::render::unfolded::Tile;
use crate::render::view::CameraRecord;
use crate::threads;

/// The side of the square blocks of pixels for which candidates are found together.
const BLOCK_SIDE: usize = 16;

/// A rectangle of pixels with their answers, row by row.
pub(super) struct Sheet {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) width: usize,
    pub(super) answers: Vec<PixelAnswer>,
    /// The surface at the centre of each pixel.
    pub(super) centres: Vec<Centre>,
    /// The eye and the axis of a camera; depth is measured along it, and is 0 without one.
    pub(super) view: Option<(DVec3, DVec3)>,
}

impl Sheet {
    /// Returns the index of pixel k among the pixels of an image.
    pub(super) fn index(&self, k: usize, image_width: usize) -> usize {
        (self.top + k / self.width) * image_width + self.left + k % self.width
    }

    pub(super) fn height(&self) -> usize {
        self.answers.len() / self.width.max(1)
    }

    /// Returns the sheet of a tile of an unfolded view.
    pub(super) fn of_tile(tile: &Tile, reference: &Reference<'_>) -> Self {
        let (answers, centres) = reference.answers(tile);
        Self {
            left: tile.left as usize,
            top: tile.top as usize,
            width: tile.width as usize,
            answers,
            centres,
            view: None,
        }
    }

    /// Returns the sheet of a perspective image, with the hit of each sample found again in f64.
    pub(super) fn of_camera(
        record: &CameraRecord,
        (width, height): (u32, u32),
        n_samples: Option<&[u32]>,
        reference: &Reference<'_>,
    ) -> Result<Self, VerifyError> {
        let camera = record
            .camera()
            .map_err(|error| VerifyError::BadCamera(error.to_string()))?;
        let (columns, rows) = (width as usize, height as usize);
        let faces = Faces::new(reference, camera.eye());
        let attributes = reference.attributes;
        let samples = PixelSamples::new(&attributes.render, &attributes.view);
        let ray = |x: f64, y: f64| camera.primary_ray(x, y, width, height).1;
        let blocks: Vec<[usize; 2]> = (0..rows.div_ceil(BLOCK_SIDE))
            .flat_map(|j| (0..columns.div_ceil(BLOCK_SIDE)).map(move |i| [i * BLOCK_SIDE, j * BLOCK_SIDE]))
            .collect();
        let bounds = |[x, y]: [usize; 2]| [x, y, (x + BLOCK_SIDE).min(columns), (y + BLOCK_SIDE).min(rows)];
        let found: Vec<Vec<(PixelAnswer, Centre)>> = threads::collect_from(&blocks, |&block| {
            let [x0, y0, x1, y1] = bounds(block);
            let [left, top, right, bottom] = [x0, y0, x1, y1].map(|place| place as f64);
            let edges = [ray(left, top), ray(right, top), ray(right, bottom), ray(left, bottom)];
            let middle = ray(0.5 * (left + right), 0.5 * (top + bottom));
            let mut eye = Eye {
                reference,
                faces: &faces,
                place: camera.eye(),
                candidates: faces.inside(camera.eye(), edges, middle),
                samples,
                n_samples,
                seen: Vec::new(),
            };
            (y0..y1)
                .flat_map(|y| (x0..x1).map(move |x| (x, y)))
                .map(|(x, y)| eye.pixel(y * columns + x, |dx, dy| ray(x as f64 + dx, y as f64 + dy)))
                .collect()
        });
        let mut answers = vec![PixelAnswer::Background; columns * rows];
        let mut centres = vec![Centre::Unsure; columns * rows];
        for (&block, of_block) in blocks.iter().zip(found) {
            let [x0, y0, x1, _] = bounds(block);
            for (k, (answer, centre)) in of_block.into_iter().enumerate() {
                let index = (y0 + k / (x1 - x0)) * columns + x0 + k % (x1 - x0);
                (answers[index], centres[index]) = (answer, centre);
            }
        }
        Ok(Self {
            left: 0,
            top: 0,
            width: columns,
            answers,
            centres,
            view: Some((camera.eye(), ray(0.5 * f64::from(width), 0.5 * f64::from(height)))),
        })
    }
}

/// A camera restricted to one block of pixels.
struct Eye<'a> {
    reference: &'a Reference<'a>,
    faces: &'a Faces<'a>,
    place: DVec3,
    candidates: Vec<usize>,
    samples: PixelSamples,
    /// The number of samples of each pixel, if it varies.
    n_samples: Option<&'a [u32]>,
    /// The emitters seen from each face found so far.
    seen: Vec<(usize, SeenFrom)>,
}

impl Eye<'_> {
    /// Returns the answer of a pixel of the given number and the content of its centre, given the rays through its points in \[0, 1\]².
    fn pixel(&mut self, number: usize, ray: impl Fn(f64, f64) -> DVec3) -> (PixelAnswer, Centre) {
        let centre = match self.faces.look(&self.candidates, self.place, ray(0.5, 0.5)) {
            Seen::Unsure => Centre::Unsure,
            Seen::Nothing => Centre::Nothing,
            Seen::Face(hit) => Centre::Face {
                face: u32::try_from(hit.face).unwrap_or(u32::MAX),
                alone: hit.alone,
                point: hit.point,
                slack: self.faces.slack(&hit),
            },
        };
        (self.answer(number, ray), centre)
    }

    fn answer(&mut self, number: usize, ray: impl Fn(f64, f64) -> DVec3) -> PixelAnswer {
        let n = self.n_samples.map_or(self.samples.n_first(), |numbers| numbers[number]);
        let share = 1.0 / f64::from(n);
        let mut light = Light::default();
        // For each sample the face, if its front is visible.
        let mut fronts: Vec<Option<usize>> = Vec::new();
        let mut n_faces = 0;
        for (sample, (x, y)) in self.samples.places(number as u64, 0, n).enumerate() {
            let found = match self.faces.look(&self.candidates, self.place, ray(x, y)) {
                Seen::Unsure => return PixelAnswer::Border,
                Seen::Nothing => None,
                Seen::Face(hit) => Some(hit),
            };
            n_faces += usize::from(found.is_some());
            // A back is black.
            let front = found.filter(|hit| hit.front);
            fronts.push(front.map(|hit| hit.face));
            if let Some(hit) = front {
                let of_face = self.seen.iter().position(|(face, _)| *face == hit.face);
                let k = of_face.unwrap_or_else(|| {
                    self.seen.push((hit.face, SeenFrom::default()));
                    self.seen.len() - 1
                });
                let region = self.faces.region(hit.face);
                let seen = &mut self.seen[k].1;
                let stream = self.reference.stream(number, sample);
                self.reference
                    .add_light(&mut light, (share, stream), hit.point, region, seen);
            }
        }
        if n_faces == 0 {
            return PixelAnswer::Background;
        }
        let mut albedo = [0.0; 3];
        for &face in fronts.iter().flatten() {
            let (_, reflectance) = self.faces.owners[face].material;
            albedo
                .iter_mut()
                .zip(reflectance)
                .for_each(|(sum, rho)| *sum += share * rho);
        }
        PixelAnswer::Surface(Box::new(Shown {
            albedo: Some(albedo),
            surface: common(&fronts, |face| self.faces.owners[face].surface),
            plane: common(&fronts, |face| self.faces.owners[face].plane),
            material: common(&fronts, |face| self.faces.owners[face].material),
            irradiance: light.irradiance(),
            shaded: light.shaded,
            drawn: light.drawn(),
            rounding: light.rounding,
            front: fronts.iter().any(Option::is_some),
        }))
    }
}

/// Returns the common value of all samples, if every one of them sees a face's front.
fn common<T: PartialEq>(fronts: &[Option<usize>], of: impl Fn(usize) -> T) -> Option<T> {
    let mut values = fronts.iter().map(|face| face.map(&of));
    let first = values.next()??;
    values.all(|value| value.as_ref() == Some(&first)).then_some(first)
}
