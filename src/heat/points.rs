//! Free points: view factors, irradiance, mean radiant temperature.

use std::f64::consts::PI;

use glam::DVec3;

use super::band::Band;
use super::boundary::{Boundary, Sun};
use super::emissive_power;
use super::inside::Solids;
use super::thermal::Stated;
use crate::form_factor::partial::{Place, PointViews, Scratch};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon::solid_angle;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::threads;

/// The fraction of the view outside of backs up to which it counts as rounding: a point that sees only backs is inside a solid.
const ALL: f64 = 1e-9;

/// The solar absorptance and the emissivity of a person.
const PERSON: [f64; 2] = [0.7, 0.97];

/// A point from which to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointQuery {
    /// Its position, m.
    pub position: DVec3,
    /// Its direction, of any length; `None` for a point that looks all around.
    pub normal: Option<DVec3>,
}

/// The position of a point relative to faces and solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointStatus {
    /// Outside of solids and off all faces.
    Free,
    /// On a face: its factors apply to neither side of it.
    OnFace,
    /// Inside a solid, whose faces it sees from behind, or where it sees only backs.
    InsideSolid,
}

impl PointStatus {
    /// Returns its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::OnFace => "on_face",
            Self::InsideSolid => "inside_solid",
        }
    }
}

/// The view from a point, whose factors sum to 1, and its irradiance.
#[derive(Clone, Debug, PartialEq)]
pub struct PointView {
    /// The position relative to faces and solids.
    pub status: PointStatus,
    /// The factor to the front of each surface: the form factor of a point with a normal, else the fraction of the sphere.
    pub surfaces: Vec<Stated>,
    /// The factor to the surroundings.
    pub surroundings: Stated,
    /// The factor to backs.
    pub backs: Stated,
    /// The irradiance, if boundary conditions are given.
    pub heat: Option<PointHeat>,
}

/// The irradiance at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointHeat {
    /// The thermal irradiance, W·m⁻²; without a normal the mean radiosity around, Σ F B.
    pub irradiance: Stated,
    /// The solar irradiance without direct sunlight, W·m⁻²; without a normal Σ F B.
    pub solar: Stated,
    /// The irradiance straight from the sun, W·m⁻², on the plane of the point, or without a normal on one that faces the sun.
    pub sun: Stated,
    /// 1 where the sun shines, 0 in shadow; `None` without a sun.
    pub sunlit: Option<Stated>,
    /// The mean radiant temperature, K: (Σ F B / σ)^¼; `None` for a point with a normal.
    pub mean_radiant: Option<Stated>,
}

/// The scene seen from points.
pub(crate) struct PointScene<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) mesh: &'a Mesh,
    /// The thermal and the solar band, and their boundary conditions.
    pub(crate) heat: Option<([&'a Band; 2], &'a Boundary)>,
    /// True if the mean radiant temperature includes the sun as a standing person absorbs it.
    pub(crate) with_person: bool,
}

/// Sums over the visible patches: radiosities times factors and the errors of the radiosities, for both bands, and the factor to the part above the horizon.
#[derive(Clone, Copy, Default)]
struct Sums {
    light: [f64; 2],
    light_error: [f64; 2],
    above: f64,
}

impl PointScene<'_> {
    /// Prepares the views from points.
    pub(crate) fn views(&self) -> (PointViews, Solids) {
        (PointViews::new(self.scene, self.mesh), Solids::of(self.scene))
    }

    /// Returns the views from all points.
    pub(crate) fn look(&self, views: &(PointViews, Solids), queries: &[PointQuery]) -> Vec<PointView> {
        threads::collect_with(queries.len(), Scratch::default, |scratch, k| {
            self.look_from(views, &queries[k], scratch)
        })
    }

    fn look_from(
        &self,
        (views, solids): &(PointViews, Solids),
        query: &PointQuery,
        scratch: &mut Scratch,
    ) -> PointView {
        let normal = query.normal.map(DVec3::normalize_or_zero);
        let mut surfaces = vec![Stated::default(); self.scene.surfaces.len()];
        let mut backs = Stated::default();
        let mut sums = Sums::default();
        // An upper bound of the lengths of borders seen from the point, in radians, to which the effect of shifted corners is proportional.
        let mut borders = vec![0.0; surfaces.len() + 1];
        let up = self.sky_up();
        let mut closest = f64::INFINITY;
        let mut behind = Vec::new();
        let nearest = views.visit((query.position, normal), scratch, |part| {
            let factor = measure(part.corners, normal);
            let surface = self.mesh.patches[part.patch].surface.0 as usize;
            if part.is_back {
                behind.push(solids.piece_of(self.mesh.patches[part.patch].face));
            }
            let (sum, border) = if part.is_back {
                (&mut backs, borders.len() - 1)
            } else {
                (&mut surfaces[surface], surface)
            };
            sum.value += factor;
            borders[border] += part.border;
            closest = closest.min(part.distance);
            if let Some(up) = up {
                sums.above += measure(&clip_to_half_space(part.corners, DVec3::ZERO, up), normal);
            }
            if let (Some((bands, _)), false) = (self.heat, part.is_back) {
                for (k, band) in bands.into_iter().enumerate() {
                    sums.light[k] += factor * band.radiosity[part.patch];
                    sums.light_error[k] += factor * band.radiosity_error[part.patch];
                }
            }
        });
        // The greatest apparent shift of a border, in radians.
        let off = views.tolerance() / closest.min(nearest).max(f64::MIN_POSITIVE);
        let stated = |value: f64, border: f64| Stated {
            value: value.clamp(0.0, 1.0),
            error: (border * off + 1e-14).min(1.0),
        };
        for (own, border) in surfaces.iter_mut().zip(&borders) {
            *own = if own.value > 0.0 {
                stated(own.value, *border)
            } else {
                *own
            };
        }
        let back_border = borders[surfaces.len()];
        backs = if backs.value > 0.0 {
            stated(backs.value, back_border)
        } else {
            backs
        };
        let sum: f64 = surfaces.iter().chain([&backs]).map(|own| own.value).sum();
        let error: f64 = surfaces.iter().chain([&backs]).map(|own| own.error).sum();
        let surroundings = Stated {
            value: (1.0 - sum).clamp(0.0, 1.0),
            error,
        };
        let status = match views.place(query.position) {
            Place::OnFace => PointStatus::OnFace,
            Place::Free if backs.value >= 1.0 - ALL => PointStatus::InsideSolid,
            Place::Free if solids.contain(&mut behind, query.position) => PointStatus::InsideSolid,
            Place::Free => PointStatus::Free,
        };
        let heat = self.heat.map(|(_, boundary)| {
            let seen = Seen {
                sums,
                surroundings,
                normal,
                error,
            };
            self.arriving(views, query.position, boundary, &seen)
        });
        PointView {
            status,
            surfaces,
            surroundings,
            backs,
            heat,
        }
    }

    fn sky_up(&self) -> Option<DVec3> {
        self.heat.and_then(|(_, boundary)| boundary.sky).map(|sky| sky.up())
    }

    /// Returns the irradiance at a point.
    fn arriving(&self, views: &PointViews, point: DVec3, boundary: &Boundary, seen: &Seen) -> PointHeat {
        let Seen {
            sums,
            surroundings,
            normal,
            error,
        } = *seen;
        let brightest = |k: usize| {
            let radiosities = self.heat.map(|(bands, _)| &bands[k].radiosity);
            radiosities.into_iter().flatten().copied().fold(0.0, f64::max)
        };
        let around = emissive_power(boundary.surroundings_k);
        let irradiance = Stated {
            value: sums.light[0] + surroundings.value * around,
            error: sums.light_error[0] + error * brightest(0).max(around),
        };
        // The radiosity of the sky is its irradiance on a plane that faces up.
        let sky = boundary.sky.map_or(Stated::default(), |sky| {
            let half = normal.map_or(0.5, |normal| 0.5 * (1.0 + normal.dot(sky.up())));
            Stated {
                value: sky.irradiance() * (half - sums.above).clamp(0.0, 1.0),
                error: sky.irradiance() * error,
            }
        });
        let solar = Stated {
            value: sums.light[1] + sky.value,
            error: sums.light_error[1] + error * brightest(1) + sky.error,
        };
        let shone = boundary.sun.map(|sun| shone_on(views, point, normal, &sun));
        let sunlit = shone.map(|[lit, _]| lit);
        let sun = shone.map_or(Stated::default(), |[_, shining]| shining);
        let mean_radiant = normal.is_none().then(|| {
            let person = if self.with_person {
                on_person(boundary, solar, sun)
            } else {
                Stated::default()
            };
            let power = Stated {
                value: irradiance.value + person.value,
                error: irradiance.error + person.error,
            };
            power.temperature()
        });
        PointHeat {
            irradiance,
            solar,
            sun,
            sunlit,
            mean_radiant,
        }
    }
}

/// Returns the visible part of the sun, and its irradiance on the plane of the point, or on one that faces the sun, W·m⁻².
fn shone_on(views: &PointViews, point: DVec3, normal: Option<DVec3>, sun: &Sun) -> [Stated; 2] {
    let (mut lit, mut irradiance) = (Stated::default(), Stated::default());
    let directions = sun.directions();
    for &(direction, weight, along) in &directions {
        let (is_lit, is_certain) = views.is_lit(point, direction);
        let cosine = normal.map_or(along, |normal| normal.dot(direction).max(0.0)) / along;
        let (value, error) = (f64::from(u8::from(is_lit)), f64::from(u8::from(!is_certain)));
        lit.value += weight * value;
        lit.error += weight * error;
        irradiance.value += weight * value * cosine * sun.irradiance();
        irradiance.error += weight * error * cosine * sun.irradiance();
    }
    // The border of an occluder is unresolved between the directions of a disc.
    let missed = (lit.value * (1.0 - lit.value)).max(0.0).sqrt() / (directions.len() as f64).powf(0.75);
    lit.error += missed;
    irradiance.error += missed * sun.irradiance();
    [lit, irradiance]
}

/// Sums over the view from a point.
#[derive(Clone, Copy)]
struct Seen {
    sums: Sums,
    surroundings: Stated,
    normal: Option<DVec3>,
    error: f64,
}

/// Returns the solar part of σ T⁴ of a standing person, W·m⁻²: (0.7 / 0.97) (f_p I + Σ F B).
///
/// The projected area factor is f_p = 0.308 cos(h (0.998 − h² / 50000)), with h the sun's height in degrees.
fn on_person(boundary: &Boundary, solar: Stated, sun: Stated) -> Stated {
    let up = boundary.sky.map_or(DVec3::Z, |sky| sky.up());
    let height = boundary
        .sun
        .map_or(0.0, |own| own.direction().dot(up).clamp(-1.0, 1.0).asin().to_degrees());
    let projected = 0.308 * (height * (0.998 - height * height / 50_000.0)).to_radians().cos();
    let share = PERSON[0] / PERSON[1];
    Stated {
        value: share * (projected * sun.value + solar.value),
        error: share * (projected * sun.error + solar.error),
    }
}

/// Returns the factor from the origin to a convex polygon that faces it: with a normal the form factor, else the fraction of the sphere.
fn measure(corners: &[DVec3], normal: Option<DVec3>) -> f64 {
    if corners.len() < 3 {
        return 0.0;
    }
    match normal {
        Some(normal) => point_form_factor(DVec3::ZERO, normal, corners),
        None => solid_angle(corners).abs() / (4.0 * PI),
    }
}
