//! What the run says of light that leaks through patches that are not cut at contact edges.

use serde_json::json;

use super::pipeline::{Prepared, Run};
use crate::matrix::operator::Block;
use crate::mesh::ContactEdges;
use crate::printable::counted;
use crate::visibility::leaks::{Leakage, LightLeaks};

impl Run {
    /// Finds the light leaks of a mesh that is not cut; form factors of points have none.
    pub(super) fn find_leaks(&mut self, prepared: &Prepared) {
        self.leaks = None;
        if prepared.options.cut_at_walls || self.command == "field" {
            return;
        }
        let Prepared {
            scene,
            mesh,
            visibility,
            ..
        } = prepared;
        self.leaks = self.times.time("light_leaks", || {
            let crossed = ContactEdges::of(scene).crossed_patches(mesh);
            (!crossed.is_empty()).then(|| LightLeaks::find(mesh, &crossed, visibility))
        });
    }

    /// Warns of the power that leaks, if any does.
    pub(super) fn judge_leaking_power(&mut self, (reflectance, exitance): (&Block, &Block), radiosity: &Block) {
        if let Some(leaks) = &self.leaks {
            let power = leaks.power(reflectance, exitance, radiosity);
            self.judge_leak(power, ["power_w", "power_error_w", "W"], "of what is emitted");
        }
    }

    /// Warns of the exchange area that leaks, if any does.
    pub(super) fn judge_leaking_exchange(&mut self) {
        if let Some(leaks) = &self.leaks {
            let area = leaks.exchange_area();
            self.judge_leak(
                area,
                ["exchange_area_m2", "exchange_area_error_m2", "m2"],
                "of the area of all patches",
            );
        }
    }

    fn judge_leak(&mut self, leak: Leakage, [name, of_error, unit]: [&str; 3], whole: &str) {
        let n_patches = self.leaks.as_ref().map_or(0, LightLeaks::n_patches);
        self.leaks_too_much |= leak.is_too_great();
        let before = self.light_leak["relative"].as_f64().unwrap_or(-1.0);
        if leak.relative > before {
            self.light_leak = json!({
                "n_patches": n_patches,
                name: leak.value,
                of_error: leak.error,
                "relative": leak.relative,
            });
        }
        if leak.value > 0.0 {
            let remedy = if self.settings.contains_key("form_factors") {
                "compute the form factors again"
            } else {
                "leave out --no-cut"
            };
            self.warn(&format!(
                "light leaks under what stands on {}: {:.2e} +- {:.1e} {unit}, {:.1e} {whole}; {remedy}",
                counted(n_patches, "patch"),
                leak.value,
                leak.error,
                leak.relative,
            ));
        }
    }
}
