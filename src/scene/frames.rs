//! A list of frames: lightings, cameras and places of objects for one scene, in the order in which they are shown.

use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use super::table::{Content, Table};
use super::toml_file::TomlFile;
use super::{Motion, MotionError, Origin, Pose, Scene, SceneError, SceneErrorKind};
use crate::input_file;

/// One frame as its file names it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Its name: letters, digits, `-`, `_` and `.`, so that it can be a part of a file's name.
    pub name: String,
    /// The file of its lighting, relative to the list's folder; `None` for the scene's own.
    pub lighting: Option<PathBuf>,
    /// The file of its camera, relative to the list's folder, or `unfolded`; `None` for the caller's.
    pub camera: Option<PathBuf>,
    /// The line of the list where it begins.
    pub line: u32,
    /// The motions, in order, each with its line.
    moves: Vec<(u32, Motion)>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FramesFile {
    #[serde(default)]
    frame: Vec<Spanned<Table<FrameInFile>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameInFile {
    name: String,
    lighting: Option<PathBuf>,
    camera: Option<PathBuf>,
    #[serde(default, rename = "move")]
    moves: Vec<Spanned<Table<Motion>>>,
}

impl Content for FrameInFile {
    const EXPECTED: &'static str = "a table with a `name`, as in [[frame]]";
}

impl Content for Motion {
    const EXPECTED: &'static str =
        "a table with a `surface` and its motion, as in { surface = \"door\", rotate = 30.0 }";
}

impl Frame {
    /// Returns the motions in order.
    #[must_use]
    pub fn motions(&self) -> Vec<Motion> {
        self.moves.iter().map(|(_, motion)| motion.clone()).collect()
    }

    /// Returns the pose of the scene after the motions; `file` is the list that the frame comes from.
    ///
    /// # Errors
    /// [`BadFrames`](crate::scene::SceneErrorKind::BadFrames), with the line, for a motion that the scene cannot make.
    pub fn pose(&self, file: impl AsRef<Path>, scene: &Scene) -> Result<Pose, SceneError> {
        let refused = |line: Option<u32>, error: MotionError| {
            SceneError::new(
                Origin::line(file.as_ref().to_owned(), line),
                SceneErrorKind::BadFrames {
                    message: format!("frame `{}`: {error}", self.name),
                },
            )
        };
        let mut pose = Pose::default();
        let mut placed = None;
        for (line, motion) in &self.moves {
            let refused = |error| refused(Some(*line), error);
            pose.push(scene, motion).map_err(refused)?;
            placed = Some(scene.placed(&pose).map_err(refused)?);
        }
        // During the motions, one object may lie at a place that another one leaves later.
        if let Some(placed) = placed {
            placed.expect_no_overlap(&pose).map_err(|error| {
                let moves_it = |motion: &Motion| match &error {
                    MotionError::Coincident { surface, .. } => motion.moves(surface),
                    _ => true,
                };
                let last = self.moves.iter().rev().find(|(_, motion)| moves_it(motion));
                refused(last.map(|(line, _)| *line), error)
            })?;
        }
        Ok(pose)
    }
}

/// Reads a list of frames from a TOML file; it has at least one frame, and all names differ.
///
/// ```toml
/// [[frame]]
/// name = "noon"
/// lighting = "noon.toml"  # see `Lighting::load`; without it, the scene's own
/// camera = "door.toml"    # a camera file or "unfolded"; without it, as the flags say
///
/// [[frame.move]]          # as often as there are motions, done one after another; without any, as the scene has it
/// surface = "door"        # or a list of names that move as one
/// rotate = 30.0           # see `Motion`
/// ```
///
/// Paths are relative to the file.
///
/// # Errors
/// A file that cannot be read; [`BadFrames`](crate::scene::SceneErrorKind::BadFrames), with the line, for text that is no such TOML, a name that is empty, repeated or unfit to be a part of a
/// file's name, or a list without frames.
pub fn load(file: impl AsRef<Path>) -> Result<Vec<Frame>, SceneError> {
    let file = file.as_ref();
    listed(&TomlFile::read(file, BAD)?, file)
}

/// Reads a list of frames from text, as [`load`] does; `name` stands for the file in messages, and paths are relative to its folder.
///
/// # Errors
/// As for [`load`].
pub fn parse(text: String, name: impl AsRef<Path>) -> Result<Vec<Frame>, SceneError> {
    let name = name.as_ref();
    listed(&TomlFile::of_text(name.to_owned(), text, BAD), name)
}

/// Makes the error kind of this file format from a message.
const BAD: fn(String) -> SceneErrorKind = |message| SceneErrorKind::BadFrames { message };

fn listed(list: &TomlFile, file: &Path) -> Result<Vec<Frame>, SceneError> {
    let bad = |start: Option<usize>, message: String| list.bad(start, message);
    let parsed: FramesFile = list.parsed("frames")?;
    if parsed.frame.is_empty() {
        return Err(bad(None, "there is no [[frame]]; add one".to_owned()));
    }
    let mut frames: Vec<Frame> = Vec::new();
    let mut names = std::collections::BTreeSet::new();
    for spanned in parsed.frame {
        let start = spanned.span().start;
        let Table(frame) = spanned.into_inner();
        let is_plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        if frame.name.is_empty() || !frame.name.chars().all(is_plain) {
            let message = format!(
                "the name {:?} is to be a part of a file's name; use letters, digits, -, _ and .",
                frame.name
            );
            return Err(bad(Some(start), message));
        }
        if !names.insert(frame.name.clone()) {
            let message = format!("two frames are called `{}`; rename one", frame.name);
            return Err(bad(Some(start), message));
        }
        let cameras = frame.camera.iter().filter(|path| *path != Path::new("unfolded"));
        for named in frame.lighting.iter().chain(cameras) {
            expect_plain(file, named).map_err(|message| bad(Some(start), message))?;
        }
        let line_of = |motion: &Spanned<Table<Motion>>| list.line(motion.span().start);
        frames.push(Frame {
            name: frame.name,
            lighting: frame.lighting,
            camera: frame.camera,
            line: list.line(start),
            moves: frame
                .moves
                .into_iter()
                .map(|motion| (line_of(&motion), motion.into_inner().0))
                .collect(),
        });
    }
    Ok(frames)
}

/// Refuses a pipe or a device that a list names; the reader reports missing files.
fn expect_plain(list: &Path, named: &Path) -> Result<(), String> {
    match input_file::expect_plain(&list.parent().unwrap_or(Path::new("")).join(named)) {
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Err(format!("`{}`: {error}", named.display())),
        _ => Ok(()),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::load as load_scene;

    /// Two upright plates of 1 m, `a` at x from 0 to 1 and `b` from 2 to 3, and a lamp in front of both.
    const PLATES: &str = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 2 0 0\nv 3 0 0\nv 3 0 1\nv 2 0 1\n\
         v 0 -1 0\nv 0 -1 1\nv 1 -1 1\nv 1 -1 0\no a\nf 1 2 3 4\no b\nf 5 6 7 8\no lamp\nf 9 10 11 12\n";

    fn pose_of(moves: &str) -> Result<Pose, SceneError> {
        let directory = tempfile::tempdir().unwrap();
        let (obj, list) = (directory.path().join("plates.obj"), directory.path().join("list.toml"));
        std::fs::write(&obj, PLATES).unwrap();
        std::fs::write(&list, format!("[[frame]]\nname = \"first\"\n{moves}")).unwrap();
        let scene = load_scene(&obj).unwrap().scene;
        load(&list).unwrap()[0].pose("list.toml", &scene)
    }

    fn shift(surface: &str, by: f64) -> String {
        format!("[[frame.move]]\nsurface = \"{surface}\"\ntranslate = [{by:?}, 0.0, 0.0]\n")
    }

    #[test]
    fn a_frame_is_refused_where_its_scene_would_be() {
        for (surface, by, other) in [("b", -1.5, "a"), ("a", 1.25, "b"), ("b", -2.0, "a")] {
            let moves = shift("lamp", 0.5) + &shift(surface, by) + &shift("lamp", 0.5);
            let message = pose_of(&moves).unwrap_err().to_string();
            let expected = format!(
                "list.toml:6: frame `first`: a face of `{surface}` comes to lie on one of `{other}` in one plane"
            );
            assert!(
                message.starts_with(&expected) && message.contains("move it elsewhere"),
                "{message}"
            );
        }
        assert!(pose_of(&shift("b", -1.0)).is_ok(), "side by side");
    }

    #[test]
    fn objects_may_change_places() {
        assert!(pose_of(&(shift("a", 2.0) + &shift("b", -2.0))).is_ok());
    }
}
