//! Moves objects of a scene.

use std::collections::HashMap;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::table::three_if_given;
use super::{Corners, MAX_COORDINATE, Scene, SurfaceId, overlap};
use crate::printable::{printable_message, quoted};

/// A rigid motion: a rotation about a point, then a translation.
///
/// x ↦ c + R (x − c) + t, in m; without a rotation x ↦ x + t, rounded once.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RigidMotion {
    /// R and c.
    rotation: Option<(DQuat, DVec3)>,
    translation: DVec3,
}

impl RigidMotion {
    fn point(&self, point: DVec3) -> DVec3 {
        let turned = self
            .rotation
            .map_or(point, |(rotation, about)| about + rotation * (point - about));
        turned + self.translation
    }

    fn direction(&self, direction: DVec3) -> DVec3 {
        self.rotation.map_or(direction, |(rotation, _)| rotation * direction)
    }
}

/// One motion of one or more surfaces, as files tell it.
///
/// ```toml
/// surface = ["seat", "back"]  # or a single name
/// rotate = 30.0               # degrees, counter-clockwise seen from where the axis points to
/// axis = [0.0, 0.0, 1.0]      # the default
/// about = [1.0, 2.0, 0.0]     # a point of the axis, in m; without it, the middle of the box around the surfaces
/// translate = [0.5, 0.0, 0.0] # in m, after the rotation
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// The surfaces that move as one.
    pub surface: Names,
    /// The angle of the rotation, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<f64>,
    /// The axis of the rotation; z if not given.
    #[serde(
        default,
        deserialize_with = "three_if_given",
        skip_serializing_if = "Option::is_none"
    )]
    pub axis: Option<[f64; 3]>,
    /// A point of the axis, in m.
    #[serde(
        default,
        deserialize_with = "three_if_given",
        skip_serializing_if = "Option::is_none"
    )]
    pub about: Option<[f64; 3]>,
    /// The translation, in m.
    #[serde(
        default,
        deserialize_with = "three_if_given",
        skip_serializing_if = "Option::is_none"
    )]
    pub translate: Option<[f64; 3]>,
}

impl Motion {
    /// Returns whether the motion moves a surface.
    pub(super) fn moves(&self, name: &str) -> bool {
        self.surface.as_slice().iter().any(|moving| moving == name)
    }
}

/// One name or more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "expected the name of a surface, or a list of names")]
pub enum Names {
    /// A single one.
    One(String),
    /// A list.
    Many(Vec<String>),
}

impl Names {
    fn as_slice(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Many(names) => names,
        }
    }
}

/// A reason why objects cannot be moved; each message contains the remedy.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MotionError {
    /// No surface has that name.
    #[error("the scene has no surface `{}`; it has {}", quoted(.name), printable_message(.known))]
    UnknownSurface {
        /// The name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// No surface is named.
    #[error("no surface is named; name one or more")]
    NoSurface,
    /// The motion names neither a rotation nor a translation.
    #[error("nothing is moved; give `rotate` or `translate`")]
    NoMotion,
    /// There is an axis, or a point of one, but no angle.
    #[error("`axis` and `about` belong to a rotation; give `rotate`, or leave them out")]
    NoAngle,
    /// A number is not finite, or an axis has no direction.
    #[error("`{name}` = {value} is no {wanted}; correct it")]
    BadNumber {
        /// Its name.
        name: &'static str,
        /// The given value.
        value: String,
        /// The expected value.
        wanted: &'static str,
    },
    /// A corner would leave the range of coordinates.
    #[error("`{}` is moved beyond {MAX_COORDINATE:e} m; move it less far", quoted(.surface))]
    TooFar {
        /// The surface.
        surface: String,
    },
    /// A face would lie on another in one plane, with the same winding.
    #[error("a face of `{}` comes to lie on one of `{}` in one plane, with the same orientation, so radiation would count twice; move it elsewhere",
        quoted(.surface), quoted(.other))]
    Coincident {
        /// The surface of the face, one that moves.
        surface: String,
        /// The surface of the other face.
        other: String,
    },
}

/// The positions of the surfaces of a scene, as motions that are applied in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    motions: Vec<(Vec<SurfaceId>, RigidMotion)>,
}

impl Pose {
    /// Adds a motion after the earlier ones.
    ///
    /// # Errors
    /// [`MotionError`] except for faults that only the whole pose can show; [`Scene::posed`] reports these.
    pub fn push(&mut self, scene: &Scene, motion: &Motion) -> Result<(), MotionError> {
        let surfaces = motion
            .surface
            .as_slice()
            .iter()
            .map(|name| surface_named(scene, name))
            .collect::<Result<Vec<_>, _>>()?;
        if surfaces.is_empty() {
            return Err(MotionError::NoSurface);
        }
        if motion.rotate.is_none() && motion.translate.is_none() {
            return Err(MotionError::NoMotion);
        }
        let vector = |name, value: Option<[f64; 3]>, default: DVec3| {
            let vector = value.map_or(default, DVec3::from_array);
            let found = vector.is_finite().then_some(vector);
            found.ok_or_else(|| bad_number(name, format!("{:?}", vector.to_array()), "triple of finite numbers"))
        };
        let translation = vector("translate", motion.translate, DVec3::ZERO)?;
        let rotation = match motion.rotate {
            None if motion.axis.is_some() || motion.about.is_some() => return Err(MotionError::NoAngle),
            None => None,
            Some(degrees) => {
                if !degrees.is_finite() {
                    return Err(bad_number("rotate", degrees.to_string(), "finite angle"));
                }
                let axis = vector("axis", motion.axis, DVec3::Z)?;
                let unit = axis
                    .try_normalize()
                    .ok_or_else(|| bad_number("axis", format!("{:?}", axis.to_array()), "direction"))?;
                let about = vector("about", motion.about, self.middle(scene, &surfaces))?;
                Some((DQuat::from_axis_angle(unit, degrees.to_radians()), about))
            }
        };
        self.motions.push((surfaces, RigidMotion { rotation, translation }));
        Ok(())
    }

    /// Returns where a point of a surface goes, in m.
    #[must_use]
    pub fn point(&self, surface: SurfaceId, point: DVec3) -> DVec3 {
        self.of(surface).fold(point, |point, motion| motion.point(point))
    }

    /// Returns where a direction that is fixed to a surface goes.
    #[must_use]
    pub fn direction(&self, surface: SurfaceId, direction: DVec3) -> DVec3 {
        self.of(surface)
            .fold(direction, |direction, motion| motion.direction(direction))
    }

    /// Returns whether a surface is named in any motion.
    #[must_use]
    pub fn moves(&self, surface: SurfaceId) -> bool {
        self.of(surface).next().is_some()
    }

    fn of(&self, surface: SurfaceId) -> impl Iterator<Item = &RigidMotion> {
        let own = self.motions.iter().filter(move |(names, _)| names.contains(&surface));
        own.map(|(_, motion)| motion)
    }

    /// Returns the middle of the box around surfaces in their current positions.
    fn middle(&self, scene: &Scene, surfaces: &[SurfaceId]) -> DVec3 {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let faces = scene.faces.iter().filter(|face| surfaces.contains(&face.surface));
        let corners = faces.flat_map(|face| {
            let corners = face.corners.as_slice().iter();
            corners.map(|&v| self.point(face.surface, scene.vertices[v as usize]))
        });
        let (low, high) = corners.fold(none, |(low, high), v| (low.min(v), high.max(v)));
        low.midpoint(high)
    }
}

impl Scene {
    /// Returns the scene with its surfaces in a pose: the same faces in the same order, with new vertices where they moved.
    ///
    /// Objects may interpenetrate, and leave or meet other objects, except for faces of one winding in one plane; positions equal to the last bit share a vertex.
    /// Faces that do not move keep their corners to the last bit.
    ///
    /// # Errors
    /// [`MotionError::TooFar`]; [`MotionError::Coincident`] where faces of one winding share a part of their plane that they did not share before, as for a file.
    pub fn posed(&self, pose: &Pose) -> Result<Self, MotionError> {
        let posed = self.placed(pose)?;
        posed.expect_no_overlap(pose)?;
        Ok(posed)
    }

    /// Returns the scene in a pose before further motions: faces may lie on one another.
    pub(super) fn placed(&self, pose: &Pose) -> Result<Self, MotionError> {
        let name = |surface: SurfaceId| self.surfaces[surface.0 as usize].name.clone();
        let mut posed = Self {
            vertices: Vec::with_capacity(self.vertices.len()),
            ..self.clone()
        };
        let mut vertex_of_position: HashMap<[u64; 3], u32> = HashMap::new();
        for face in &mut posed.faces {
            let surface = face.surface;
            let mut place = |&old: &u32| {
                // Adding zero turns -0.0 into 0.0: the same place is the same vertex.
                let position = pose.point(surface, self.vertices[old as usize]) + 0.0;
                if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
                    return Err(MotionError::TooFar { surface: name(surface) });
                }
                let next = posed.vertices.len();
                let key = position.to_array().map(f64::to_bits);
                Ok(*vertex_of_position.entry(key).or_insert_with(|| {
                    posed.vertices.push(position);
                    // Each face adds at most four, and there are fewer than 2³¹ faces; memory ends earlier.
                    u32::try_from(next).unwrap_or(u32::MAX)
                }))
            };
            let mut places = |corners: &mut [u32]| -> Result<(), MotionError> {
                for corner in corners {
                    *corner = place(corner)?;
                }
                Ok(())
            };
            match &mut face.corners {
                Corners::Triangle(corners) => places(corners)?,
                Corners::Quad(corners) => places(corners)?,
            }
        }
        Ok(posed)
    }

    /// Refuses a posed scene in which faces lie on one another.
    pub(super) fn expect_no_overlap(&self, pose: &Pose) -> Result<(), MotionError> {
        if pose.motions.is_empty() {
            return Ok(());
        }
        let Some(faces) = overlap::find(self) else {
            return Ok(());
        };
        let mut surfaces = faces.map(|face| self.faces[face.0 as usize].surface);
        if !pose.moves(surfaces[0]) {
            surfaces.reverse();
        }
        let [surface, other] = surfaces.map(|id| self.surfaces[id.0 as usize].name.clone());
        Err(MotionError::Coincident { surface, other })
    }
}

fn surface_named(scene: &Scene, name: &str) -> Result<SurfaceId, MotionError> {
    let found = (0_u32..).zip(&scene.surfaces).find(|(_, surface)| surface.name == name);
    found.map(|(k, _)| SurfaceId(k)).ok_or_else(|| {
        let known: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).take(12).collect();
        let more = scene.surfaces.len().saturating_sub(known.len());
        let more = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        MotionError::UnknownSurface {
            name: name.to_owned(),
            known: known.join(", ") + &more,
        }
    })
}

fn bad_number(name: &'static str, value: String, wanted: &'static str) -> MotionError {
    MotionError::BadNumber { name, value, wanted }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::builtin;

    fn motion(surface: &str) -> Motion {
        Motion {
            surface: Names::One(surface.to_owned()),
            rotate: None,
            axis: None,
            about: None,
            translate: None,
        }
    }

    #[test]
    fn a_wall_moves_alone_and_leaves_its_neighbours_whole() {
        let scene = builtin::build("cube", None).unwrap().scene;
        let mut pose = Pose::default();
        let shift = Motion {
            translate: Some([0.0, 0.0, 0.5]),
            ..motion("z1")
        };
        pose.push(&scene, &shift).unwrap();
        let posed = scene.posed(&pose).unwrap();
        assert_eq!((scene.vertices.len(), posed.vertices.len()), (8, 12));
        for id in scene.face_ids() {
            let surface = scene.faces[id.0 as usize].surface;
            let moved = scene.surfaces[surface.0 as usize].name == "z1";
            let by = if moved { DVec3::Z * 0.5 } else { DVec3::ZERO };
            let expected: Vec<DVec3> = scene.polygon(id).into_iter().map(|v| v + by).collect();
            assert_eq!(posed.polygon(id), expected);
            assert_eq!(pose.moves(surface), moved);
        }
        // After the way back, the corners meet.
        let back = Motion {
            translate: Some([0.0, 0.0, -0.5]),
            ..motion("z1")
        };
        pose.push(&scene, &back).unwrap();
        assert_eq!(scene.posed(&pose).unwrap().vertices.len(), 8);
    }

    #[test]
    fn turns_are_about_the_axis_given_or_the_middle() {
        let scene = builtin::build("cube", None).unwrap().scene;
        let quarter = Motion {
            rotate: Some(90.0),
            about: Some([2.0, 0.0, 0.0]),
            ..motion("x0")
        };
        let mut pose = Pose::default();
        pose.push(&scene, &quarter).unwrap();
        let x0 = surface_named(&scene, "x0").unwrap();
        let turned = pose.point(x0, DVec3::new(3.0, 0.0, 1.0));
        assert!(turned.distance(DVec3::new(2.0, 1.0, 1.0)) < 1e-15, "{turned}");
        assert!(pose.direction(x0, DVec3::X).distance(DVec3::Y) < 1e-15);
        // A square wall turned about its middle and its own normal is at its old place, to rounding.
        let half = Motion {
            rotate: Some(180.0),
            axis: Some([1.0, 0.0, 0.0]),
            ..motion("x0")
        };
        let mut same = Pose::default();
        same.push(&scene, &half).unwrap();
        let posed = scene.posed(&same).unwrap();
        let face = scene
            .face_ids()
            .find(|f| scene.faces[f.0 as usize].surface == x0)
            .unwrap();
        for (was, is) in scene
            .polygon(face)
            .iter()
            .zip(posed.polygon(face).iter().cycle().skip(2))
        {
            assert!(was.distance(*is) < 1e-15);
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_a_remedy() {
        let scene = builtin::build("cube", None).unwrap().scene;
        let with = |change: fn(&mut Motion)| {
            let mut motion = motion("z0");
            change(&mut motion);
            Pose::default().push(&scene, &motion).unwrap_err().to_string()
        };
        assert_eq!(
            with(|m| m.surface = Names::One("door".into())),
            "the scene has no surface `door`; it has x0, x1, y0, y1, z0, z1"
        );
        // The message is one line, whatever a string of TOML contains.
        assert!(
            with(|m| m.surface = Names::One("x0\n\0".into()))
                .starts_with("the scene has no surface `x0\u{fffd}\u{fffd}`; it has x0,")
        );
        assert!(with(|m| m.surface = Names::Many(Vec::new())).contains("name one"));
        assert!(with(|_| ()).contains("give `rotate` or `translate`"));
        assert!(with(|m| (m.about, m.translate) = (Some([0.0; 3]), Some([1.0; 3]))).contains("give `rotate`"));
        assert!(with(|m| (m.rotate, m.axis) = (Some(1.0), Some([0.0; 3]))).contains("no direction"));
        assert!(with(|m| m.rotate = Some(f64::NAN)).contains("`rotate` = NaN"));
        assert!(with(|m| m.translate = Some([f64::INFINITY, 0.0, 0.0])).contains("`translate`"));
        let mut far = Pose::default();
        let beyond = Motion {
            translate: Some([1e16, 0.0, 0.0]),
            ..motion("z0")
        };
        far.push(&scene, &beyond).unwrap();
        assert_eq!(
            scene.posed(&far).unwrap_err(),
            MotionError::TooFar { surface: "z0".into() }
        );
        // A second floor half a metre below, lifted to the first.
        let mut two_floors = scene.clone();
        let floor = surface_named(&scene, "z0").unwrap();
        let mut below = *scene.faces.iter().find(|face| face.surface == floor).unwrap();
        let n = u32::try_from(scene.vertices.len()).unwrap();
        let lowered = below
            .corners
            .as_slice()
            .iter()
            .map(|&v| scene.vertices[v as usize] - DVec3::Z * 0.5);
        two_floors.vertices.extend(lowered);
        below.corners = Corners::Quad([n, n + 1, n + 2, n + 3]);
        below.surface = SurfaceId(u32::try_from(scene.surfaces.len()).unwrap());
        two_floors.faces.push(below);
        two_floors.surfaces.push(crate::scene::Surface { name: "below".into() });
        let lifted = |by: f64| {
            let mut pose = Pose::default();
            let up = Motion {
                translate: Some([0.0, 0.0, by]),
                ..motion("below")
            };
            pose.push(&two_floors, &up).unwrap();
            two_floors.posed(&pose)
        };
        assert!(lifted(0.25).is_ok());
        let (surface, other) = ("below".into(), "z0".into());
        assert_eq!(lifted(0.5).unwrap_err(), MotionError::Coincident { surface, other });
    }

    #[test]
    fn faces_that_come_to_share_a_part_of_their_plane_are_refused_as_in_a_file() {
        let mut scene = builtin::build("cube", None).unwrap().scene;
        // A second cube of the same height beside the first.
        let n = u32::try_from(scene.vertices.len()).unwrap();
        let beside: Vec<DVec3> = scene.vertices.iter().map(|v| v + DVec3::X * 2.0).collect();
        scene.vertices.extend(beside);
        let names: Vec<String> = scene.surfaces.iter().map(|s| format!("second {}", s.name)).collect();
        for mut face in scene.faces.clone() {
            face.corners = match face.corners {
                Corners::Triangle(v) => Corners::Triangle(v.map(|v| v + n)),
                Corners::Quad(v) => Corners::Quad(v.map(|v| v + n)),
            };
            face.surface = SurfaceId(face.surface.0 + u32::try_from(names.len()).unwrap());
            scene.faces.push(face);
        }
        scene
            .surfaces
            .extend(names.iter().map(|name| crate::scene::Surface { name: name.clone() }));
        let pushed = |which: Vec<String>, by: [f64; 3]| {
            let mut pose = Pose::default();
            let shift = Motion {
                surface: Names::Many(which),
                translate: Some(by),
                ..motion("")
            };
            pose.push(&scene, &shift).unwrap();
            scene.posed(&pose)
        };
        let first: Vec<String> = scene.surfaces[..6].iter().map(|s| s.name.clone()).collect();
        // Interpenetrating objects without a common plane, and adjacent ones, are allowed.
        assert!(pushed(names.clone(), [-1.5, 0.1, 0.1]).is_ok());
        assert!(pushed(names.clone(), [-1.0, 0.0, 0.0]).is_ok());
        for (which, by) in [(names, -1.5), (first, 1.5)] {
            let moved = which[0].starts_with("second");
            match pushed(which, [by, 0.0, 0.0]).unwrap_err() {
                MotionError::Coincident { surface, other } => {
                    assert_eq!(surface.starts_with("second"), moved, "{surface} is the one that moves");
                    assert_ne!(other.starts_with("second"), moved, "{other} is the one that stays");
                }
                error => panic!("{error}"),
            }
        }
    }
}
