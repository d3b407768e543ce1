//! `radiosity form-factors`.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::FormFactorsArgs;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use super::surfaces::surfaces_to_json;
use super::{Outcome, checks, merge, name_width, solution};
use crate::form_factor::Fraction;
use crate::matrix::{Need, SurfaceRow};
use crate::mesh::Subdivision;
use crate::plan::byte_text;
use crate::printable::{counted, printable};
use crate::report::form_factors::{FormFactorReport, Format};
use crate::report::memory_used_byte;
use crate::scene::{Scene, SurfaceId};
use crate::workflow::{Afterwards, Demand, FormFactorStudy, Memory, Model};

pub(super) fn run(args: &FormFactorsArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("form-factors", &args.common);
    let result = work(args, &mut run);
    run.ended(result)
}

fn work(args: &FormFactorsArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let format = args.output.as_deref().map(Format::of).transpose()?;
    if args.surface.is_some() && format.is_some_and(|format| format != Format::Vtu) {
        return Err(Failure::usage("--surface is for `-o F.vtu`"));
    }
    files(args).check()?;
    let demand = Demand {
        output: args.output.clone(),
        ..Demand::default()
    };
    run.expect(&args.storage, demand);
    let mut model = run.prepare(&args.scene, args.mesh, |_| Subdivision::Uniform(1))?;
    let surface = args
        .surface
        .as_deref()
        .map(|name| surface_named(&model.scene, name))
        .transpose()?;
    let request = run.request(&args.method, args.tolerance, Afterwards::Nothing);
    let computed = model.form_factors(&request, Need::AsTheyAre, &mut run.cx)?;
    run.cx.judge_leaking_exchange();
    let table = run.cx.time("surfaces", || {
        SurfaceTable::of(&mut model, &computed, &run.cx.memory, args.common.json)
    });
    computed.factors.if_readable(())?;
    if let Some(path) = &args.output {
        let report = FormFactorReport {
            scene: &model.scene,
            mesh: &model.mesh,
            factors: &computed.factors,
            tolerance_met: computed.tolerance_met,
            pairs: computed.pairs,
            sky: Some(&computed.sky),
            settings: &run.cx.settings,
            surface,
        };
        run.cx.time("write", || report.write(path))?;
    }
    run.bars.finish();
    let mut result = to_json(&model, &computed, &table);
    result["output"] = json!(args.output);
    let document = run.document_of(&model, result);
    let mut text = run.explanation(&model);
    describe(&mut text, &model, &computed, &table);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    Ok(Outcome {
        text,
        document,
        code: run.judged(solution::code_of(Some(&computed)), args.audit.strict),
    })
}

fn files(args: &FormFactorsArgs) -> FileSet {
    let mut files = FileSet::default();
    if let Some(path) = &args.output {
        files.writes_form_factors(path);
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files
}

/// Returns the surface of a name; another is a usage error.
pub(super) fn surface_named(scene: &Scene, name: &str) -> Result<SurfaceId, Failure> {
    let place = scene.surfaces.iter().position(|surface| surface.name == name);
    place.and_then(|k| u32::try_from(k).ok()).map(SurfaceId).ok_or_else(|| {
        let known: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).take(12).collect();
        Failure::usage(format!(
            "there is no surface `{name}`; the first ones are {}",
            known.join(", ")
        ))
    })
}

/// What the command tells of surfaces.
enum SurfaceTable {
    /// Form factors between all of them.
    Whole(Vec<SurfaceRow>),
    /// What no front receives of the light of each, where the form factors between them would not fit into memory.
    Lost(Vec<f64>),
    /// Nothing: neither a document nor a table is to be printed.
    NotAsked,
}

impl SurfaceTable {
    /// Memory for a form factor between two surfaces and its error, as numbers and in the document: 79 measured.
    const ENTRY_BYTE: u64 = 96;

    /// Calculates what is asked for, and notes in the plan what does not fit.
    fn of(model: &mut Model, computed: &FormFactorStudy, memory: &Memory, is_json: bool) -> Self {
        let n = model.scene.surfaces.len();
        if n > TABLE && !is_json {
            return Self::NotAsked;
        }
        let surface_of_patch: Vec<u32> = model.mesh.patches.iter().map(|p| p.surface.0).collect();
        let rows = computed.factors.surface_rows(&surface_of_patch, n);
        let needed = Self::ENTRY_BYTE.saturating_mul((n as u64).saturating_pow(2));
        let free = memory.limit().saturating_sub(memory_used_byte().unwrap_or(0));
        if n <= TABLE || needed <= free {
            return Self::Whole(rows.iter().collect());
        }
        model.plan.left_out.push(format!(
            "surface_form_factor and surface_error: those of {n} × {n} surfaces need {} of memory; -o F.csv writes them row by row",
            byte_text(needed)
        ));
        Self::Lost(rows.lost_factors())
    }

    /// Returns form factors, errors and lost factors as the document has them.
    fn to_json(&self) -> [Value; 3] {
        match self {
            Self::Whole(rows) => [
                rows.iter().map(|row| json!(row.form_factor)).collect(),
                rows.iter().map(|row| json!(row.error)).collect(),
                rows.iter().map(|row| json!(row.lost_factor)).collect(),
            ],
            Self::Lost(lost) => [Value::Null, Value::Null, json!(lost)],
            Self::NotAsked => [Value::Null, Value::Null, Value::Null],
        }
    }
}

fn to_json(model: &Model, computed: &FormFactorStudy, table: &SurfaceTable) -> Value {
    let n = model.scene.surfaces.len();
    let mut result = checks::checks_to_json(computed);
    let sky = computed.sky.of_surfaces(&model.mesh, n);
    let values = |of: &[Fraction]| -> Vec<f64> { of.iter().map(|fraction| fraction.value).collect() };
    let errors = |of: &[Fraction]| -> Option<Vec<f64>> {
        computed
            .errors_known
            .then(|| of.iter().map(|fraction| fraction.error()).collect())
    };
    let more = json!({
        "n_patches": model.mesh.n_patches(),
        "n_surfaces": n,
        "surfaces": surfaces_to_json(model),
        "sky_factor": values(&sky.sky),
        "sky_factor_error": errors(&sky.sky),
        "back_factor": values(&sky.back),
        "back_factor_error": errors(&sky.back),
    });
    merge(&mut result, more);
    // Put in here, because what stands in `json!` is copied.
    let names = ["surface_form_factor", "surface_error", "lost_factor"];
    for (name, value) in names.into_iter().zip(table.to_json()) {
        result[name] = value;
    }
    result
}

/// More surfaces than this do not fit a terminal as a table.
const TABLE: usize = 12;

/// Writing to a String cannot fail; the results of `write!` are dropped for that reason.
fn describe(text: &mut String, model: &Model, computed: &FormFactorStudy, table: &SurfaceTable) {
    let n = model.scene.surfaces.len();
    let _ = writeln!(text, "{} patches on {}", model.mesh.n_patches(), counted(n, "surface"));
    checks::describe_checks(text, computed);
    let rows = match table {
        SurfaceTable::Whole(rows) if n <= TABLE => rows,
        _ => {
            let _ = writeln!(
                text,
                "the {n} × {n} surface form factors are in what --json prints and in the table that -o F.csv writes"
            );
            return;
        }
    };
    let names: Vec<String> = model.scene.surfaces.iter().map(|s| printable(&s.name)).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let width = name_width(names.iter().copied());
    let _ = writeln!(
        text,
        "\nform factors from row to column, what no face receives (lost) and what of it escapes (sky), and the greatest estimated error of each row"
    );
    let column = heads_width(&names);
    let _ = write!(text, "{:width$}", "");
    for name in &names {
        let _ = write!(text, " {:>column$}", shortened(name, column));
    }
    let _ = writeln!(text, " {:>9} {:>9} {:>9}", "lost", "sky", "error");
    let sky_of_each = computed.sky.of_surfaces(&model.mesh, n).sky;
    for ((row, name), sky) in rows.iter().zip(names).zip(sky_of_each) {
        let _ = write!(text, "{name:width$}");
        for value in &row.form_factor {
            let _ = write!(text, " {value:>column$.6}");
        }
        let error = row.error.iter().copied().fold(0.0, f64::max);
        // A row that is complete may be so but for rounding of either sign.
        let lost = if row.lost_factor.abs() < 5e-7 {
            0.0
        } else {
            row.lost_factor
        };
        let _ = writeln!(text, " {lost:>9.6} {:>9.6} {error:>9.1e}", sky.value);
    }
    let _ = writeln!(text);
}

/// Returns the width of the columns of a table: the least that tells the names at their heads apart, and 9 at least.
fn heads_width(names: &[&str]) -> usize {
    let all_differ = |width: &usize| {
        let heads: BTreeSet<String> = names.iter().map(|name| shortened(name, *width)).collect();
        heads.len() == names.len()
    };
    let longest = name_width(names.iter().copied());
    (9..longest).find(all_differ).unwrap_or(longest.max(9))
}

fn shortened(name: &str, width: usize) -> String {
    name.chars().take(width).collect()
}
