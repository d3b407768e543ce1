//! Light that leaks through patches that are not cut at contact edges.

use serde::{Deserialize, Serialize};

use super::{Context, Model, Warning};
use crate::matrix::operator::Block;
use crate::mesh::ContactEdges;
use crate::visibility::leaks::{Leakage, LightLeaks};

/// The light leaks found so far.
#[derive(Clone, Debug, Default)]
pub struct Leaks {
    /// Those of the current patches, if contact edges cross some.
    found: Option<LightLeaks>,
    /// The worst leak so far.
    pub worst: Option<Leak>,
    /// True if more leaks than results may have.
    pub are_too_great: bool,
}

/// The leak through the patches of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Leak {
    /// The patches that contact edges cross.
    pub n_patches: usize,
    /// The leak.
    #[serde(flatten)]
    pub amount: Amount,
    /// The part of what is emitted, or of the area of all patches, that it is.
    pub relative: f64,
}

/// An amount that leaks, with its error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Amount {
    /// A power, W.
    Power {
        /// The power.
        power_w: f64,
        /// Its error.
        power_error_w: f64,
    },
    /// An exchange area, m².
    ExchangeArea {
        /// The area.
        exchange_area_m2: f64,
        /// Its error.
        exchange_area_error_m2: f64,
    },
}

impl Leaks {
    /// Records a leak.
    pub(super) fn add(&mut self, leak: Option<Leak>, is_too_great: bool) {
        self.are_too_great |= is_too_great;
        if let Some(own) = leak
            && self.worst.is_none_or(|worst| own.relative > worst.relative)
        {
            self.worst = leak;
        }
    }
}

impl Context {
    /// Finds the light leaks of a mesh that is not cut.
    pub(super) fn find_leaks(&mut self, model: &Model) {
        self.leaks.found = None;
        if model.options.cut_at_walls {
            return;
        }
        let Model {
            scene,
            mesh,
            visibility,
            ..
        } = model;
        self.leaks.found = self.time("light_leaks", || {
            let crossed = ContactEdges::of(scene).crossed_patches(mesh);
            (!crossed.is_empty()).then(|| LightLeaks::find(mesh, &crossed, visibility))
        });
    }

    /// Warns of the power that leaks, if any does. `reflectance`, `exitance`, `radiosity`: ρ, E and B, \[n, c\].
    pub fn judge_leaking_power(&mut self, (reflectance, exitance): (&Block, &Block), radiosity: &Block) {
        if let Some(leaks) = &self.leaks.found {
            let leak = leaks.power(reflectance, exitance, radiosity);
            let amount = Amount::Power {
                power_w: leak.value,
                power_error_w: leak.error,
            };
            self.judge_leak(leak, amount, "W", "of what is emitted");
        }
    }

    /// Warns of the exchange area that leaks, if any does.
    pub fn judge_leaking_exchange(&mut self) {
        if let Some(leaks) = &self.leaks.found {
            let leak = leaks.exchange_area();
            let amount = Amount::ExchangeArea {
                exchange_area_m2: leak.value,
                exchange_area_error_m2: leak.error,
            };
            self.judge_leak(leak, amount, "m2", "of the area of all patches");
        }
    }

    fn judge_leak(&mut self, leak: Leakage, amount: Amount, unit: &'static str, whole: &'static str) {
        let n_patches = self.leaks.found.as_ref().map_or(0, LightLeaks::n_patches);
        let own = Leak {
            n_patches,
            amount,
            relative: leak.relative,
        };
        self.leaks.add(Some(own), leak.is_too_great());
        if leak.value > 0.0 {
            self.warn(Warning::LightLeak {
                n_patches,
                value: leak.value,
                error: leak.error,
                unit: unit.into(),
                relative: leak.relative,
                whole: whole.into(),
                is_from_file: self.settings.form_factors.is_some(),
            });
        }
    }
}
