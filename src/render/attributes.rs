//! The description of an image file: settings, view and scene.

use glam::DVec3;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use sha2::{Digest as _, Sha256};

use super::exr::Pixels;
use super::field::FieldRecord;
use super::samples::PixelSamples;
use super::settings::RenderSettings;
use super::view::ViewDescription;
use crate::scene::Scene;
use crate::scene::hash::hexadecimal;

/// The newest layout of the attributes; it changes when an older reader would misread them.
pub(super) const FORMAT: u32 = 2;

/// The layout without adaptive samples, which older readers can read as well.
const GRID_FORMAT: u32 = 1;

/// A face of the scene as the image file describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolygonRecord {
    /// Corners in m, counter-clockwise seen from the front.
    pub corners: Vec<DVec3>,
    /// E in W·m⁻² per channel.
    pub exitance: [f64; 3],
    /// ρ per channel.
    pub reflectance: [f64; 3],
}

impl PolygonRecord {
    pub(super) fn emits(&self) -> bool {
        self.exitance.iter().any(|&e| e > 0.0)
    }
}

/// A surface of the scene as the image file describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceRecord {
    /// The surface's name.
    pub name: String,
    /// Its faces in file order.
    pub polygons: Vec<PolygonRecord>,
}

/// The text attributes of an image file: no time, path, thread count or command line is among them.
///
/// As attributes of the EXR file, all of them text (JSON in ASCII where they are not plain): `radiosity_format`, `radiosity_version`, `seed`,
/// `settings` {`render`, `ray_offset_m`, `pixels`, `solution`}, `camera`, `surfaces`, `scene_sha256`; `field` {`surface`}
/// in a field of form factors.
#[derive(Clone, Debug, PartialEq)]
pub struct Attributes {
    /// The version of the crate that rendered the image.
    pub version: String,
    /// The renderer's settings, the seed among them.
    pub render: RenderSettings,
    /// The distance, in m, by which ray origins were moved off the surfaces.
    pub ray_offset: f64,
    /// The settings that led to the solution, as the caller gives them.
    pub solution: serde_json::Value,
    /// The camera, or the tiles of the unfolded view.
    pub view: ViewDescription,
    /// The scene: one record per surface, in file order.
    pub surfaces: Vec<SurfaceRecord>,
    /// The storage of the layers' numbers.
    pub pixels: Pixels,
    /// The surface whose form factors the image shows, where the image is a [`field`](super::field()).
    pub field: Option<FieldRecord>,
    /// True if `scene_sha256` is that of `surfaces`; false in a file whose description was changed afterwards.
    pub scene_intact: bool,
}

#[derive(Serialize, Deserialize)]
struct Settings {
    render: RenderSettings,
    ray_offset_m: f64,
    #[serde(default)]
    pixels: Pixels,
    solution: serde_json::Value,
}

impl Attributes {
    /// Describes an image of `scene`.
    #[must_use]
    pub fn new(
        scene: &Scene,
        view: ViewDescription,
        render: RenderSettings,
        ray_offset: f64,
        solution: serde_json::Value,
    ) -> Self {
        let mut surfaces: Vec<SurfaceRecord> = scene
            .surfaces
            .iter()
            .map(|surface| SurfaceRecord {
                name: surface.name.clone(),
                polygons: Vec::new(),
            })
            .collect();
        for (face, id) in scene.faces.iter().zip(scene.face_ids()) {
            let material = &scene.materials[face.material.0 as usize];
            surfaces[face.surface.0 as usize].polygons.push(PolygonRecord {
                corners: scene.polygon(id),
                exitance: material.exitance,
                reflectance: material.reflectance,
            });
        }
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            render,
            ray_offset,
            solution,
            view,
            surfaces,
            pixels: Pixels::default(),
            field: None,
            scene_intact: true,
        }
    }

    /// Marks the image as a field of form factors.
    #[must_use]
    pub fn with_field(mut self, record: FieldRecord) -> Self {
        self.field = Some(record);
        self
    }

    /// Returns the attributes' names and texts, in the order of the names.
    pub(super) fn to_texts(&self) -> Result<Vec<(&'static str, String)>, serde_json::Error> {
        let surfaces = ascii_json(&self.surfaces)?;
        let settings = Settings {
            render: self.render,
            ray_offset_m: self.ray_offset,
            pixels: self.pixels,
            solution: self.solution.clone(),
        };
        let is_adaptive = PixelSamples::new(&self.render, &self.view).is_adaptive();
        let format = if is_adaptive { FORMAT } else { GRID_FORMAT };
        let mut texts = vec![
            ("camera", ascii_json(&self.view)?),
            ("radiosity_format", format.to_string()),
            ("radiosity_version", self.version.clone()),
            ("scene_sha256", sha256(&surfaces)),
            ("seed", self.render.seed.to_string()),
            ("settings", ascii_json(&settings)?),
            ("surfaces", surfaces),
        ];
        if let Some(field) = &self.field {
            texts.insert(1, ("field", ascii_json(field)?));
        }
        Ok(texts)
    }

    /// Reads the texts of [`to_texts`](Self::to_texts); `text` returns an attribute by its name.
    pub(super) fn from_texts(text: impl Fn(&'static str) -> Option<String>) -> Result<Self, AttributeError> {
        let get = |name| text(name).ok_or(AttributeError::Missing(name));
        let format = get("radiosity_format")?;
        if ![GRID_FORMAT, FORMAT].map(|known| known.to_string()).contains(&format) {
            return Err(AttributeError::Format(format));
        }
        let surfaces = get("surfaces")?;
        let scene_intact = sha256(&surfaces) == get("scene_sha256")?;
        let settings: Settings = parse("settings", &get("settings")?)?;
        Ok(Self {
            version: get("radiosity_version")?,
            render: settings.render,
            ray_offset: settings.ray_offset_m,
            pixels: settings.pixels,
            solution: settings.solution,
            view: parse("camera", &get("camera")?)?,
            surfaces: parse("surfaces", &surfaces)?,
            field: text("field").map(|text| parse("field", &text)).transpose()?,
            scene_intact,
        })
    }
}

/// A reason why attributes cannot be read.
#[derive(Debug)]
pub(super) enum AttributeError {
    Missing(&'static str),
    Format(String),
    Bad { name: &'static str, reason: String },
}

fn parse<T: DeserializeOwned>(name: &'static str, text: &str) -> Result<T, AttributeError> {
    serde_json::from_str(text).map_err(|error| AttributeError::Bad {
        name,
        reason: error.to_string(),
    })
}

/// Returns JSON in which every character outside ASCII is escaped: attribute texts are bytes without an encoding.
fn ascii_json(value: &impl Serialize) -> Result<String, serde_json::Error> {
    use std::fmt::Write;
    let json = serde_json::to_string(value)?;
    let mut text = String::with_capacity(json.len());
    for character in json.chars() {
        if character.is_ascii() {
            text.push(character);
        } else {
            for unit in character.encode_utf16(&mut [0; 2]) {
                // Writing to a String cannot fail.
                let _ = write!(text, "\\u{unit:04x}");
            }
        }
    }
    Ok(text)
}

fn sha256(text: &str) -> String {
    hexadecimal(&Sha256::digest(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_is_ascii_and_reads_back() {
        let names = ["naïve", "光", "😀", "\"\\\n"];
        let text = ascii_json(&names).expect("strings are valid JSON");
        assert!(text.is_ascii() && text.contains("\\u5149"));
        let back: [String; 4] = serde_json::from_str(&text).expect("the text is JSON");
        assert_eq!(back, names);
    }

    #[test]
    fn the_hash_is_sha256() {
        assert_eq!(
            sha256("abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
