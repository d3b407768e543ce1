//! Many lightings of one scene, all in the same passes over the form factors.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::{
    Context, DirectDaylight, FormFactorStudy, Model, SolutionStudy, SolveRequest, TotalError, WorkflowError, is_grey,
};
use crate::matrix::operator::Block;
use crate::mesh::Patch;
use crate::report::{ReportError, exitance};
use crate::scene::Lighting;
use crate::solver::{Coarsened, Solution};

/// Many lightings side by side, as channels of one system.
#[derive(Clone, Debug)]
pub struct Stack {
    channels: Vec<Range<usize>>,
    /// ρ of each patch, \[n, c\].
    pub reflectance: Block,
    /// E of each patch, or E + ρ D in daylight, W·m⁻², \[n, c\].
    pub exitance: Block,
    /// The daylight of each lighting; empty without daylight.
    daylight: Vec<InDaylight>,
}

/// A lighting in daylight.
#[derive(Clone, Debug)]
pub(super) struct InDaylight {
    /// E, W·m⁻², \[n, c\].
    pub(super) emitted: Block,
    /// The error of E + ρ D, W·m⁻², \[n, c\].
    pub(super) error: Block,
    /// The direct light D.
    pub(super) direct: DirectDaylight,
}

impl Stack {
    /// Returns lightings side by side; `None` stands for the lighting of the scene itself.
    ///
    /// With `has_colours` each has three channels, even if it is grey.
    #[must_use]
    pub fn new(model: &Model, lightings: &[Option<Lighting>], has_colours: bool) -> Self {
        let scene = &model.scene;
        let plain = |patch: &Patch| {
            let material = &scene.materials[patch.material.0 as usize];
            (material.reflectance, material.exitance)
        };
        let mut materials = Vec::new();
        let mut channels: Vec<Range<usize>> = Vec::new();
        let mut n_channels = 0;
        for lighting in lightings {
            let of_patch = |patch: &Patch| match lighting {
                Some(lighting) => lighting.of(scene, patch.surface, patch.material),
                None => plain(patch),
            };
            let of_patches: Vec<_> = model.mesh.patches.iter().map(of_patch).collect();
            // A lighting that is grey everywhere takes a third of the time in one channel.
            let grey = !has_colours && of_patches.iter().all(|(rho, e)| is_grey(*rho) && is_grey(*e));
            let own = n_channels..n_channels + if grey { 1 } else { 3 };
            n_channels = own.end;
            channels.push(own);
            materials.push(of_patches);
        }
        let mut reflectance = Block::zeros(model.mesh.n_patches(), n_channels);
        let mut exitance = reflectance.clone();
        for (own, of_patches) in channels.iter().zip(&materials) {
            for (i, (rho, e)) in of_patches.iter().enumerate() {
                reflectance.row_mut(i)[own.clone()].copy_from_slice(&rho[..own.len()]);
                exitance.row_mut(i)[own.clone()].copy_from_slice(&e[..own.len()]);
            }
        }
        Self {
            channels,
            reflectance,
            exitance,
            daylight: Vec::new(),
        }
    }

    /// Adds the direct light of sun and sky, in three channels, to all lightings.
    pub(super) fn shine(&mut self, direct: &DirectDaylight) {
        for k in 0..self.channels.len() {
            let own = self.channels[k].clone();
            let direct = direct.of_channels(own.len());
            let (reflectance, emitted) = self.materials(k);
            let (lit, error) = direct.lit(&reflectance, &emitted);
            for i in 0..lit.n_rows() {
                self.exitance.row_mut(i)[own.clone()].copy_from_slice(lit.row(i));
            }
            self.daylight.push(InDaylight { emitted, error, direct });
        }
    }

    /// Returns lighting `k` in daylight; `None` without daylight.
    pub(super) fn in_daylight(&self, k: usize) -> Option<&InDaylight> {
        self.daylight.get(k)
    }

    /// Returns ρ and E of lighting `k`.
    #[must_use]
    pub fn materials(&self, k: usize) -> (Block, Block) {
        let own = |block: &Block| block.channels(self.channels[k].clone());
        (own(&self.reflectance), own(&self.exitance))
    }

    /// Returns the part of the coarser mesh of all lightings that belongs to lighting `k`.
    #[must_use]
    pub fn coarsened(&self, k: usize, all: &Coarsened) -> Coarsened {
        all.of_channels(self.channels[k].clone())
    }

    /// Sets the number of channels of the plan, and the file of each channel for later messages.
    pub fn announce(&self, model: &mut Model, files: &[Option<PathBuf>], cx: &mut Context) {
        model.plan.revise_channels(self.reflectance.n_channels());
        let of_each = self.channels.iter().zip(files);
        let repeated = of_each.flat_map(|(own, file)| own.clone().map(|_| file.clone()));
        cx.lighting_files = repeated.collect();
    }

    /// Returns the part of the solution of all lightings that belongs to lighting `k`; the figures of the passes are those of all together.
    #[must_use]
    pub fn solution(&self, k: usize, all: &Solution) -> Solution {
        all.of_channels(self.channels[k].clone())
    }
}

/// The light of one lighting among several.
#[derive(Debug)]
pub struct LightingStudy {
    /// Its number.
    pub number: usize,
    /// ρ of each patch, \[n, c\].
    pub reflectance: Block,
    /// E of each patch, W·m⁻², \[n, c\].
    pub exitance: Block,
    /// The solution, with its errors.
    pub study: SolutionStudy,
}

impl Model {
    /// Returns ρ of the scene and E of a file for each channel of its lightings, \[n, c\] each; see [`exitance::read`].
    ///
    /// # Errors
    /// [`WorkflowError::Report`], also if a scene with colours meets grey lightings.
    pub fn materials_of(&self, exitances: &Path) -> Result<(Block, Block), WorkflowError> {
        let found = exitance::read(exitances, self.mesh.n_patches())?;
        let (reflectance, _) = self.materials();
        let reflectance = found.reflectances(&reflectance).ok_or_else(|| ReportError::BadArray {
            path: exitances.to_owned(),
            reason: format!(
                "grey lightings for a scene with colours; give an array of shape ({}, k, 3)",
                self.mesh.n_patches()
            ),
        })?;
        Ok((reflectance, found.values))
    }

    /// Solves for lightings, each of a file, all together; `each` receives their light one by one.
    ///
    /// Returns the solution of all, and the worst error of a lighting by solver and form factors.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system), and those of `each`.
    pub fn solve_lightings(
        &mut self,
        factors: &FormFactorStudy,
        (lightings, files): (&[Option<Lighting>], &[Option<PathBuf>]),
        request: &SolveRequest,
        cx: &mut Context,
        mut each: impl FnMut(&Self, LightingStudy, &Context) -> Result<(), WorkflowError>,
    ) -> Result<(Solution, TotalError), WorkflowError> {
        let stack = Stack::new(self, lightings, false);
        stack.announce(self, files, cx);
        let materials = (&stack.reflectance, &stack.exitance);
        let solution = self.solve_system(&factors.factors, request, materials, factors.known(), cx)?;
        let coarse = self.coarsened(factors, &factors.factors, &stack.reflectance, &solution, cx)?;
        let mut worst = TotalError::Relative(0.0);
        for number in 0..lightings.len() {
            let (reflectance, exitance) = stack.materials(number);
            let own = stack.solution(number, &solution);
            let carried = factors.carried_error((&reflectance, &exitance), None, &own, cx)?;
            let coarse = coarse.as_ref().map(|coarse| stack.coarsened(number, coarse));
            let study = self.with_errors((&exitance, own), carried, coarse.as_ref(), cx);
            worst = worst.or_worse(study.error);
            let lit = LightingStudy {
                number,
                reflectance,
                exitance,
                study,
            };
            each(self, lit, cx)?;
        }
        Ok((solution, worst))
    }
}
