//! The command `radiosity points`.

use std::fmt::Write as _;

use super::Outcome;
use super::args::PointsArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use crate::document::PointsDocument;
use crate::heat::Boundary;
use crate::mesh::Subdivision;
use crate::printable::counted;
use crate::report::exchange::Format;
use crate::report::points;
use crate::workflow::Afterwards;

pub(super) fn run(args: &PointsArgs, run: &mut Run) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        Format::of(path, points::CONTENT)?;
    }
    let mut files = FileSet::default();
    if let Some(path) = &args.output {
        files.writes("the output", path);
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the points", Some(&args.points));
    files
        .reads("the boundary conditions", args.boundary.as_deref())
        .check()?;
    let queries = points::read(&args.points)?;
    run.expect(&args.storage, args.solver.demand(args.output.as_ref()));
    let mut model = run.prepare(&args.scene, args.mesh, |_| Subdivision::Uniform(1))?;
    let heat = match &args.boundary {
        None => None,
        Some(file) => {
            let boundary = Boundary::load(file, &model.scene)?;
            let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Light);
            let solver = args.solver.request();
            let need = solver.need(&run.cx)?;
            let factors = model.form_factors(&method, need, &mut run.cx)?;
            Some((model.heat(&factors, &boundary, &solver, &mut run.cx)?, boundary))
        }
    };
    let known = heat.as_ref().map(|(study, boundary)| (study, boundary));
    let views = model.points(&queries, known, args.person, &run.cx)?;
    let is_exact = heat.as_ref().is_none_or(|(study, _)| study.is_exact());
    let found = PointsDocument::new(&views);
    let PointsDocument {
        n_on_face,
        n_inside_solid: n_inside,
        ..
    } = found;
    if n_on_face + n_inside > 0 {
        run.warn(&format!(
            "{} on faces and {n_inside} inside solids have no meaningful result; `status` marks them; move them into the open",
            counted(n_on_face, "point")
        ));
    }
    let mut text = run.explanation(&model);
    if let Some(path) = &args.output {
        let settings = &run.cx.settings.record();
        run.cx
            .time("write", || points::write(path, &model.scene, &views, settings))?;
        let _ = writeln!(text, "wrote {} of {}", path.display(), counted(views.len(), "point"));
    } else {
        let mut table = Vec::new();
        // Writing to memory cannot fail.
        let _ = points::write_table(&mut table, &model.scene, &views);
        text.push_str(&String::from_utf8_lossy(&table));
    }
    run.bars.finish();
    Ok(Outcome {
        text,
        document: run.document_of(&model, found),
        code: if is_exact {
            ExitCode::Done
        } else {
            ExitCode::NotConverged
        },
    })
}
