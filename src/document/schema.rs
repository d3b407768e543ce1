//! The JSON Schema of all documents, which `docs/schema.json` has to be.

use std::path::Path;

use schemars::generate::{SchemaGenerator, SchemaSettings};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value, json};

use super::{
    Document, FailureDocument, FieldDocument, FormFactorsDocument, FramesDocument, HeatDocument, LightingsDocument,
    OfScene, PathDocument, PointsDocument, RenderDocument, SceneDocument, SolveDocument, VerifyDocument, VoxelDocument,
};
use crate::experiment::baranoski::BaranoskiDocument;
use crate::experiment::compare::CompareDocument;
use crate::experiment::crater::CraterResults;
use crate::experiment::findings::{PaperDocument, Reproduced};
use crate::experiment::lewis::{LevelTimes, LewisResults};
use crate::experiment::malgouyres::{MalgouyresResults, SceneTimes};
use crate::experiment::pictures::{PictureTimes, PicturesResults};
use crate::experiment::stability::StabilityDocument;
use crate::report::SCHEMA_VERSION;
use crate::workflow::{HeatStep, LightStep};

/// Returns the JSON Schema (draft 2020-12) of the documents that the program prints with `--json`.
///
/// A document is valid if it is valid against one of the schemas at `oneOf`. Each of these is a definition named after its command; the name of a second kind of a command adds the flag that produces
/// it.
fn schema() -> Value {
    let mut all = Documents::new();
    all.add::<SceneDocument>("scene", "scene");
    all.add::<OfModel<FormFactorsDocument<'_>>>("form-factors", "form-factors");
    all.add::<OfModel<SolveDocument>>("solve", "solve");
    all.add::<OfModel<LightingsDocument>>("solve-lightings", "solve");
    all.add::<OfModel<PathDocument<LightStep>>>("solve-sun-path", "solve");
    all.add::<OfModel<HeatDocument>>("heat", "heat");
    all.add::<OfModel<PathDocument<HeatStep>>>("heat-sun-path", "heat");
    all.add::<OfModel<PointsDocument>>("points", "points");
    all.add::<OfModel<RenderDocument>>("render", "render");
    all.add::<OfModel<FramesDocument>>("render-frames", "render");
    all.add::<OfModel<FieldDocument>>("field", "field");
    all.add::<OfModel<VoxelDocument>>("voxel", "voxel");
    all.add::<VerifyDocument>("verify", "verify");
    all.add::<OfModel<CompareDocument<'_>>>("compare", "compare");
    all.add::<OfPaper<BaranoskiDocument<'_>>>("reproduce-baranoski", "reproduce");
    all.add::<OfPaper<StabilityDocument<'_>>>("reproduce-stability", "reproduce");
    all.add::<OfPaper<PaperDocument<'_, LewisResults, Vec<LevelTimes>>>>("reproduce-lewis", "reproduce");
    all.add::<OfPaper<PaperDocument<'_, MalgouyresResults, Vec<SceneTimes>>>>("reproduce-malgouyres", "reproduce");
    all.add::<OfPaper<PaperDocument<'_, PicturesResults, PictureTimes>>>("reproduce-pictures", "reproduce");
    all.add::<OfPaper<PaperDocument<'_, CraterResults, Vec<f64>>>>("reproduce-crater", "reproduce");
    all.add::<FailureDocument>("failure", "");
    all.finish()
}

type OfModel<T> = Document<'static, OfScene<'static, T>>;
type OfPaper<T> = Document<'static, Reproduced<T>>;

/// Schemas that are being combined.
struct Documents {
    generator: SchemaGenerator,
    /// The schemas by name.
    schemas: Vec<(&'static str, Schema)>,
}

impl Documents {
    fn new() -> Self {
        Self {
            generator: SchemaSettings::draft2020_12().for_serialize().into_generator(),
            schemas: Vec::new(),
        }
    }

    /// Adds the documents of a command, or of none.
    fn add<T: JsonSchema>(&mut self, name: &'static str, command: &str) {
        let mut schema = T::json_schema(&mut self.generator);
        if !command.is_empty() {
            let description = format!("What `radiosity {command}` prints with --json.");
            schema.insert("description".into(), description.into());
        }
        if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
            properties["schema_version"] = json!({"const": SCHEMA_VERSION});
            if !command.is_empty() {
                properties["command"] = json!({"const": command});
            }
        }
        self.schemas.push((name, schema));
    }

    fn finish(mut self) -> Value {
        let mut definitions = self.generator.take_definitions(true);
        let mut one_of = Vec::new();
        for (name, schema) in self.schemas {
            one_of.push(json!({"$ref": format!("#/$defs/{name}")}));
            definitions.insert(name.to_owned(), schema.to_value());
        }
        let mut all = Map::new();
        all.insert("$schema".into(), "https://json-schema.org/draft/2020-12/schema".into());
        all.insert("title".into(), "What radiosity prints with --json".into());
        all.insert("oneOf".into(), one_of.into());
        all.insert("$defs".into(), Value::Object(definitions));
        all.into()
    }
}

#[test]
fn the_committed_schema_is_the_generated_one() {
    let committed: Value = serde_json::from_str(include_str!("../../docs/schema.json")).expect("JSON");
    assert!(
        committed == schema(),
        "docs/schema.json is not what the code generates; write it: cargo test --release --lib -- --ignored write_schema"
    );
}

/// Writes `docs/schema.json`, after a document has changed.
#[test]
#[ignore = "it writes a file of the repository"]
fn write_schema() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schema.json");
    std::fs::write(file, format!("{:#}\n", schema())).expect("a file of the repository");
}
