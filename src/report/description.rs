//! The description in a file of form factors.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest as _, Sha256};

use crate::form_factor::PairCounts;
use crate::mesh::{MeshOptions, Subdivision};
use crate::scene::hash::hexadecimal;

/// The layout of the files; its number changes when older files become unreadable.
pub(super) const FORMAT: &str = "radiosity form factors 2";

/// The description in a file of form factors, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Name and number of the file's layout.
    pub(super) format: String,
    /// The orientation of the matrix.
    orientation: String,
    /// The units of the arrays.
    unit: String,
    /// The number of patches n.
    pub n_patches: usize,
    /// The geometry's [`Mesh::geometry_hash`](crate::mesh::Mesh::geometry_hash).
    pub geometry_sha256: String,
    /// True if A_i F_ij is symmetric to rounding, because the upper triangle was computed or repaired.
    pub symmetric: bool,
    /// False if the error of a form factor is above the tolerance, by a spent budget or by rounded corners; `pairs` distinguishes these.
    pub tolerance_met: bool,
    /// The numbers of pairs of patches by their treatment; `None` for methods without pairs, and in older files.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub pairs: Option<PairCounts>,
    /// The settings of the form factors.
    pub settings: Map<String, Value>,
    /// Length and checksum of the file that this description accompanies, if that cannot hold them itself.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub(super) file: Option<FileCheck>,
}

/// Length and checksum of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FileCheck {
    pub(super) byte: u64,
    pub(super) sha256: String,
}

impl Description {
    pub(super) fn new(
        n_patches: usize,
        geometry_sha256: String,
        symmetric: bool,
        (tolerance_met, pairs): (bool, Option<PairCounts>),
        settings: Map<String, Value>,
    ) -> Self {
        Self {
            format: FORMAT.into(),
            orientation: "F[i, j] is the fraction of the light leaving patch i that reaches patch j".into(),
            unit: "F and its standard error: 1; area_m2: m2".into(),
            n_patches,
            geometry_sha256,
            symmetric,
            tolerance_met,
            pairs,
            settings,
            file: None,
        }
    }

    /// Returns the subdivision of the scene, or `None` if the settings do not contain it.
    ///
    /// Files of older programs do not state whether faces were cut at contact edges: they were not.
    #[must_use]
    pub fn mesh_options(&self) -> Option<MeshOptions> {
        let parts = self.settings.get("subdivide").and_then(Value::as_u64);
        let length = self.settings.get("max_edge_m").and_then(Value::as_f64);
        let subdivision = match (parts, length) {
            (Some(parts), _) => Subdivision::Uniform(u32::try_from(parts).ok()?),
            (None, Some(length)) => Subdivision::MaxEdge(length),
            (None, None) => return None,
        };
        let cut_at_walls = self.settings.get("cut_at_walls").and_then(Value::as_bool);
        Some(MeshOptions {
            subdivision,
            cut_at_walls: cut_at_walls.unwrap_or(false),
        })
    }

    /// Returns the JSON text, with a checksum of all other members.
    pub(super) fn to_json(&self) -> String {
        let mut value = serde_json::to_value(self).expect("text, numbers and maps with text keys");
        value[CHECKSUM] = checksum(&value).into();
        format!("{value:#}")
    }

    /// Reads the text of [`to_json`](Self::to_json); an error describes the fault of other text.
    pub(super) fn from_json(mut value: Value) -> Result<Self, String> {
        let stated = value.as_object_mut().and_then(|members| members.remove(CHECKSUM));
        if stated != Some(Value::from(checksum(&value))) {
            return Err("its description does not match its checksum".into());
        }
        serde_json::from_value(value).map_err(|error| format!("its description: {error}"))
    }
}

/// The name of the checksum among the members of a description.
const CHECKSUM: &str = "description_sha256";

/// Returns the SHA-256 of the compact JSON text, members in the order of their names.
fn checksum(value: &Value) -> String {
    hexadecimal(&Sha256::digest(value.to_string().as_bytes()))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn files_that_do_not_say_whether_faces_were_cut_are_for_whole_ones() {
        for (said, expected) in [
            (json!({}), false),
            (json!({"cut_at_walls": false}), false),
            (json!({"cut_at_walls": true}), true),
        ] {
            let mut settings = said.as_object().cloned().unwrap_or_default();
            settings.insert("subdivide".into(), 3.into());
            let description = Description::new(1, String::new(), true, (true, None), settings);
            let expected = MeshOptions {
                subdivision: Subdivision::Uniform(3),
                cut_at_walls: expected,
            };
            assert_eq!(description.mesh_options(), Some(expected), "{said}");
        }
    }
}
