//! The exact direct irradiance at the visible points of an image.

use glam::DVec3;

use super::answer::{Centre, PixelAnswer, Shown};
use super::clear_view::{Plate, is_clear, misses_region};
use super::light::Light;
use super::region::{Between, Region, SeenFrom, as_occluders, contains};
use super::rounding::Rounding;
use super::shadow_rays::{ShadowRays, Start};
use super::size::Size;
use super::tolerance::{LEAK, effective_samples, hoeffding};
use crate::form_factor::partial::{Accuracy, exchange_area};
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon;
use crate::geometry::rectangle::rectangle_exchange_area;
use crate::render::attributes::{Attributes, PolygonRecord};
use crate::render::direct::DirectMethod;
use crate::render::exr::Pixels;
use crate::render::samples::PixelSamples;
use crate::render::unfolded::Tile;
use crate::render::view::ViewDescription;
use crate::scene::slack_of;
use crate::threads;
use crate::visibility::occluders::are_sides_of_a_sheet;

/// The fraction of an emitter's form factor in doubt above which a point is not checked: the rounding of corners decides its visibility.
const UNTOLD: f64 = 0.01;

/// The scene of an image, prepared for closed forms.
pub(super) struct Reference<'a> {
    pub(super) attributes: &'a Attributes,
    /// All faces: surface by surface, in file order.
    pub(super) plates: Vec<Plate>,
    pub(super) emitters: Vec<(Plate, [f64; 3])>,
    /// The largest exitance per channel.
    brightest: [f64; 3],
    /// The sum of all exitances per channel.
    total: [f64; 3],
    pub(super) nothing_reflects: bool,
    size: Size,
    /// The length below which geometry is rounding, in m.
    slack: f64,
    /// The greatest distance, by the rounding of their corners, of faces that were meant to touch, in m.
    touching: f64,
    /// The number of rays per pixel; 0 where the direct pass has no noise at an unoccluded point.
    pub(super) n_rays: u64,
    n_effective: f64,
    /// True if the image's method is exact where an emitter is partially visible.
    knows_penumbras: bool,
    /// The rays of an inexact method, if they can be drawn again.
    shadow_rays: Option<ShadowRays>,
    /// The height above the surface of the estimate's origin, in m.
    offset: f64,
}

impl<'a> Reference<'a> {
    /// Prepares the scene; returns `None` if nothing emits. `n_rays` is per sample.
    pub(super) fn new(attributes: &'a Attributes, n_rays: u32) -> Option<Self> {
        let records = || attributes.surfaces.iter().flat_map(|surface| &surface.polygons);
        let plate = |record: &PolygonRecord| Plate::new(record.corners.clone());
        let emitters: Vec<(Plate, [f64; 3])> = records()
            .filter(|record| record.emits())
            .map(|record| (plate(record), record.exitance))
            .collect();
        if emitters.is_empty() {
            return None;
        }
        let size = Size::of(records().flat_map(|record| &record.corners));
        let per_channel = |fold: fn(f64, f64) -> f64| {
            [0, 1, 2].map(|c| emitters.iter().map(|(_, exitance)| exitance[c]).fold(0.0, fold))
        };
        let n_samples = u64::from(attributes.render.samples.get()).pow(2);
        let touching = slack_of(records().map(|record| record.corners.as_slice()));
        Some(Self {
            attributes,
            plates: records().map(plate).collect(),
            brightest: per_channel(f64::max),
            total: per_channel(|a, b| a + b),
            emitters,
            nothing_reflects: records().all(|record| record.reflectance.iter().all(|&rho| rho <= 0.0)),
            touching,
            slack: 2e-12 * size.extent + size.rounding(),
            shadow_rays: ShadowRays::new(attributes, &size, touching),
            size,
            n_rays: n_samples * u64::from(n_rays),
            knows_penumbras: !matches!(attributes.render.direct, DirectMethod::Polygons { .. }),
            n_effective: n_samples as f64 * effective_samples(n_rays.max(1), attributes.render.sequence),
            // The factor covers the rounding of ray origins to f32.
            offset: if n_rays > 0 { 1.1 * attributes.ray_offset } else { 0.0 },
        })
    }

    /// Returns the rounding of the colours.
    pub(super) fn layer_rounding(&self) -> Rounding {
        // The form factors of a field are stored at full precision.
        let is_field = self.attributes.field.is_some();
        Rounding::of(if is_field { Pixels::F32 } else { self.attributes.pixels })
    }

    pub(super) fn n_effective(&self) -> f64 {
        if self.n_rays > 0 { self.n_effective } else { 0.0 }
    }

    /// Returns the least irradiance that the noise of a pixel is computed from.
    pub(super) fn leak(&self, channel: usize, answer: &PixelAnswer) -> f64 {
        if answer.is_shaded() {
            LEAK * self.brightest[channel]
        } else {
            0.0
        }
    }

    /// Returns the area of a tile's surface, in m².
    pub(super) fn surface_area(&self, tile: &Tile) -> f64 {
        self.records(tile)
            .iter()
            .map(|record| polygon::area_vector(&record.corners).length())
            .sum()
    }

    fn records(&self, tile: &Tile) -> &'a [PolygonRecord] {
        &self.attributes.surfaces[tile.surface.0 as usize].polygons
    }

    /// Returns the expected number of a pixel's rays that hit the brightest emitter, for an irradiance of `exact`.
    pub(super) fn expected_hits(&self, channel: usize, exact: f64) -> f64 {
        if self.brightest[channel] > 0.0 {
            self.n_effective * exact / self.brightest[channel]
        } else {
            0.0
        }
    }

    /// Returns the expected numbers of a pixel's rays that hit the brightest emitter and that miss it, for an irradiance of `exact`.
    pub(super) fn expected_counts(&self, channel: usize, exact: f64) -> (f64, f64) {
        let hits = self.expected_hits(channel, exact);
        (hits, self.n_effective - hits)
    }

    /// Returns the greatest standard deviation of a pixel of the given irradiance, without rounding.
    pub(super) fn standard_deviation(&self, channel: usize, exact: f64) -> f64 {
        let p = exact / self.brightest[channel];
        self.brightest[channel] * (p * (1.0 - p) / self.n_effective).sqrt()
    }

    /// Returns the greatest contribution of one ray to a pixel.
    pub(super) fn of_one_ray(&self, channel: usize) -> f64 {
        self.brightest[channel] / self.n_rays.max(1) as f64
    }

    /// Returns the statistical tolerance of the mean over `n_pixels` pixels from `exact`; a ray's value is between 0 and the largest exitance.
    pub(super) fn statistical(&self, channel: usize, exact: f64, n_pixels: f64, log_odds: f64) -> f64 {
        let scale = self.brightest[channel];
        if self.n_rays == 0 || scale <= 0.0 {
            return 0.0;
        }
        scale * hoeffding(exact / scale, self.n_effective * n_pixels, log_odds)
    }

    /// Returns the rounding of a layer's value, and of the closed forms.
    pub(super) fn rounding(&self, channel: usize, exact: f64) -> f64 {
        let Rounding { relative, absolute } = self.layer_rounding();
        relative * exact + (1e-14 + self.size.relative_rounding()) * self.total[channel] + absolute
    }

    /// Prepares a convex region with the given unit normal, covered by the given faces.
    pub(super) fn region<'b>(&'b self, corners: &[DVec3], normal: DVec3, faces: &'b [Plate]) -> Region<'b> {
        let between = |(emitter, _): &(Plate, _)| {
            let meant = self.between(corners, normal, emitter, self.slack + self.touching);
            let mut literal = self.between(corners, normal, emitter, self.slack);
            // A bent face does not hide itself.
            literal.retain(|&plate| !faces.iter().any(|face| face.is(plate)) && !emitter.is(plate));
            let is_own = faces.iter().any(|face| face.is(emitter));
            let is_sheet =
                self.touching > 0.0 && (is_own || are_sides_of_a_sheet(corners, &emitter.corners, self.touching));
            Between {
                meant,
                literal,
                is_sheet,
            }
        };
        Region {
            corners: corners.to_vec(),
            normal,
            faces,
            between: self.emitters.iter().map(between).collect(),
            touching: self.touching,
        }
    }

    /// Returns the answers of all pixels of a tile and the content of their centres, row by row.
    pub(super) fn answers(&self, tile: &Tile) -> (Vec<PixelAnswer>, Vec<Centre>) {
        let records = self.records(tile);
        let first = self.first_face(tile);
        let faces = &self.plates[first..first + records.len()];
        let region = self.region(&tile.rectangle(), tile.normal(), faces);
        let material = records.first().map(|record| (record.exitance, record.reflectance));
        let uniform = records
            .iter()
            .all(|record| Some((record.exitance, record.reflectance)) == material);
        let n_pixels = tile.width as usize * tile.height as usize;
        let columns = tile.width as usize;
        let samples = PixelSamples::new(&self.attributes.render, &self.attributes.view);
        let pixel =
            |k: usize| (tile.top as usize + k / columns) * self.image_width() + tile.left as usize + k % columns;
        let answers = threads::collect_with(n_pixels, SeenFrom::default, |seen, k| {
            let corner = (
                f64::from(tile.left) + (k % columns) as f64,
                f64::from(tile.top) + (k / columns) as f64,
            );
            let points: Vec<DVec3> = samples
                .places(0, 0, samples.n_first())
                .map(|(x, y)| tile.point(corner.0 + x, corner.1 + y))
                .collect();
            let answer = match self.coverage(tile, &points) {
                Coverage::None => PixelAnswer::Background,
                Coverage::Partial => PixelAnswer::Border,
                Coverage::Full => {
                    let mut light = Light::default();
                    let share = 1.0 / points.len() as f64;
                    for (sample, &point) in points.iter().enumerate() {
                        let stream = self.stream(pixel(k), sample);
                        self.add_light(&mut light, (share, stream), point, &region, seen);
                    }
                    let common = material.filter(|_| uniform);
                    PixelAnswer::Surface(Box::new(Shown {
                        albedo: common.map(|(_, reflectance)| reflectance),
                        surface: Some(tile.surface),
                        plane: Some(tile.surface.0),
                        material: common,
                        irradiance: light.irradiance(),
                        shaded: light.shaded,
                        drawn: light.drawn(),
                        rounding: light.rounding,
                        front: true,
                    }))
                }
            };
            (answer, self.centre(tile, tile.point(corner.0 + 0.5, corner.1 + 0.5)))
        });
        answers.into_iter().unzip()
    }

    /// Returns the number of the first face of a tile's surface.
    fn first_face(&self, tile: &Tile) -> usize {
        let before = &self.attributes.surfaces[..tile.surface.0 as usize];
        before.iter().map(|surface| surface.polygons.len()).sum()
    }

    fn is_exact(&self) -> bool {
        self.attributes.render.direct == DirectMethod::Exact
    }

    fn image_width(&self) -> usize {
        match &self.attributes.view {
            ViewDescription::Unfolded(layout) => layout.width as usize,
            ViewDescription::Perspective(_) => 0,
        }
    }

    /// Returns the number of the random stream of a sample of a pixel; 0 if it is not used.
    pub(super) fn stream(&self, pixel: usize, sample: usize) -> u64 {
        self.shadow_rays.as_ref().map_or(0, |rays| rays.stream(pixel, sample))
    }

    /// Returns the content of a point of a tile.
    fn centre(&self, tile: &Tile, point: DVec3) -> Centre {
        let first = self.first_face(tile);
        let normal = tile.normal();
        let around = self.around(tile, point).map(|place| {
            let holds = |record: &PolygonRecord| contains(&record.corners, place, normal);
            self.records(tile).iter().position(holds)
        });
        let [Some(a), Some(b), Some(c), Some(d)] = around else {
            let is_beside = around.iter().all(Option::is_none);
            return if is_beside { Centre::Nothing } else { Centre::Unsure };
        };
        // Faces of a surface that counts as flat may differ slightly in their normals.
        let looks = |k: usize| self.plates[first + k].normal;
        if [b, c, d].iter().any(|&k| (looks(k) - looks(a)).length() > 1e-9) {
            return Centre::Unsure;
        }
        Centre::Face {
            face: u32::try_from(first + a).unwrap_or(u32::MAX),
            alone: [b, c, d] == [a; 3],
            point,
            slack: self.slack,
        }
    }

    /// Returns the exchange area of a tile's rectangle and an emitter, in m²; `None` if it could not be computed to 1e-10.
    ///
    /// `shaded` is true if anything hides a part of an emitter from the rectangle.
    pub(super) fn exchange_area(&self, tile: &Tile, shaded: bool, emitter: &Plate) -> Option<f64> {
        let rectangle = &tile.rectangle();
        let between = if shaded {
            self.between(rectangle, tile.normal(), emitter, self.slack + self.touching)
        } else {
            Vec::new()
        };
        if between.is_empty()
            && let Some(known) = rectangle_exchange_area(rectangle, &emitter.corners)
        {
            return Some(known);
        }
        let accuracy = Accuracy {
            tolerance: 1e-10,
            budget: 10_000_000,
        };
        let found = exchange_area(rectangle, &emitter.corners, &as_occluders(&between), accuracy);
        found.reached.then_some(found.exchange_area)
    }

    /// Returns the faces that reach between a region and an emitter by more than `slack`, m.
    fn between(&self, region: &[DVec3], normal: DVec3, emitter: &Plate, slack: f64) -> Vec<&Plate> {
        let misses = |plate: &Plate| misses_region(plate, region, normal, emitter, slack);
        self.plates.iter().filter(|plate| !misses(plate)).collect()
    }

    /// Adds the light at one point of a region's front.
    pub(super) fn add_light(
        &self,
        light: &mut Light,
        (share, stream): (f64, u64),
        point: DVec3,
        region: &Region<'_>,
        seen: &mut SeenFrom,
    ) {
        let face = region.face_of(point);
        let normal = face.normal;
        let over = point + normal * self.offset;
        let mut n_before = 0;
        for (k, ((emitter, exitance), between)) in self.emitters.iter().zip(&region.between).enumerate() {
            let form_factor = |at: DVec3| point_form_factor(at, normal, &emitter.corners);
            let (mut here, mut above) = (form_factor(point), form_factor(over));
            if between.is_sheet {
                let looks_away = normal.dot(emitter.normal) > 0.0;
                // Rays start above the surface: rounding decides on which side of the other face they are.
                light.unknown |= !looks_away && !self.is_exact();
                light.shaded |= !looks_away;
                if looks_away && !self.is_exact() {
                    light.add_rounding(share * here, exitance);
                    light.unknown |= here > UNTOLD;
                }
                n_before += u64::from(here > 0.0);
                continue;
            }
            if here <= 0.0 && above <= 0.0 {
                if self.touching > 0.0 {
                    light.add_rounding(share * region.bend(point, face, emitter), exitance);
                }
                continue;
            }
            let whole = here;
            let is_clear = |of: &[&Plate]| is_clear(point, normal, emitter, of.iter().copied(), self.slack);
            if !is_clear(&between.meant) {
                light.shaded = true;
                if between.meant.iter().any(|plate| self.touches(plate, point)) {
                    // Rounding decides on which side of the occluder the point is.
                    light.unknown = true;
                    return;
                }
                let visible = seen.meant(k, region, emitter);
                (here, above) = (visible.at(point), visible.at(over));
            }
            let is_literally_clear = is_clear(&between.literal);
            let mut room = 0.0;
            if self.touching > 0.0 {
                room = region.bend(point, face, emitter);
                if !is_literally_clear {
                    room += region.slits(point, here, seen.literal(k, region, emitter));
                }
            }
            if room > UNTOLD * whole.max(UNTOLD) {
                light.unknown = true;
                return;
            }
            let mut drawn = None;
            if !is_literally_clear && !self.knows_penumbras {
                let Some(rays) = &self.shadow_rays else {
                    light.unknown = true;
                    return;
                };
                let start = Start {
                    point,
                    normal,
                    face: &face.corners,
                    stream,
                    n_before,
                };
                let fraction = here / whole;
                let found = rays.fraction(k, &start, &between.literal, fraction);
                light.count_drawn(&found, rays.n() * fraction * (1.0 - fraction));
                drawn = Some(found);
            }
            n_before += 1;
            light.add_rounding(share * room, exitance);
            for (c, e) in exitance.iter().enumerate() {
                light.exact[c] += share * e * here;
                light.moved[c] += share * e * above;
                light.add_drawn(c, share * e * whole, drawn.as_ref());
            }
        }
    }

    /// Returns whether a point is near a plate within the rounding to f32.
    fn touches(&self, plate: &Plate, point: DVec3) -> bool {
        let near = 1e-6 * self.size.extent + self.slack;
        plate.normal.dot(point - plate.corners[0]).abs() <= near && plate.depth(point) >= -near
    }

    /// Returns four points around a point of a tile, further off than any rounding.
    fn around(&self, tile: &Tile, point: DVec3) -> [DVec3; 4] {
        // The margin is far above the rounding of rays to f32, and far below a pixel.
        let margin = (2e-6 * self.size.extent + self.slack).min(0.25 * tile.pixel_size[0].min(tile.pixel_size[1]));
        let (x, y) = (tile.right * margin, tile.down * margin);
        [point + x + y, point + x - y, point - x + y, point - x - y]
    }

    fn coverage(&self, tile: &Tile, points: &[DVec3]) -> Coverage {
        let mut n_inside = 0;
        for &point in points {
            for place in self.around(tile, point) {
                let inside = |record: &PolygonRecord| contains(&record.corners, place, tile.normal());
                n_inside += usize::from(self.records(tile).iter().any(inside));
            }
        }
        match n_inside {
            0 => Coverage::None,
            n if n == 4 * points.len() => Coverage::Full,
            _ => Coverage::Partial,
        }
    }
}

enum Coverage {
    None,
    Partial,
    Full,
}
