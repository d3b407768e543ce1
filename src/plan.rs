//! The plan of the work for a scene: the steps, those left out, and the reasons, which `--explain` prints.

mod storage;
mod voxels;

pub use storage::{
    Accuracy, MemoryEstimate, StorageDemand, StorageError, StoragePlan, StorageWish, byte_text, facing_patches,
    facing_share, plan_storage,
};
pub use voxels::{VoxelDemand, voxel_byte};

use serde::Serialize;

use crate::scene::topology::{self, Enclosure};
use crate::scene::{FaceId, Scene};

/// The omitted work of a scene without colours.
const GREY: &str = "two of three channels: every material is grey";

/// One decision with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Decision {
    /// The question.
    pub subject: &'static str,
    /// The choice.
    pub choice: String,
    /// Why.
    pub reason: String,
}

/// The plan of the work for a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// The number of channels: 1 if every material is grey, else 3.
    pub n_channels: usize,
    /// True if no face can occlude another, so that no visibility queries are needed.
    pub convex_and_empty: bool,
    /// True if the faces are known, without rays, to enclose all light.
    pub watertight: bool,
    /// The first face of each closed piece with inverted normals (see [`Enclosure`]).
    pub turned: Vec<FaceId>,
    /// The decisions, in the order in which they were made.
    pub decisions: Vec<Decision>,
    /// The work that this scene does not need.
    pub left_out: Vec<String>,
}

impl Plan {
    /// Plans the work for a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let Enclosure { watertight, turned } = Enclosure::of(scene);
        let mut plan = Self {
            n_channels: scene.n_channels_needed(),
            convex_and_empty: topology::is_convex_and_empty(scene),
            watertight,
            turned,
            decisions: Vec::new(),
            left_out: Vec::new(),
        };
        if plan.n_channels == 1 {
            plan.decide("channels", "1", "every material is grey");
            plan.left_out.push(GREY.into());
        } else {
            plan.decide("channels", "3", "at least one material is coloured");
        }
        if plan.convex_and_empty {
            plan.decide(
                "visibility",
                "none needed",
                "no vertex lies behind the plane of a face: nothing can block",
            );
        } else {
            plan.decide(
                "visibility",
                "by rays",
                "a vertex lies behind the plane of a face: something may block",
            );
        }
        if plan.watertight {
            plan.decide(
                "closure",
                "closed",
                "every edge joins two faces, and every front lies in an enclosure",
            );
        } else {
            plan.decide(
                "closure",
                "open until rays show otherwise",
                "some edge does not join two faces, or some front lies outside of all enclosures",
            );
        }
        plan
    }

    /// Records the number of channels of all lightings together, which may differ from that of the scene's own materials.
    pub fn revise_channels(&mut self, n_channels: usize) {
        if n_channels != self.n_channels {
            let reason = "one for each lighting in which all is grey, three for each of the others";
            self.revise("channels", n_channels.to_string(), reason);
            self.left_out.retain(|item| item != GREY);
        }
    }

    /// Records how many faces of a mesh are cut at contact edges, and whether they were to be; `whole` is the setting that keeps them whole.
    pub fn note_cut_faces(&mut self, n_cut_faces: usize, wanted: bool, whole: &str) {
        let left_out = "cutting faces at contact edges";
        match n_cut_faces {
            0 if wanted => self.left_out.push(format!("{left_out}: none crosses a face")),
            0 => self
                .left_out
                .push(format!("{left_out}: by {whole}, or as in the file of form factors")),
            n => self.decide(
                "cut faces",
                n.to_string(),
                "contact edges cross them, where light would leak",
            ),
        }
    }

    /// Replaces the decision on a subject, or adds one.
    pub fn revise(&mut self, subject: &'static str, choice: impl Into<String>, reason: impl Into<String>) {
        let (choice, reason) = (choice.into(), reason.into());
        match self.decisions.iter_mut().find(|decision| decision.subject == subject) {
            Some(decision) => {
                *decision = Decision {
                    subject,
                    choice,
                    reason,
                }
            }
            None => self.decide(subject, choice, reason),
        }
    }

    /// Adds a decision.
    pub fn decide(&mut self, subject: &'static str, choice: impl Into<String>, reason: impl Into<String>) {
        self.decisions.push(Decision {
            subject,
            choice: choice.into(),
            reason: reason.into(),
        });
    }
}

/// Returns a number of bytes, rounded to an integer.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative, and a conversion from f64 stays in range"
)]
fn whole(byte: f64) -> u64 {
    byte as u64
}
