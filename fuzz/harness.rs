//! What the targets share: a folder in memory, and the laws that every refusal obeys.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use radiosity::mesh::{Mesh, Subdivision};
use radiosity::scene::Scene;
use sha2::{Digest as _, Sha256};

/// A folder of this process; in memory where the system has such a place.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = parent.join(format!("radiosity-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for inputs");
    folder
});

/// The scene for which files of matrices, links and pictures are.
pub static CUBE: LazyLock<Scene> =
    LazyLock::new(|| radiosity::scene::builtin::build("cube", None).expect("a built-in scene").scene);

pub static MESH: LazyLock<Mesh> = LazyLock::new(|| Mesh::new(&CUBE, Subdivision::Uniform(1)).expect("a mesh"));

/// Returns the path of a file in the folder.
#[must_use]
pub fn at(name: &str) -> PathBuf {
    FOLDER.join(name)
}

/// Writes a file into the folder.
#[must_use]
pub fn put(name: &str, bytes: &[u8]) -> PathBuf {
    let path = at(name);
    std::fs::write(&path, bytes).expect("room for an input");
    path
}

/// A refusal is one line without control characters once shown, and names the file or one beside it.
///
/// # Panics
/// If it is not.
pub fn refused(path: &Path, message: &str) {
    assert!(!message.is_empty() && message.lines().count() == 1, "not one line: {message}");
    let folder = path.parent().and_then(Path::to_str).expect("a folder");
    assert!(message.contains(folder), "no file named: {message}");
}

/// Returns a description of form factors with its own checksum made right, and the file's where `content` is what that is of.
#[must_use]
pub fn described(text: &[u8], content: Option<&[u8]>) -> Option<String> {
    let mut value: serde_json::Value = serde_json::from_slice(text).ok()?;
    let members = value.as_object_mut()?;
    if let Some(content) = content {
        let file = serde_json::json!({ "byte": content.len(), "sha256": hexadecimal(content) });
        members.insert("file".into(), file);
    }
    members.remove("description_sha256");
    let sum = hexadecimal(value.to_string().as_bytes());
    value["description_sha256"] = sum.into();
    Some(format!("{value:#}"))
}

fn hexadecimal(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
