//! Reads VTK's files: legacy (`.vtk`), and XML of unstructured grids (`.vtu`) and of polygons (`.vtp`).

mod dataset;
mod legacy;
mod xml;
mod xml_array;
mod xml_bytes;

use super::LoadOptions;
use super::polygons::Polygons;
use super::reader::{Head, Reader};
use super::source::Source;
use crate::scene::SceneError;

/// The format.
pub(super) struct Vtk;

impl Reader for Vtk {
    fn name(&self) -> &'static str {
        "vtk"
    }

    fn summary(&self) -> &'static str {
        "VTK legacy, VTU or VTP"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["vtk", "vtu", "vtp"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        head.begins_with("# vtk DataFile") || is_xml(head)
    }

    fn has_arrays(&self) -> bool {
        true
    }

    fn read(&self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        let dataset = if source.head().begins_with("<") {
            xml::read(source)?
        } else {
            legacy::read(source)?
        };
        dataset.polygons(source, options)
    }
}

fn is_xml(head: &Head<'_>) -> bool {
    head.begins_with("<VTKFile") || (head.begins_with("<") && head.contains("<VTKFile"))
}
