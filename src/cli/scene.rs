//! The command `radiosity scene`.

use std::fmt::Write as _;

use super::Outcome;
use super::args::SceneArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::json::in_order;
use crate::document::{SceneDocument, VERSION};
use crate::printable::counted;
use crate::report::SCHEMA_VERSION;
use crate::scene::{builtin, write_obj};

pub(super) fn run(args: &SceneArgs) -> Result<Outcome, Failure> {
    let built = builtin::build(&args.name, args.level)?;
    write_obj(&built.scene, &args.output)?;
    // An existing camera is the user's own, or belongs to another scene of the folder.
    let camera_file = args.output.with_file_name("camera.toml");
    let is_left = camera_file.exists();
    let written_camera = match &built.camera {
        Some(camera) if !is_left => {
            camera.save(&camera_file)?;
            Some(&camera_file)
        }
        _ => None,
    };
    let (n_faces, n_surfaces) = (built.scene.faces.len(), built.scene.surfaces.len());
    let mut text = format!(
        "wrote {}: {} on {}\n",
        args.output.display(),
        counted(n_faces, "face"),
        counted(n_surfaces, "surface")
    );
    if let Some(file) = written_camera {
        let _ = writeln!(text, "wrote {}", file.display());
    }
    if is_left {
        let _ = writeln!(
            text,
            "{} is there already and was left: pictures of this scene will be seen from it unless --camera names another",
            camera_file.display()
        );
    }
    Ok(Outcome {
        text,
        document: in_order(&SceneDocument {
            schema_version: SCHEMA_VERSION,
            command: "scene",
            version: VERSION,
            scene: args.name.clone(),
            level: args.level,
            output: args.output.display().to_string(),
            camera: written_camera.map(|file| file.display().to_string()),
            camera_left: is_left.then(|| camera_file.display().to_string()),
            n_faces,
            n_surfaces,
        })
        .into(),
        code: ExitCode::Done,
    })
}
