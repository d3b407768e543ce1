//! The list of the formats of scene files, and the detection of a file's format.

use std::fmt;
use std::io::Read as _;
use std::path::Path;
#[cfg(feature = "cli")]
use std::path::PathBuf;

use super::polygons::Polygons;
use super::reader::{HEAD, Head, Reader};
use super::source::Source;
use super::{LoadOptions, gltf, msh, obj, ply, stl, vs3, vtk};
use crate::input_file;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// All formats: if several recognise a file, the first one counts; if none does, the file is OBJ.
static REGISTRY: [&dyn Reader; 7] = [
    &gltf::Gltf,
    &ply::Ply,
    &msh::Msh,
    &vtk::Vtk,
    &vs3::Vs3,
    &stl::Stl,
    &obj::Obj,
];

/// A format of scene files.
#[derive(Clone, Copy)]
pub struct Format(&'static dyn Reader);

impl Format {
    /// Iterates over all formats.
    pub fn all() -> impl Iterator<Item = Self> {
        REGISTRY.into_iter().map(Self)
    }

    /// Returns the format of a name, or of a suffix of its files, if there is one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let name = name.to_lowercase();
        Self::all().find(|format| format.name() == name || format.0.suffixes().contains(&&*name))
    }

    /// Returns its name: `obj`, `stl`, `ply`, `msh`, `vtk`, `gltf`, `vs3`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// Returns a description in a few words.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.0.summary()
    }

    /// Returns the format of a file: by its content, else by its suffix, else OBJ.
    ///
    /// The content of a pipe is not examined.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn of(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let unreadable = |source| SceneError::new(Origin::file(path), SceneErrorKind::Unreadable { source });
        let Some(file) = input_file::open_to_look(path).map_err(unreadable)? else {
            let head = Head { bytes: &[], length: 0 };
            return Ok(Self::of_start(path, &head));
        };
        let length = file.metadata().map_err(unreadable)?.len();
        let mut bytes = Vec::new();
        file.take(HEAD as u64).read_to_end(&mut bytes).map_err(unreadable)?;
        let bytes = &bytes[..];
        Ok(Self::of_start(path, &Head { bytes, length }))
    }

    /// Returns the format of a file from its first bytes.
    pub(super) fn of_start(path: &Path, head: &Head<'_>) -> Self {
        let has_suffix = |format: &Self| format.has_suffix(path);
        // If the content fits several formats, the suffix decides.
        let shown = Self::all().filter(|format| format.0.recognises(head));
        let best = shown.min_by_key(|format| !has_suffix(format));
        best.or_else(|| Self::all().find(has_suffix)).unwrap_or(Self(&obj::Obj))
    }

    /// Returns whether files of the format have the suffix of a file.
    fn has_suffix(self, path: &Path) -> bool {
        let suffix = path.extension().map(|suffix| suffix.to_string_lossy().to_lowercase());
        suffix.is_some_and(|suffix| self.0.suffixes().contains(&&*suffix))
    }

    /// Returns whether a file shows the format, by its start or its suffix.
    pub(super) fn is_shown(self, path: &Path, head: &Head<'_>) -> bool {
        self.0.recognises(head) || self.has_suffix(path)
    }

    /// Returns whether its files have cell arrays that can name surfaces.
    pub(super) fn has_arrays(self) -> bool {
        self.0.has_arrays()
    }

    pub(super) fn read(self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        self.0.read(source, options)
    }

    /// Returns the existing files that a file names, without reading the scene.
    #[cfg(feature = "cli")]
    pub(crate) fn companions(self, path: &Path) -> Vec<PathBuf> {
        self.0.companions(path)
    }
}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Format({})", self.name())
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Format {}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
