//! The command `radiosity reproduce`.

use super::Outcome;
use super::args::{PaperName, ReproduceArgs, parse_tables};
use super::failure::Failure;
use super::reproduction::Reproduction;
use crate::experiment::baranoski::{self, TABLE_OF_SOLVERS, solvers};
use crate::experiment::{ExperimentError, crater, lewis, malgouyres, pictures, stability};
use crate::progress::Progress;

pub(super) fn run(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    match args.paper {
        PaperName::Baranoski => baranoski(args),
        PaperName::Stability => stability(args),
        PaperName::Lewis => lewis(args),
        PaperName::Malgouyres => malgouyres(args),
        PaperName::Pictures => pictures(args),
        PaperName::Crater => crater(args),
    }
}

fn baranoski(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    if args.level.is_some() {
        return Err(Failure::usage("--level is for `lewis`; `baranoski` has no levels"));
    }
    let (seeds, seed) = (args.seeds.unwrap_or(baranoski::DEFAULT_SEEDS), args.seed.unwrap_or(0));
    let tables: Vec<u8> = match &args.tables {
        None => std::iter::once(TABLE_OF_SOLVERS).chain(baranoski::TABLES).collect(),
        Some(list) => parse_tables(list, TABLE_OF_SOLVERS..=*baranoski::TABLES.end()).map_err(Failure::usage)?,
    };
    let mut reproduction = Reproduction::new(args)?;
    let cx = &mut reproduction.run.cx;
    cx.settings.tables = Some(tables.clone());
    cx.settings.seeds = Some(seeds);
    cx.settings.seed = Some(seed);
    let of_form_factors: Vec<u8> = tables.iter().copied().filter(|t| *t != TABLE_OF_SOLVERS).collect();
    let cases = if tables.contains(&TABLE_OF_SOLVERS) {
        cx.time("solvers", || solvers::table_2(&cx.progress()))?
    } else {
        Vec::new()
    };
    let results = cx.time("reproduce", || {
        baranoski::reproduce(&of_form_factors, seeds, seed, &cx.progress())
    })?;
    let findings = baranoski::findings(&results, &cases, &cx.settings)?;
    reproduction.finish(findings)
}

fn stability(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    if args.tables.is_some() {
        return Err(Failure::usage("--tables has no use with `stability`; leave it out"));
    }
    if args.level.is_some() || args.seeds.is_some() {
        return Err(Failure::usage(
            "--level and --seeds have no use with `stability`, whose cases are what they are; leave them out",
        ));
    }
    let mut reproduction = Reproduction::new(args)?;
    let cx = &mut reproduction.run.cx;
    let seed = args.seed.unwrap_or(0);
    cx.settings.seed = Some(seed);
    let result = cx.time("stability", || stability::run(seed, &cx.progress()))?;
    let findings = result.findings(&cx.settings)?;
    reproduction.finish(findings)
}

fn lewis(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    if args.seeds.is_some() || args.seed.is_some() {
        return Err(Failure::usage(
            "--seeds and --seed are for `baranoski`; nothing in `lewis` is random",
        ));
    }
    let tables: Vec<u8> = match &args.tables {
        None => lewis::TABLES.collect(),
        Some(list) => parse_tables(list, lewis::TABLES).map_err(Failure::usage)?,
    };
    let level = args.level.unwrap_or(lewis::LEVEL_DEFAULT);
    let mut reproduction = Reproduction::new(args)?;
    let cx = &mut reproduction.run.cx;
    cx.settings.tables = Some(tables.clone());
    cx.settings.level = Some(level);
    let results = cx.time("reproduce", || {
        lewis::reproduce(&tables, level, lewis::ROUNDS, &cx.progress())
    })?;
    reproduction.finish(results.findings(&tables)?)
}

fn malgouyres(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    let why = "`malgouyres`: the paper has no table, and nothing is random";
    let level = level_of(args, why, malgouyres::LEVEL_DEFAULT, malgouyres::LEVEL_MAX)?;
    let (results, reproduction) = at_level(args, level, malgouyres::reproduce)?;
    reproduction.finish(results.findings()?)
}

fn pictures(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    let why = "`pictures`: it is one table of one solution";
    let level = level_of(args, why, pictures::LEVEL_DEFAULT, pictures::LEVEL_MAX)?;
    let (results, reproduction) = at_level(args, level, pictures::reproduce)?;
    reproduction.finish(results.findings()?)
}

fn crater(args: &ReproduceArgs) -> Result<Outcome, Failure> {
    let why = "`crater`: it is one table, and nothing is random";
    let level = level_of(args, why, crater::LEVEL_DEFAULT, crater::LEVEL_MAX)?;
    let (results, reproduction) = at_level(args, level, crater::reproduce)?;
    reproduction.finish(results.findings()?)
}

/// Runs a reproduction that has levels alone.
fn at_level<R>(
    args: &ReproduceArgs,
    level: u32,
    reproduce: fn(u32, &dyn Progress) -> Result<R, ExperimentError>,
) -> Result<(R, Reproduction), Failure> {
    let mut reproduction = Reproduction::new(args)?;
    let cx = &mut reproduction.run.cx;
    cx.settings.level = Some(level);
    let results = cx.time("reproduce", || reproduce(level, &cx.progress()))?;
    Ok((results, reproduction))
}

/// Returns the level of a reproduction that has levels alone; `why` names it in the error about other flags.
fn level_of(args: &ReproduceArgs, why: &str, default: u32, most: u32) -> Result<u32, Failure> {
    if args.tables.is_some() || args.seeds.is_some() || args.seed.is_some() {
        return Err(Failure::usage(format!(
            "--tables, --seeds and --seed have no use with {why}"
        )));
    }
    let level = args.level.unwrap_or(default);
    if level <= most {
        return Ok(level);
    }
    let name = why.split(':').next().unwrap_or_default();
    Err(Failure::usage(format!(
        "--level {level}: {name} has levels 1 to {most}"
    )))
}
