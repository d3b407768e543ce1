//! `radiosity scene`.

use serde_json::json;

use super::args::SceneArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::{Outcome, SCHEMA_VERSION};
use crate::scene::{builtin, write_obj};

pub(super) fn run(args: &SceneArgs) -> Result<Outcome, Failure> {
    let built = builtin::build(&args.name, args.level)?;
    write_obj(&built.scene, &args.output)?;
    let (n_faces, n_surfaces) = (built.scene.faces.len(), built.scene.surfaces.len());
    Ok(Outcome {
        text: format!(
            "wrote {}: {n_faces} faces on {n_surfaces} surfaces\n",
            args.output.display()
        ),
        document: json!({
            "schema_version": SCHEMA_VERSION,
            "command": "scene",
            "version": env!("CARGO_PKG_VERSION"),
            "scene": args.name,
            "level": args.level,
            "output": args.output.display().to_string(),
            "n_faces": n_faces,
            "n_surfaces": n_surfaces,
        }),
        code: ExitCode::Done,
    })
}
