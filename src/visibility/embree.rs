//! Visibility through Embree.

use std::borrow::Cow;

use glam::DVec3;

use crate::embree::{CommittedScene, Device, EmbreeError, SceneBuilder};
use crate::scene::{Corners, FaceId, Scene};

use super::flat_polygon::FlatPolygon;
use super::frame::Frame;
use super::sheets::Sheets;
use super::{Coherence, HitBatch, RayBatch, Visibility, to_f32};

/// The extents for which products of three coordinates, and of far smaller edges, stay within the range of f32.
const EXTENTS: std::ops::RangeInclusive<f64> = 1e-8..=1e11;

/// The extents of scenes that are scaled to 1 for the tracer: those of the rays, which stay within the range of f32.
const SCALED_EXTENTS: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// Traces the rays of a scene with Embree, in f32.
///
/// The scene is centred in its box before its vertices are rounded to f32, each once, so that faces that share a vertex
/// share it bit for bit, and rays that aim at an edge between two faces hit one of them. A vertex thus moves by at most
/// √3 · 2⁻²⁴ L, with L the largest centred coordinate; this is the accuracy of all answers, along with a few 2⁻²⁴ of the
/// distance for t.
///
/// The [`offset`](Visibility::offset) is 3e-6 L: large enough that a patch does not shadow itself. For segments between patches, a
/// thinner wall is like a sheet.
///
/// Two faces of opposite winding that coincide, even in part, are a two-sided sheet: the one that faces the ray's origin is reported,
/// whichever of them Embree finds. Their distance may be up to 2⁻²² L, which f32 cannot resolve. Scenes without sheets have no cost for this.
///
/// A scene whose L is outside 1e-8 m to 1e11 m is traced at a scale, by a power of two, at which it is within: products of coordinates stay in the range of f32.
///
/// Rays with coordinates that are not finite hit nothing. Which of two faces wins on their common edge may depend on the
/// ray's neighbours in the batch; equal batches give equal answers, on any number of threads.
#[derive(Debug)]
pub struct EmbreeVisibility {
    scene: CommittedScene,
    frame: Frame,
    sheets: Option<Sheets>,
    vanished: Vec<FaceId>,
    /// The factor of coordinates for Embree; `None` where they stay as they are.
    scale: Option<f32>,
}

/// Returns L, the largest absolute coordinate of a used vertex after the scene's box is centred, in m; 0 for a scene without faces.
#[must_use]
pub fn largest_coordinate(scene: &Scene) -> f64 {
    Frame::of(scene).largest
}

impl EmbreeVisibility {
    /// Opens Embree and builds its scene.
    ///
    /// # Errors
    ///
    /// [`EmbreeError::ExtentOutOfRange`] where L is outside 1e-30 m to 1e30 m, and all errors of [`Device::new`] and [`SceneBuilder`].
    pub fn new(scene: &Scene) -> Result<Self, EmbreeError> {
        Self::on_device(&Device::new()?, scene)
    }

    /// Builds the scene on an open device.
    ///
    /// # Errors
    ///
    /// As [`EmbreeVisibility::new`].
    pub fn on_device(device: &Device, scene: &Scene) -> Result<Self, EmbreeError> {
        let frame = Frame::of(scene);
        let is_within = scene.faces.is_empty() || EXTENTS.contains(&frame.largest);
        if !is_within && !SCALED_EXTENTS.contains(&frame.largest) {
            return Err(EmbreeError::ExtentOutOfRange { largest: frame.largest });
        }
        let scale = (!is_within).then(|| to_f32((-frame.largest.log2().round()).exp2()));
        let vertices: Vec<[f32; 3]> = scene
            .vertices
            .iter()
            .map(|&v| {
                ((v - frame.origin) * f64::from(scale.unwrap_or(1.0)))
                    .as_vec3()
                    .to_array()
            })
            .collect();
        let vanished = scene
            .face_ids()
            .filter(|&face| vanishes(scene, face, &vertices))
            .collect();
        let mut builder = SceneBuilder::new(vertices)?;
        for face in scene.face_ids() {
            match scene.faces[face.0 as usize].corners {
                Corners::Triangle(corners) => builder.triangle(corners, face.0)?,
                Corners::Quad(corners) => builder.quad(corners, face.0)?,
            }
        }
        Ok(Self {
            scene: builder.commit(device)?,
            frame,
            sheets: Sheets::find(&frame, frame.polygons(scene)),
            vanished,
            scale,
        })
    }

    /// Returns the rays as Embree traces them. Distances in units of a ray's direction stay the same.
    fn scaled<'r>(&self, rays: &'r RayBatch) -> Cow<'r, RayBatch> {
        let Some(scale) = self.scale else {
            return Cow::Borrowed(rays);
        };
        let scaled = |axes: &[Vec<f32>; 3]| axes.each_ref().map(|axis| axis.iter().map(|x| x * scale).collect());
        Cow::Owned(RayBatch {
            origin: scaled(&rays.origin),
            direction: scaled(&rays.direction),
            t_far: rays.t_far.clone(),
        })
    }

    /// Returns the faces that are too small for f32: their corners are rounded to a point or a line, and no ray hits them.
    ///
    /// Their neighbours still meet without a gap. The edges of such a face are shorter than 1.2e-7 L, so that none of an ordinary scene vanishes.
    #[must_use]
    pub fn vanished_faces(&self) -> &[FaceId] {
        &self.vanished
    }
}

fn vanishes(scene: &Scene, face: FaceId, rounded: &[[f32; 3]]) -> bool {
    let corners = scene.faces[face.0 as usize].corners;
    let position = |&v: &u32| DVec3::from(rounded[v as usize].map(f64::from));
    let polygon = FlatPolygon::new(corners.as_slice().iter().map(position).collect());
    polygon.normal.length_squared() < 0.5 // 0 or 1
}

impl Visibility for EmbreeVisibility {
    fn frame_origin(&self) -> DVec3 {
        self.frame.origin
    }

    fn offset(&self) -> f64 {
        self.frame.offset()
    }

    fn closest_hits(&self, rays: &RayBatch, coherence: Coherence, hits: &mut HitBatch) {
        self.scene.closest_hits(&self.scaled(rays), coherence, hits);
        let Some(sheets) = &self.sheets else { return };
        for k in 0..hits.face_and_side.len() {
            let Some(hit) = hits.face(k).filter(|hit| hit.back) else {
                continue;
            };
            if let Some((face, u, v)) = sheets.front(hit.face.0, hits.u[k], hits.v[k]) {
                hits.face_and_side[k] = 2 * face;
                hits.u[k] = to_f32(u);
                hits.v[k] = to_f32(v);
            }
        }
    }

    fn occluded(&self, rays: &RayBatch, coherence: Coherence, blocked: &mut Vec<bool>) {
        self.scene.occluded(&self.scaled(rays), coherence, blocked);
    }
}
