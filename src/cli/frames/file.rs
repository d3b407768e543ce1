//! The file of frames.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use crate::cli::failure::Failure;
use crate::scene::{Motion, MotionError, Pose, Scene};

/// ```toml
/// [[frame]]
/// name = "noon"
/// lighting = "noon.toml"  # as for solve --lighting; without it, the scene's own
/// camera = "door.toml"    # a camera file or "unfolded"; without it, as the flags say
///
/// [[frame.move]]          # as often as there are motions, done one after another; without any, as the scene has it
/// surface = "door"        # or a list of names that move as one
/// rotate = 30.0           # see Motion
/// ```
///
/// Paths are relative to the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FramesFile {
    #[serde(default)]
    frame: Vec<Spanned<FrameInFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameInFile {
    name: String,
    lighting: Option<PathBuf>,
    camera: Option<PathBuf>,
    #[serde(default, rename = "move")]
    moves: Vec<Spanned<Motion>>,
}

/// A frame as the file has it.
pub(super) struct Wanted {
    pub(super) name: String,
    pub(super) lighting: Option<PathBuf>,
    pub(super) camera: Option<PathBuf>,
    /// Motions with their lines.
    moves: Vec<(usize, Motion)>,
}

impl Wanted {
    /// Returns the motions.
    pub(super) fn motions(&self) -> Vec<Motion> {
        self.moves.iter().map(|(_, motion)| motion.clone()).collect()
    }

    /// Returns the pose that the motions bring the scene to, which is found out to be possible.
    pub(super) fn pose(&self, file: &Path, scene: &Scene) -> Result<Pose, Failure> {
        let mut pose = Pose::default();
        for (line, motion) in &self.moves {
            let refused = |error: MotionError| bad(file, Some(*line), &format!("frame `{}`: {error}", self.name));
            pose.push(scene, motion).map_err(refused)?;
            scene.posed(&pose).map_err(refused)?;
        }
        Ok(pose)
    }
}

/// What is wrong with a file of frames.
fn bad(file: &Path, line: Option<usize>, message: &str) -> Failure {
    let place = line.map_or_else(String::new, |line| format!(":{line}"));
    let mut failure = Failure::new("bad_frames", format!("{}{place}: {message}", file.display())).in_file(file);
    failure.line = line.and_then(|line| u32::try_from(line).ok());
    failure
}

/// Reads the file of frames.
pub(super) fn read(file: &Path) -> Result<Vec<Wanted>, Failure> {
    let text = std::fs::read_to_string(file).map_err(|error| bad(file, None, &format!("cannot be read: {error}")))?;
    let line_of = |at: usize| text.get(..at).map_or(1, |before| before.matches('\n').count() + 1);
    let parsed: FramesFile = toml::from_str(&text).map_err(|error| {
        let message = error.message().trim().replace('\n', ", ");
        let line = error.span().map(|span| line_of(span.start));
        bad(file, line, &format!("{message}; correct the frames"))
    })?;
    if parsed.frame.is_empty() {
        return Err(bad(file, None, "there is no [[frame]]; add one"));
    }
    let mut frames: Vec<Wanted> = Vec::new();
    for spanned in parsed.frame {
        let line = line_of(spanned.span().start);
        let frame = spanned.into_inner();
        let is_plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        if frame.name.is_empty() || !frame.name.chars().all(is_plain) {
            let message = format!(
                "the name {:?} is to be a part of a file's name; use letters, digits, -, _ and .",
                frame.name
            );
            return Err(bad(file, Some(line), &message));
        }
        if frames.iter().any(|other| other.name == frame.name) {
            let message = format!("two frames are called `{}`; rename one", frame.name);
            return Err(bad(file, Some(line), &message));
        }
        let moves = frame.moves.into_iter();
        frames.push(Wanted {
            name: frame.name,
            lighting: frame.lighting,
            camera: frame.camera,
            moves: moves
                .map(|motion| (line_of(motion.span().start), motion.into_inner()))
                .collect(),
        });
    }
    Ok(frames)
}
