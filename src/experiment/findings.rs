//! The findings of reproductions, as text, files and JSON.

use serde::Serialize;

use crate::report::{Machine, Table, table};
use crate::workflow::Settings;

/// Files of one directory, by name.
pub type Files = Vec<(String, Vec<u8>)>;

/// The warning if a check of a reproduction fails.
const FAILED: &str = "our own figures are not what they must be; see the failed checks";

/// Returns a file of text.
#[must_use]
pub fn text_file(name: impl Into<String>, content: String) -> (String, Vec<u8>) {
    (name.into(), content.into_bytes())
}

/// The findings of a reproduction, ready to be printed and written.
///
/// Files with times of ours have `time` in their names; the others have the same bytes in every run.
#[derive(Clone, Debug)]
pub struct Findings<D> {
    /// The report in Markdown, with times.
    pub printed: String,
    /// The files.
    pub files: Files,
    /// What images among the files show: a name and a sentence each.
    pub captions: Vec<(String, String)>,
    /// Its part of the JSON document.
    pub document: D,
    /// The warning if a figure of ours fails its check.
    pub wrong: Option<String>,
}

/// The findings beside those of a paper.
pub type PaperFindings<'a, R, T> = Findings<PaperDocument<'a, R, T>>;

impl<'a, R, T> PaperFindings<'a, R, T> {
    /// Returns findings without captions, with a warning unless all checks are met.
    pub(super) fn new(results: &'a R, times: T, inside: bool, printed: String, files: Files) -> Self {
        Self {
            printed,
            files,
            captions: Vec::new(),
            document: PaperDocument {
                machine: Machine::here(),
                inside,
                results,
                times,
            },
            wrong: (!inside).then(|| FAILED.to_owned()),
        }
    }
}

/// A figure of ours that must lie in a range.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "RangeCheck"))]
pub struct Check {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// The least and the greatest value that it may have.
    pub range: [f64; 2],
    /// Whether it lies there.
    pub is_met: bool,
}

impl Check {
    /// Returns the check of a value.
    #[must_use]
    pub fn new(name: String, value: f64, range: [f64; 2]) -> Self {
        Self {
            name,
            value,
            range,
            is_met: (range[0]..=range[1]).contains(&value),
        }
    }

    /// Returns whether all checks are met.
    pub(super) fn all_met(checks: &[Self]) -> bool {
        checks.iter().all(|check| check.is_met)
    }

    /// Returns a table of checks, with `n_decimals` decimals.
    #[must_use]
    pub fn table(checks: &[Self], n_decimals: usize) -> Table {
        table! { check in checks;
            "check": check.name,
            "value": format!("{:.n_decimals$}", check.value),
            "least": format!("{:.n_decimals$}", check.range[0]),
            "greatest": format!("{:.n_decimals$}", check.range[1]),
            "met": if check.is_met { "yes" } else { "NO" },
        }
    }
}

/// The part of a reproduction's document that is its own, with the names of its files.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Reproduced<D> {
    /// The findings.
    #[serde(flatten)]
    pub found: D,
    /// The files that were written into the directory.
    pub files: Vec<String>,
}

/// Numbers beside those of a paper, with what they were measured on.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PaperDocument<'a, R, T> {
    /// The machine that the times were measured on.
    pub machine: Machine,
    /// True if all checks are met.
    pub inside: bool,
    /// The findings.
    pub results: &'a R,
    /// Our times.
    pub times: T,
}

/// The file `results.json` of a reproduction: no times, so that equal work gives equal bytes.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct ResultsFile<'a, R> {
    /// The version of the JSON documents.
    pub(crate) schema_version: u32,
    /// The version of the program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) version: Option<&'static str>,
    /// The settings of the result.
    pub(crate) settings: &'a Settings,
    #[serde(flatten)]
    pub(crate) results: R,
}
