//! Reads the file of boundary conditions: entries, patterns, and the values that they give each surface.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DVec3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;

use super::boundary::{Boundary, Condition, Node, OutOfRange, PatchValues, Sky, Sun, SurfaceBoundary, SurfaceLines};
use super::boundary::{expect_heat, expect_temperature};
use crate::printable::quoted;
use crate::scene::table::{Content, Table, three};
use crate::scene::toml_file::{TomlFile, first_names, fits};
use crate::scene::{Scene, SceneError};

/// Returns a name formatted for messages.
fn ticked(name: &str) -> String {
    format!("`{}`", quoted(name))
}

/// The possible conditions of an entry, for messages.
const CONDITIONS: &str = "`temperature_k`, `supplied_w_m2`, `adiabatic = true`, `node` or `other_side`";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoundaryFile {
    surroundings: Option<Table<SurroundingsInFile>>,
    sun: Option<Table<SunInFile>>,
    sky: Option<Table<SkyInFile>>,
    #[serde(default)]
    surface: Vec<Spanned<Table<Entry>>>,
    #[serde(default)]
    node: Vec<Spanned<Table<NodeInFile>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SurroundingsInFile {
    temperature_k: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SunInFile {
    direction: Spanned<Vector>,
    irradiance_w_m2: Spanned<f64>,
    angular_radius_deg: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(transparent)]
struct Vector(#[serde(deserialize_with = "three")] [f64; 3]);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SkyInFile {
    irradiance_w_m2: Spanned<f64>,
    up: Option<Spanned<Vector>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Spanned<String>,
    emissivity: Option<Spanned<Amount>>,
    absorptance: Option<Spanned<Amount>>,
    temperature_k: Option<Spanned<Amount>>,
    supplied_w_m2: Option<Spanned<Amount>>,
    adiabatic: Option<Spanned<bool>>,
    node: Option<Spanned<String>>,
    other_side: Option<Spanned<String>>,
}

/// A number of a surface, or one for each patch.
#[derive(Clone, Deserialize)]
#[serde(untagged, expecting = "expected a number, or a list of one for each patch")]
enum Amount {
    All(f64),
    Each(#[serde(deserialize_with = "not_empty")] Vec<f64>),
}

/// Reads a list of one number or more.
fn not_empty<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::deserialize(deserializer)?;
    if values.is_empty() {
        return Err(D::Error::invalid_length(0, &"one number or more"));
    }
    Ok(values)
}

impl Amount {
    /// Returns the number, or the first of several.
    fn first(&self) -> f64 {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values.first().copied().unwrap_or(f64::NAN),
        }
    }

    /// Returns the numbers of single patches, or none.
    fn each(self) -> Vec<f64> {
        match self {
            Self::All(_) => Vec::new(),
            Self::Each(values) => values,
        }
    }

    fn values(&self) -> &[f64] {
        match self {
            Self::All(value) => std::slice::from_ref(value),
            Self::Each(values) => values,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NodeInFile {
    name: String,
    supplied_w: Option<Spanned<f64>>,
}

impl Content for SurroundingsInFile {
    const EXPECTED: &'static str = "a table, as in [surroundings] with temperature_k = 3.0";
}

impl Content for SunInFile {
    const EXPECTED: &'static str = "a table with `direction` and `irradiance_w_m2`, as in [sun]";
}

impl Content for SkyInFile {
    const EXPECTED: &'static str = "a table with `irradiance_w_m2`, as in [sky]";
}

impl Content for Entry {
    const EXPECTED: &'static str = "a table with a `name`, as in [[surface]]";
}

impl Content for NodeInFile {
    const EXPECTED: &'static str = "a table with a `name`, as in [[node]]";
}

/// A condition of an entry, and its byte position.
#[derive(Clone)]
struct Given {
    condition: GivenCondition,
    start: usize,
}

#[derive(Clone)]
enum GivenCondition {
    Temperature(Amount),
    Supplied(Amount),
    Node(String),
    OtherSide(String),
}

impl Entry {
    /// Returns the condition of the entry, if it has one.
    fn condition(&self) -> Result<Option<Given>, (usize, String)> {
        let numbers = [
            (&self.temperature_k, GivenCondition::Temperature as fn(Amount) -> _),
            (&self.supplied_w_m2, GivenCondition::Supplied),
        ];
        let names = [
            (&self.node, GivenCondition::Node as fn(String) -> _),
            (&self.other_side, GivenCondition::OtherSide),
        ];
        let mut found = Vec::new();
        for (value, condition) in numbers {
            found.extend(value.as_ref().map(|value| Given {
                condition: condition(value.get_ref().clone()),
                start: value.span().start,
            }));
        }
        for (name, condition) in names {
            found.extend(name.as_ref().map(|name| Given {
                condition: condition(name.get_ref().clone()),
                start: name.span().start,
            }));
        }
        if let Some(adiabatic) = &self.adiabatic {
            let start = adiabatic.span().start;
            if !adiabatic.get_ref() {
                let message = format!("`adiabatic = false` is no condition; give {CONDITIONS}");
                return Err((start, message));
            }
            found.push(Given {
                condition: GivenCondition::Supplied(Amount::All(0.0)),
                start,
            });
        }
        if found.len() > 1 {
            let message = format!(
                "surface {} has {} conditions in one entry; keep one of {CONDITIONS}",
                ticked(self.name.get_ref()),
                found.len()
            );
            return Err((self.name.span().start, message));
        }
        Ok(found.pop())
    }
}

/// The last value of a key that entries set for a surface: one of an entry with the exact name takes precedence over one of a pattern.
#[derive(Clone)]
struct Latest<T> {
    exact: Option<T>,
    pattern: Option<T>,
}

impl<T> Latest<T> {
    const NONE: Self = Self {
        exact: None,
        pattern: None,
    };

    fn set(&mut self, is_exact: bool, value: Option<T>) {
        if value.is_some() {
            *(if is_exact { &mut self.exact } else { &mut self.pattern }) = value;
        }
    }

    fn get(self) -> Option<T> {
        self.exact.or(self.pattern)
    }
}

/// The entries about one surface.
#[derive(Clone)]
struct Collected {
    emissivity: Latest<(Amount, usize)>,
    absorptance: Latest<(Amount, usize)>,
    condition: Latest<Given>,
    /// The start of the last entry that matches.
    start: Option<usize>,
}

impl BoundaryFile {
    /// Returns the boundary condition of each surface of a scene.
    pub(super) fn resolved(self, path: &Path, file: &TomlFile, scene: &Scene) -> Result<Boundary, SceneError> {
        let out_of_range = |start: usize, what: &str, (key, wrong): OutOfRange| {
            let joint = if what.is_empty() { "" } else { "." };
            file.bad(start, format!("{what}{joint}{key}: {wrong}"))
        };
        let surroundings_k = match &self.surroundings {
            Some(Table(given)) => {
                let value = &given.temperature_k;
                let start = value.span().start;
                expect_temperature(*value.get_ref()).map_err(|wrong| out_of_range(start, "surroundings", wrong))?;
                *value.get_ref()
            }
            None => 0.0,
        };
        let sun = self.sun.as_ref().map(|Table(sun)| {
            let radius = sun.angular_radius_deg.as_ref();
            let direction = DVec3::from_array(sun.direction.get_ref().0);
            let made = Sun::new(
                direction,
                *sun.irradiance_w_m2.get_ref(),
                radius.map_or(0.0, |x| *x.get_ref()),
            );
            made.map_err(|wrong| {
                let span = match wrong.0 {
                    "direction" => sun.direction.span(),
                    "irradiance_w_m2" => sun.irradiance_w_m2.span(),
                    _ => radius.map_or(0..0, Spanned::span),
                };
                out_of_range(span.start, "sun", wrong)
            })
        });
        let sky = self.sky.as_ref().map(|Table(sky)| {
            let up = sky.up.as_ref();
            let direction = up.map_or(DVec3::Z, |up| DVec3::from_array(up.get_ref().0));
            Sky::new(*sky.irradiance_w_m2.get_ref(), direction).map_err(|wrong| {
                let irradiance = sky.irradiance_w_m2.span();
                let span = up.filter(|_| wrong.0 == "up").map_or(irradiance, Spanned::span);
                out_of_range(span.start, "sky", wrong)
            })
        });
        let (sun, sky) = (sun.transpose()?, sky.transpose()?);
        let nodes = nodes(&self.node, file)?;
        if self.surface.is_empty() {
            let wrong =
                "no `surface` entry; add one with name = \"*\", an `emissivity` and a condition, as `adiabatic = true`";
            return Err(file.bad(None, wrong.to_owned()));
        }
        let collected = collected(&self.surface, file, scene)?;
        let surfaces = conditions(collected, &nodes, file, scene)?;
        both_sides(&surfaces, file, scene)?;
        let used: BTreeSet<usize> = surfaces
            .iter()
            .flatten()
            .filter_map(|own| match own.surface.condition {
                Condition::Node(node) => Some(node),
                _ => None,
            })
            .collect();
        if let Some(unused) = (0..nodes.len()).find(|node| !used.contains(node)) {
            let message = format!(
                "node {}: no surface has it; give one the condition node = {}, or remove it",
                ticked(&nodes[unused].name),
                ticked(&nodes[unused].name)
            );
            return Err(file.bad(self.node[unused].span().start, message));
        }
        let lines = surfaces
            .iter()
            .map(|own| own.as_ref().map_or_else(SurfaceLines::default, |own| own.lines))
            .collect();
        let of_surfaces = surfaces.iter().map(|own| own.as_ref().map(|own| own.surface)).collect();
        let values = surfaces
            .into_iter()
            .map(|own| own.map_or_else(PatchValues::default, |own| own.values));
        let mut patch_values: Vec<PatchValues> = values.collect();
        if patch_values.iter().all(|own| *own == PatchValues::default()) {
            patch_values.clear();
        }
        Ok(Boundary {
            file: path.to_owned(),
            surroundings_k,
            sun,
            sky,
            surfaces: of_surfaces,
            patch_values,
            nodes,
            lines,
        })
    }
}

fn nodes(given: &[Spanned<Table<NodeInFile>>], file: &TomlFile) -> Result<Vec<Node>, SceneError> {
    let mut nodes: Vec<Node> = Vec::new();
    for spanned in given {
        let Table(node) = spanned.get_ref();
        let start = spanned.span().start;
        if nodes.iter().any(|other| other.name == node.name) {
            let message = format!("two nodes are called {}; rename one", ticked(&node.name));
            return Err(file.bad(start, message));
        }
        let supplied_w = node.supplied_w.as_ref().map_or(0.0, |x| *x.get_ref());
        expect_heat("supplied_w", supplied_w).map_err(|(key, wrong)| {
            let start = node.supplied_w.as_ref().map_or(start, |x| x.span().start);
            file.bad(start, format!("node.{key}: {wrong}"))
        })?;
        nodes.push(Node {
            name: node.name.clone(),
            supplied_w,
        });
    }
    Ok(nodes)
}

/// Collects the values that the entries set for each surface.
fn collected(entries: &[Spanned<Table<Entry>>], file: &TomlFile, scene: &Scene) -> Result<Vec<Collected>, SceneError> {
    let nothing = Collected {
        emissivity: Latest::NONE,
        absorptance: Latest::NONE,
        condition: Latest::NONE,
        start: None,
    };
    let mut collected = vec![nothing; scene.surfaces.len()];
    for spanned in entries {
        let Table(entry) = spanned.get_ref();
        let name = entry.name.get_ref();
        let condition = entry.condition().map_err(|(start, message)| file.bad(start, message))?;
        let exact = scene.surfaces.iter().any(|surface| surface.name == *name);
        let mut is_any = false;
        for (own, surface) in collected.iter_mut().zip(&scene.surfaces) {
            let is_meant = if exact {
                surface.name == *name
            } else {
                fits(name, &surface.name)
            };
            if !is_meant {
                continue;
            }
            is_any = true;
            let value = |given: &Option<Spanned<Amount>>| given.as_ref().map(|x| (x.get_ref().clone(), x.span().start));
            own.emissivity.set(exact, value(&entry.emissivity));
            own.absorptance.set(exact, value(&entry.absorptance));
            own.condition.set(exact, condition.clone());
            own.start = Some(entry.name.span().start);
        }
        if !is_any {
            let message = format!(
                "{} matches no surface; the scene has {}",
                ticked(name),
                first_names(scene.surfaces.iter().map(|surface| surface.name.as_str()))
            );
            return Err(file.bad(entry.name.span().start, message));
        }
    }
    // A surface that another names as its other side gets that condition, as if by an entry with its own name; `both_sides` refuses contradictions.
    for k in 0..collected.len() {
        let Some(Given {
            condition: GivenCondition::OtherSide(name),
            start,
        }) = collected[k].condition.clone().get()
        else {
            continue;
        };
        if let Some(other) = scene.surfaces.iter().position(|surface| surface.name == name)
            && collected[other].condition.exact.is_none()
        {
            collected[other].condition.exact = Some(Given {
                condition: GivenCondition::OtherSide(scene.surfaces[k].name.clone()),
                start,
            });
        }
    }
    Ok(collected)
}

/// The boundary condition of a surface, its byte position, and values of single patches.
struct Resolved {
    surface: SurfaceBoundary,
    start: usize,
    values: PatchValues,
    lines: SurfaceLines,
}

impl GivenCondition {
    /// Returns the numbers of the condition, if it has any.
    fn amount(&self) -> Option<&Amount> {
        match self {
            Self::Temperature(amount) | Self::Supplied(amount) => Some(amount),
            Self::Node(_) | Self::OtherSide(_) => None,
        }
    }
}

/// Returns the boundary condition of each surface with faces.
fn conditions(
    collected: Vec<Collected>,
    nodes: &[Node],
    file: &TomlFile,
    scene: &Scene,
) -> Result<Vec<Option<Resolved>>, SceneError> {
    let mut has_faces = vec![false; scene.surfaces.len()];
    for face in &scene.faces {
        has_faces[face.surface.0 as usize] = true;
    }
    let of_surface = |(k, own): (usize, Collected)| {
        if !has_faces[k] {
            return Ok(None);
        }
        let name = ticked(&scene.surfaces[k].name);
        let start = own.start;
        let missing = |what: &str| {
            file.bad(
                start,
                format!("surface {name} has no {what} in an entry with its name or a pattern"),
            )
        };
        let (absorptance, condition) = (own.absorptance.get(), own.condition.get());
        let condition = condition.ok_or_else(|| missing(&format!("condition; give {CONDITIONS}")))?;
        let emissivity = own
            .emissivity
            .get()
            .ok_or_else(|| missing("`emissivity`; give one in [1e-10, 1]"))?;
        let absorptance = absorptance.unwrap_or_else(|| emissivity.clone());
        let surface = SurfaceBoundary {
            emissivity: emissivity.0.first(),
            absorptance: absorptance.0.first(),
            condition: named(&condition, nodes, file, scene)?,
        };
        let refused = |(key, wrong): OutOfRange| {
            let place = match key {
                "emissivity" => emissivity.1,
                "absorptance" => absorptance.1,
                _ => condition.start,
            };
            file.bad(place, format!("surface {name}: {key}: {wrong}"))
        };
        surface.checked().map_err(refused)?;
        let condition_values = condition.condition.amount();
        for &value in emissivity.0.values() {
            surface.with_emissivity(value).checked().map_err(refused)?;
        }
        for &value in absorptance.0.values() {
            surface.with_absorptance(value).checked().map_err(refused)?;
        }
        for &value in condition_values.iter().flat_map(|amount| amount.values()) {
            surface.with_condition(value).checked().map_err(refused)?;
        }
        let lines = SurfaceLines {
            emissivity: file.line(emissivity.1),
            absorptance: file.line(absorptance.1),
            condition: file.line(condition.start),
        };
        let values = PatchValues {
            condition: condition_values.cloned().map_or_else(Vec::new, Amount::each),
            emissivity: emissivity.0.each(),
            absorptance: absorptance.0.each(),
        };
        Ok(Some(Resolved {
            surface,
            start: condition.start,
            values,
            lines,
        }))
    };
    collected.into_iter().enumerate().map(of_surface).collect()
}

/// Finds the node or the surface that a condition names.
fn named(given: &Given, nodes: &[Node], file: &TomlFile, scene: &Scene) -> Result<Condition, SceneError> {
    let unknown = |key: &str, name: &str, known: String| {
        let message = format!("`{key}` {} matches nothing; there is {known}", ticked(name));
        file.bad(given.start, message)
    };
    match &given.condition {
        GivenCondition::Temperature(kelvin) => Ok(Condition::Temperature(kelvin.first())),
        GivenCondition::Supplied(flux) => Ok(Condition::Supplied(flux.first())),
        GivenCondition::Node(name) => {
            let found = nodes.iter().position(|node| node.name == *name);
            found.map(Condition::Node).ok_or_else(|| {
                let known = match nodes {
                    [] => "no [[node]]; add one".to_owned(),
                    _ => first_names(nodes.iter().map(|node| node.name.as_str())),
                };
                unknown("node", name, known)
            })
        }
        GivenCondition::OtherSide(name) => {
            let mut surfaces = scene.surfaces.iter();
            let found = surfaces.position(|surface| surface.name == *name);
            found.map(Condition::OtherSide).ok_or_else(|| {
                let known = first_names(scene.surfaces.iter().map(|surface| surface.name.as_str()));
                unknown("other_side", name, known)
            })
        }
    }
}

/// Refuses sheets whose sides do not name each other.
fn both_sides(surfaces: &[Option<Resolved>], file: &TomlFile, scene: &Scene) -> Result<(), SceneError> {
    for (k, own) in surfaces.iter().enumerate() {
        let Some(own) = own else {
            continue;
        };
        let Condition::OtherSide(other) = own.surface.condition else {
            continue;
        };
        let [own_name, other_name] = [k, other].map(|k| ticked(&scene.surfaces[k].name));
        let wrong = match surfaces[other].as_ref().map(|other| other.surface.condition) {
            _ if other == k => {
                format!("surface {own_name} is its own other side; name the surface that coincides with it")
            }
            None => format!("surface {other_name} has no face; name the surface that coincides with {own_name}"),
            Some(Condition::OtherSide(back)) if back == k => continue,
            Some(_) => format!(
                "{other_name} is the other side of {own_name} and has another condition; give it other_side = {own_name}, or none"
            ),
        };
        return Err(file.bad(own.start, wrong));
    }
    Ok(())
}
