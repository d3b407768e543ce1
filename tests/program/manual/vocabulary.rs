//! The page of the vocabulary: each quantity with its unit and its name in every interface, compared with the code.
//!
//! `cargo test --release --test program -- --ignored --nocapture list_vocabulary` prints the pages that use each of them.

use std::fmt::Write as _;
use std::path::Path;

use clap::Command;
use radiosity::cli;

use super::{in_repository, pages, read};
use crate::program::schema::SCHEMA;

/// A quantity and its names. A name that an interface does not have is empty.
struct Quantity {
    name: &'static str,
    /// The symbol of docs/notation.md.
    symbol: &'static str,
    unit: &'static str,
    /// Keys of JSON documents.
    json: &'static [&'static str],
    /// A flag, or keys of the TOML files of docs/materials.md.
    input: &'static [&'static str],
    /// Arrays and columns of `.npz`, `.vtu` and `.csv` files.
    files: &'static [&'static str],
    /// Attributes in Python, as `Class.attribute`.
    python: &'static [&'static str],
}

#[rustfmt::skip]
const QUANTITIES: &[Quantity] = &[
    Quantity { name: "form factor", symbol: "F_ij", unit: "1", json: &["form_factor", "surface_form_factor"], input: &["--form-factors"], files: &["F", "data"], python: &["FormFactors.surface", "FormFactors.matrix", "PointViews.factors"] },
    Quantity { name: "error of a form factor", symbol: "", unit: "1", json: &["error", "surface_error"], input: &["--form-factor-tolerance"], files: &["error"], python: &["FormFactors.errors", "FormFactors.surface_error", "PointViews.factor_errors"] },
    Quantity { name: "row sum", symbol: "", unit: "1", json: &["row_sum", "row_sum_error"], input: &["--row-tolerance"], files: &["row_sum"], python: &["FormFactors.row_sums", "FormFactors.row_sum_errors"] },
    Quantity { name: "factor to the surroundings", symbol: "", unit: "1", json: &["lost_factor"], input: &[], files: &["F_surroundings"], python: &["FormFactors.lost"] },
    Quantity { name: "sky factor", symbol: "", unit: "1", json: &["sky_factor", "sky_factor_error"], input: &[], files: &["sky_factor", "sky_factor_error"], python: &["FormFactors.sky", "FormFactors.sky_error"] },
    Quantity { name: "back factor", symbol: "", unit: "1", json: &["back_factor", "back_factor_error"], input: &[], files: &["back_factor", "back_factor_error"], python: &["FormFactors.backs", "FormFactors.backs_error"] },
    Quantity { name: "area", symbol: "A_i", unit: "m²", json: &["area_m2"], input: &[], files: &["area", "area_m2"], python: &["Model.patch_area", "Model.surface_area"] },
    Quantity { name: "reflectance", symbol: "ρ", unit: "1", json: &[], input: &["reflectance"], files: &["reflectance"], python: &["Model.reflectance", "Solution.reflectance"] },
    Quantity { name: "emissivity", symbol: "ε", unit: "1", json: &["emissivity"], input: &["emissivity"], files: &[], python: &["ExchangeFactors.emissivity"] },
    Quantity { name: "absorptance", symbol: "α", unit: "1", json: &["absorptance"], input: &["absorptance"], files: &[], python: &[] },
    Quantity { name: "exitance", symbol: "E", unit: "W/m²", json: &[], input: &["exitance", "--exitance"], files: &["exitance"], python: &["Model.exitance", "Solution.exitance"] },
    Quantity { name: "irradiance", symbol: "H", unit: "W/m²", json: &["irradiance_w_m2", "irradiance_w_m2_error"], input: &[], files: &["irradiance", "irradiance_w_m2"], python: &["Solution.irradiance", "PointViews.irradiance"] },
    Quantity { name: "radiosity", symbol: "B", unit: "W/m²", json: &["radiosity"], input: &[], files: &["radiosity", "radiosity_w_m2"], python: &["Solution.radiosity", "Solution.surface_means"] },
    Quantity { name: "error of the radiosity", symbol: "", unit: "W/m²", json: &[], input: &[], files: &["error"], python: &["Solution.error"] },
    Quantity { name: "relative error of the radiosity", symbol: "", unit: "1", json: &["error_bound", "estimated_relative_error"], input: &["--tolerance"], files: &[], python: &["Solution.error_bound", "Solution.relative_error"] },
    Quantity { name: "mesh error", symbol: "", unit: "1", json: &["mesh_error", "surface_mean_max", "patches_rms"], input: &[], files: &[], python: &["Solution.mesh_error", "Heat.mesh_error"] },
    Quantity { name: "residual", symbol: "r", unit: "W/m²", json: &["residual_l2", "residual_max"], input: &[], files: &["residual"], python: &["Solution.residual"] },
    Quantity { name: "temperature", symbol: "T", unit: "K", json: &["temperature_k", "temperature_k_error"], input: &["temperature_k"], files: &["temperature_k", "temperature_k_error"], python: &["Heat.temperature", "Heat.temperature_error"] },
    Quantity { name: "net heat flux", symbol: "q", unit: "W/m²", json: &["net_flux_w_m2", "net_flux_w_m2_error"], input: &[], files: &["net_flux_w_m2", "net_flux_w_m2_error"], python: &["Heat.net_flux", "Heat.net_flux_error"] },
    Quantity { name: "net heat", symbol: "", unit: "W", json: &["net_heat_w", "net_heat_w_error"], input: &[], files: &[], python: &[] },
    Quantity { name: "supplied heat", symbol: "", unit: "W/m²", json: &[], input: &["supplied_w_m2"], files: &["supplied_w_m2", "supplied_w_m2_error"], python: &[] },
    Quantity { name: "sunlit fraction", symbol: "", unit: "1", json: &["sunlit_fraction", "sunlit_fraction_error"], input: &[], files: &["sunlit_fraction", "sunlit_fraction_error"], python: &["Solution.sunlit"] },
    Quantity { name: "irradiance of the sun", symbol: "", unit: "W/m²", json: &["sun_irradiance", "sun_irradiance_w_m2"], input: &["--sun-irradiance"], files: &["sun_irradiance", "sun_irradiance_w_m2"], python: &[] },
    Quantity { name: "irradiance of the sky", symbol: "", unit: "W/m²", json: &["sky_irradiance"], input: &["--sky"], files: &["sky_irradiance", "sky_irradiance_w_m2"], python: &[] },
    Quantity { name: "mean radiant temperature", symbol: "", unit: "K", json: &[], input: &[], files: &["t_mrt_k"], python: &["PointViews.mean_radiant_temperature"] },
    Quantity { name: "Gebhart factor", symbol: "", unit: "1", json: &[], input: &["--exchange-factors"], files: &["G", "G_error"], python: &["ExchangeFactors.gebhart", "ExchangeFactors.gebhart_error"] },
    Quantity { name: "script-F", symbol: "", unit: "1", json: &[], input: &[], files: &["script_f"], python: &["ExchangeFactors.script_f"] },
    Quantity { name: "radiative conductance", symbol: "", unit: "m²", json: &[], input: &[], files: &["conductance_m2"], python: &["ExchangeFactors.conductance"] },
];

/// Returns the page.
pub(super) fn page() -> String {
    let mut page = "# Vocabulary\n\nThis page is generated. It names each quantity in every interface, and a test holds the names against the code. \
        [Notation](notation.md) has the symbols and equations.\n\n\
        Lengths are metres. In JSON and heat files a name ends in its unit (`_k`, `_w_m2`, `_m2`); an error ends in `_error` and has the unit of its quantity.\n\n\
        | quantity | symbol | unit | JSON | flag or TOML key | file | Python |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    for own in QUANTITIES {
        let codes = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            names.join(", ")
        };
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} | {} |",
            own.name,
            own.symbol,
            own.unit,
            codes(own.json),
            codes(own.input),
            codes(own.files),
            codes(own.python)
        );
    }
    page
}

/// Returns the text of all files below a directory whose names have an ending.
fn texts(directory: &Path, ending: &str) -> String {
    let mut all = String::new();
    for entry in std::fs::read_dir(in_repository(directory)).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all += &texts(&path, ending);
        } else if path.extension().is_some_and(|suffix| suffix == ending) {
            all += &std::fs::read_to_string(&path).unwrap();
        }
    }
    all
}

/// Returns whether a class of the Python package has a property or a field.
fn has_attribute(package: &str, attribute: &str) -> bool {
    let (class, name) = attribute.split_once('.').unwrap();
    let starts = ["(", ":"].map(|end| format!("\nclass {class}{end}"));
    let body = starts.iter().find_map(|start| package.split_once(start.as_str()));
    let own = body.map_or("", |(_, rest)| rest.split("\nclass ").next().unwrap_or_default());
    own.contains(&format!("\n    def {name}(self) ->")) || own.contains(&format!("\n    {name}: "))
}

#[test]
fn every_name_is_where_the_page_says() {
    let keys: Vec<&String> = SCHEMA["$defs"]
        .as_object()
        .unwrap()
        .values()
        .filter_map(|own| own["properties"].as_object())
        .flat_map(serde_json::Map::keys)
        .collect();
    let mut program = cli::command();
    program.build();
    let flags: Vec<String> = program
        .get_subcommands()
        .flat_map(Command::get_arguments)
        .filter_map(|argument| argument.get_long().map(|name| format!("--{name}")))
        .collect();
    let (notation, materials) = (read("docs/notation.md"), read("docs/materials.md"));
    let (source, package) = (
        texts(Path::new("src"), "rs"),
        texts(Path::new("python/radiosity"), "py"),
    );
    for own in QUANTITIES {
        let name = own.name;
        assert!(
            own.symbol.is_empty() || notation.contains(&format!("\n| {} | ", own.symbol)),
            "{name}"
        );
        for key in own.json {
            assert!(keys.iter().any(|known| known == key), "{name}: no document has `{key}`");
        }
        for input in own.input {
            let is_known = if input.starts_with("--") {
                flags.iter().any(|flag| flag == input)
            } else {
                materials.contains(&format!("`{input}`")) || materials.contains(&format!("\n{input} = "))
            };
            assert!(is_known, "{name}: nothing reads `{input}`");
        }
        for array in own.files {
            assert!(
                source.contains(&format!("\"{array}\"")),
                "{name}: nothing writes `{array}`"
            );
        }
        for attribute in own.python {
            assert!(
                has_attribute(&package, attribute),
                "{name}: Python has no `{attribute}`"
            );
        }
    }
    assert!(!has_attribute(&package, "Heat.reflectance") && has_attribute(&package, "Heat.net_flux"));
}

#[test]
fn no_page_gives_a_quantity_another_unit() {
    // A unit in a name: `_w_m2` is W/m², `_k` K.
    for own in QUANTITIES {
        for name in own.json.iter().chain(own.input).chain(own.files) {
            let base = name.trim_end_matches("_error");
            let units = [("_w_m2", "W/m²"), ("_m2", "m²"), ("_k", "K"), ("_w", "W")];
            let of_name = units.iter().find(|(ending, _)| base.ends_with(ending));
            assert!(
                of_name.is_none_or(|(_, unit)| *unit == own.unit),
                "{}: {name}",
                own.name
            );
        }
    }
}

/// Prints where each quantity is named.
#[test]
#[ignore = "a list for people"]
#[expect(clippy::print_stdout, reason = "the list")]
fn list_vocabulary() {
    let mut program = cli::command();
    program.build();
    let help: String = program
        .get_subcommands_mut()
        .map(|command| command.render_long_help().to_string())
        .collect();
    let source = texts(Path::new("src"), "rs");
    let schema = SCHEMA.to_string();
    for own in QUANTITIES {
        println!("{}, {}", own.name, own.unit);
        let documents = pages()
            .into_iter()
            .map(|path| (path.display().to_string(), read(&path)));
        let others = [("--help", &help), ("schema", &schema), ("src", &source)];
        let others = others.map(|(place, text)| (place.to_owned(), text.clone()));
        for (place, text) in documents.chain(others) {
            let n = text.to_lowercase().matches(&own.name.to_lowercase()).count();
            if n > 0 {
                println!("    {place}: {n}");
            }
        }
    }
}
