//! The unfolded view: one orthographic tile per planar surface, laid out like an opened box.

use std::num::NonZeroU32;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::error::RenderError;
use super::flat_surface::{FlatSurface, Oriented, flat_surfaces};
use super::image::check_size;
use crate::scene::{Scene, SurfaceId};

/// The greatest distance of two edges of an unfolded box that count as one, relative to its longest edge.
const BOX_TOLERANCE: f64 = 1e-5;

/// The part of an unfolded image that shows one planar surface from its front.
///
/// The tile's pixels cover the surface's smallest bounding rectangle exactly: pixel (i, j) of it has its centre at
/// corner + (i + 1/2) `pixel_size[0]` right + (j + 1/2) `pixel_size[1]` down, and all pixels have one area, so that a rectangular surface's mean
/// is the mean over the tile's pixels. Seen from the front, right × up is the normal, so the tile is not mirrored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tile {
    /// The surface.
    pub surface: SurfaceId,
    /// Its name.
    pub name: String,
    /// First pixel column of the tile.
    pub left: u32,
    /// First pixel row of the tile.
    pub top: u32,
    /// Number of pixel columns.
    pub width: u32,
    /// Number of pixel rows.
    pub height: u32,
    /// The point of the surface's plane at the tile's top left corner, in m.
    pub corner: DVec3,
    /// The unit vector along a pixel row.
    pub right: DVec3,
    /// The unit vector along a pixel column.
    pub down: DVec3,
    /// Width and height of a pixel in m.
    pub pixel_size: [f64; 2],
    /// The greatest distance of the surface's vertices from the plane, in m, by rounding of the scene file.
    pub deviation: f64,
}

impl Tile {
    /// Returns the point of the surface's plane at image coordinates (x, y).
    #[must_use]
    pub fn point(&self, x: f64, y: f64) -> DVec3 {
        self.corner
            + self.right * ((x - f64::from(self.left)) * self.pixel_size[0])
            + self.down * ((y - f64::from(self.top)) * self.pixel_size[1])
    }

    /// Returns the unit normal, towards the viewer.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.down.cross(self.right)
    }

    /// Returns the corners of the tile's rectangle, counter-clockwise seen from the front.
    #[must_use]
    pub fn rectangle(&self) -> [DVec3; 4] {
        let across = self.right * (f64::from(self.width) * self.pixel_size[0]);
        let down = self.down * (f64::from(self.height) * self.pixel_size[1]);
        [
            self.corner + down,
            self.corner + down + across,
            self.corner + across,
            self.corner,
        ]
    }
}

/// The layout of an unfolded view.
///
/// Where the walls of a box (closed, or open on one side) are found among the surfaces, the largest is the base, the
/// first of the file among equals, and the box is opened as a cross around it, seen from its inside, or from its outside if the walls face outwards:
///
/// ```text
///         up
///   left  base  right  opposite
///         down
/// ```
///
/// Tiles that touch there touch in the scene. All other planar surfaces follow below in rows, in file order, with a gap between
/// them. The base and these tiles have the side of their rectangle to the right that is nearest to the first edge of
/// their first face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unfolded {
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// The tiles; they do not overlap.
    pub tiles: Vec<Tile>,
    /// Names of the surfaces without a tile: those that are not planar, or face both ways.
    pub left_out: Vec<String>,
}

/// The number of places of a cross, in the order of its tiles.
const N_PLACES: usize = 6;

impl Unfolded {
    /// Returns, for each surface without a tile, the reason.
    pub fn without_tile(&self) -> impl Iterator<Item = String> + '_ {
        self.left_out
            .iter()
            .map(|name| format!("{name} is not planar or faces both ways: it has no tile"))
    }

    /// Lays out tiles with `n_pixels` along the longest edge of all tiles; the other edges are in proportion, at least 1.
    ///
    /// # Errors
    /// [`RenderError::Empty`] without planar surfaces, [`RenderError::TooLarge`] for an image above the limit.
    pub fn new(scene: &Scene, n_pixels: NonZeroU32) -> Result<Self, RenderError> {
        let (surfaces, left_out) = flat_surfaces(scene);
        let longest = surfaces
            .iter()
            .flat_map(|surface| surface.natural.size)
            .fold(0.0, f64::max);
        let density = f64::from(n_pixels.get()) / longest;
        let mut sheet = Sheet {
            surfaces: &surfaces,
            density,
            tiles: Vec::new(),
            width: 0,
            height: 0,
        };
        let mut placed = vec![false; surfaces.len()];
        if let Some(places) = find_box(&surfaces) {
            for (k, _) in places.iter().flatten() {
                placed[*k] = true;
            }
            sheet.lay_cross(&places);
        }
        sheet.lay_rows(&placed, u64::from((n_pixels.get() / 64).max(1)));
        if sheet.tiles.is_empty() {
            return Err(RenderError::Empty);
        }
        let (width, height) = check_size(sheet.width, sheet.height)?;
        Ok(Self {
            width,
            height,
            tiles: sheet.tiles,
            left_out,
        })
    }
}

/// The tiles under construction.
struct Sheet<'a> {
    surfaces: &'a [FlatSurface],
    /// Pixels per metre.
    density: f64,
    tiles: Vec<Tile>,
    width: u64,
    height: u64,
}

impl Sheet<'_> {
    fn n_pixels(&self, length: f64) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "no length is above the longest, whose number of pixels is a u32"
        )]
        let n = (length * self.density).round() as u32;
        n.max(1)
    }

    fn put(&mut self, k: usize, oriented: &Oriented, [left, top]: [u64; 2], [width, height]: [u32; 2]) {
        self.width = self.width.max(left + u64::from(width));
        self.height = self.height.max(top + u64::from(height));
        let surface = &self.surfaces[k];
        self.tiles.push(Tile {
            surface: surface.surface,
            name: surface.name.clone(),
            // A sheet too large for 32 bits is refused after its layout.
            left: u32::try_from(left).unwrap_or(u32::MAX),
            top: u32::try_from(top).unwrap_or(u32::MAX),
            width,
            height,
            corner: oriented.corner,
            right: oriented.right,
            down: -oriented.up,
            pixel_size: [
                oriented.size[0] / f64::from(width),
                oriented.size[1] / f64::from(height),
            ],
            deviation: surface.deviation,
        });
    }

    fn lay_cross(&mut self, places: &[Option<(usize, Oriented)>; N_PLACES]) {
        let size = |place: usize| places[place].as_ref().map(|(_, oriented)| oriented.size);
        let Some([width, height]) = size(0) else { return };
        let depth = size(1)
            .or(size(2))
            .map(|size| size[0])
            .or(size(4).or(size(5)).map(|size| size[1]));
        let [w, h, d] = [width, height, depth.unwrap_or(0.0)].map(|length| self.n_pixels(length));
        let [wide, high, deep] = [w, h, d].map(u64::from);
        let layout = [
            ([deep, deep], [w, h]),
            ([deep + wide, deep], [d, h]),
            ([0, deep], [d, h]),
            ([deep + wide + deep, deep], [w, h]),
            ([deep, 0], [w, d]),
            ([deep, deep + high], [w, d]),
        ];
        for (place, (position, size_in_pixels)) in places.iter().zip(layout) {
            if let Some((k, oriented)) = place {
                self.put(*k, oriented, position, size_in_pixels);
            }
        }
    }

    fn lay_rows(&mut self, placed: &[bool], gap: u64) {
        let surfaces = self.surfaces;
        let rest: Vec<(usize, &Oriented, [u32; 2])> = (0..surfaces.len())
            .filter(|&k| !placed[k])
            .map(|k| {
                let oriented = &surfaces[k].natural;
                let size = oriented.size.map(|length| self.n_pixels(length));
                (k, oriented, size)
            })
            .collect();
        let area: f64 = rest
            .iter()
            .map(|(_, _, size)| size.iter().map(|&n| f64::from(n) + gap as f64).product::<f64>())
            .sum();
        let limit = (1.5 * area).sqrt().max(self.width as f64);
        let (mut left, mut top) = (0, if self.height > 0 { self.height + gap } else { 0 });
        let mut next_top = top;
        for (k, oriented, size) in rest {
            if left > 0 && (left + u64::from(size[0])) as f64 > limit {
                (left, top) = (0, next_top);
            }
            self.put(k, oriented, [left, top], size);
            left += u64::from(size[0]) + gap;
            next_top = next_top.max(top + u64::from(size[1]) + gap);
        }
    }
}

/// Finds the walls of a box: base, right, left, opposite, up, down.
fn find_box(surfaces: &[FlatSurface]) -> Option<[Option<(usize, Oriented)>; N_PLACES]> {
    let mut order: Vec<usize> = (0..surfaces.len()).filter(|&k| surfaces[k].is_rectangle).collect();
    // The sort is stable: among equal areas (to the tolerance of a box) the first of the file wins.
    let area = |k: &usize| surfaces[*k].natural.size.iter().product::<f64>();
    let largest = order.iter().map(area).fold(0.0, f64::max);
    let rank = |k: &usize| (area(k) / (BOX_TOLERANCE * largest)).round();
    order.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    order.iter().find_map(|&base| {
        [1.0, -1.0]
            .into_iter()
            .find_map(|side| box_around(surfaces, &order, base, side))
    })
}

/// Finds the walls of the box with the wall `base` that lies on its front (`side` = 1) or at its back (−1).
fn box_around(
    surfaces: &[FlatSurface],
    walls: &[usize],
    base: usize,
    side: f64,
) -> Option<[Option<(usize, Oriented)>; N_PLACES]> {
    let natural = &surfaces[base].natural;
    let (r, u) = (natural.right, natural.up);
    let inward = r.cross(u) * side;
    let [width, height] = natural.size;
    let top_left = natural.corner;
    let top_right = top_left + r * width;
    let bottom_left = top_left - u * height;
    // The directions right and up of every neighbour, folded into the base's plane.
    let frames = [(inward, u), (-inward, u), (-r, u), (r, inward), (r, -inward)];
    let mut candidates: Vec<(usize, usize, Oriented, f64)> = Vec::new();
    for &k in walls.iter().filter(|&&k| k != base) {
        let surface = &surfaces[k];
        for (place, &(right, up)) in frames.iter().enumerate() {
            if surface.normal.dot(right.cross(up)) < 1.0 - BOX_TOLERANCE {
                continue;
            }
            let tile = surface.oriented(right, up);
            let [w, h] = tile.size;
            // The depth of the box by this tile, the expected corner of the tile, and its size.
            let (depth, corner, size) = match place {
                0 => (w, top_right, [w, height]),
                1 => (w, top_left + inward * w, [w, height]),
                2 => {
                    let depth = inward.dot(tile.corner - top_right);
                    (depth, top_right + inward * depth, [width, height])
                }
                3 => (h, top_left + inward * h, [width, h]),
                _ => (h, bottom_left, [width, h]),
            };
            let tolerance = BOX_TOLERANCE * width.max(height).max(depth);
            let fits = (tile.corner - corner).length() <= tolerance
                && (w - size[0]).abs() <= tolerance
                && (h - size[1]).abs() <= tolerance
                && depth > tolerance;
            if fits {
                candidates.push((place + 1, k, tile, depth));
            }
        }
    }
    // Walls of other boxes on the same base have another depth.
    let mut best: Option<[Option<(usize, Oriented)>; N_PLACES]> = None;
    let count = |places: &[Option<(usize, Oriented)>; N_PLACES]| places.iter().flatten().count();
    for depth in candidates.iter().map(|candidate| candidate.3) {
        let mut places: [Option<(usize, Oriented)>; N_PLACES] = std::array::from_fn(|_| None);
        places[0] = Some((base, natural.clone()));
        for (place, k, tile, own_depth) in &candidates {
            let same = (own_depth - depth).abs() <= BOX_TOLERANCE * width.max(height).max(depth);
            if same && places[*place].is_none() {
                places[*place] = Some((*k, tile.clone()));
            }
        }
        if count(&places) >= N_PLACES - 1 && best.as_ref().is_none_or(|best| count(&places) > count(best)) {
            best = Some(places);
        }
    }
    best
}
