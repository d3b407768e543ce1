//! Discrete radiosity as a whole study: voxels, links within the memory limit, light, and the limits of the resolution.

use std::path::PathBuf;

use super::solve::refused;
use super::voxel_links::{self, LinkPlace};
use super::{Context, Model, Unsuited, Warning, WorkflowError, go_on};
use crate::audit::{self, Given};
use crate::form_factor::Closure;
use crate::matrix::operator::{Block, LinearOperator};
use crate::scene::SurfaceId;
use crate::solver::{
    self, RadiositySystem, Solution, SolveOptions, SolverError, SolverSettings, StopReason, Tolerance,
};
use crate::voxel::{
    AdaptiveSettings, DiscreteSphere, Form, Leak, LeakPower, LinkOperator, Links, Materials, RowWeights, SolidAngle,
    ThinGap, VoxelScene, propagate, solve_adaptively,
};

/// The share of the emitted power above which light that is lost in a closed scene is told although no link leaves it.
const TOLD_LOSS: f64 = 1e-2;

/// The relative amount of unshot light above which there is a warning.
const MAX_UNSHOT: f64 = 0.05;

/// The method that finds light on voxels.
#[derive(Clone, Debug, PartialEq)]
pub enum VoxelLight {
    /// A given number of propagations.
    Propagations {
        /// Their number.
        passes: usize,
        /// The input of each propagation.
        form: Form,
    },
    /// Propagations between cells, as fine as the light requires.
    Cells {
        /// Their number on each set of cells.
        passes: usize,
        /// [`AdaptiveSettings::tolerance`].
        tolerance: f64,
        /// [`AdaptiveSettings::coarsest`].
        coarsest: u8,
    },
    /// A solver.
    Solver {
        /// Its name.
        name: String,
        /// The tolerance on sqrt(Σ A r² / Σ A E²), the worst channel.
        tolerance: f64,
    },
}

/// The request for voxels.
#[derive(Clone, Debug)]
pub struct VoxelRequest {
    /// The number of voxels along the longest axis.
    pub n_voxels: u32,
    /// The radius of the discrete sphere of directions.
    pub radius: u32,
    /// The weights of directions.
    pub solid_angle: SolidAngle,
    /// True if the weights of a voxel's directions are divided by their sum.
    pub row_weights: RowWeights,
    /// True if every voxel of an emitter sends its exitance, not scaled to the power of the emitter's true area.
    pub plain_emission: bool,
    /// The method that finds light.
    pub light: VoxelLight,
    /// The place of links.
    pub links: LinkPlace,
    /// The file of links on disk.
    pub link_file: PathBuf,
    /// The user's statement whether the scene is closed.
    pub closure: Closure,
    /// True if voxels are written to a file.
    pub is_written: bool,
    /// True if an image of the patches follows.
    pub is_shown: bool,
}

impl VoxelRequest {
    /// The default [`n_voxels`](Self::n_voxels).
    pub const VOXELS: u32 = 100;

    /// The default [`radius`](Self::radius).
    pub const RADIUS: u32 = 20;

    /// The default number of propagations.
    pub const PASSES: usize = 10;

    /// The default level of the largest cells.
    pub const COARSEST: u8 = 3;
}

/// The report of the method that found the light.
#[derive(Debug)]
pub enum VoxelResult {
    /// Propagations, with the relative change of the radiosity in each.
    Propagations(Vec<f64>),
    /// Propagations between cells.
    Cells {
        /// The relative change of the radiosity in each propagation on the last cells.
        changes: Vec<f64>,
        /// The number of the last cells by their level.
        n_by_level: Vec<usize>,
        /// The number of cells in each round of cuts.
        n_by_round: Vec<usize>,
    },
    /// A solver; its B and H are those of the system, before emitters are scaled to their true area.
    Solver(Box<Solution>),
}

/// The number and the size of links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkFigures {
    /// The number of links.
    pub n_links: u64,
    /// The number of links that end at a back, if counted.
    pub n_backs: Option<u64>,
    /// The number of links that leave the scene, if counted.
    pub n_escaped: Option<u64>,
    /// Their size, in bytes.
    pub n_bytes: u64,
}

/// Light on voxels, with the limits of the resolution.
#[derive(Debug)]
pub struct VoxelStudy {
    /// The voxels.
    pub voxels: VoxelScene,
    /// The directions.
    pub sphere: DiscreteSphere,
    /// The links.
    pub links: LinkFigures,
    /// B of each surfel, W·m⁻², \[n, c\].
    pub radiosity: Block,
    /// H of each surfel, W·m⁻², \[n, c\].
    pub irradiance: Block,
    /// The report of the method.
    pub result: VoxelResult,
    /// Surfaces smaller than two voxels, with their size, m.
    pub small: Vec<(SurfaceId, f64)>,
    /// Gaps narrower than two voxels.
    pub gaps: Vec<ThinGap>,
    /// Surfels that are reached from outside of a closed scene.
    pub reached: Vec<u32>,
    /// Light that passes through closed surfaces.
    pub leak: Leak,
    /// The Hausdorff distance from the scene, in voxels.
    pub hausdorff: Option<f64>,
}

impl VoxelStudy {
    /// Returns whether the light is as requested: the solver converged, and little light leaks.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let is_converged = match &self.result {
            VoxelResult::Solver(solution) => solution.stop_reason == StopReason::Converged,
            VoxelResult::Propagations(_) | VoxelResult::Cells { .. } => true,
        };
        is_converged && !self.leak.is_too_much()
    }
}

/// Radiosities of all surfels, with the report of the method.
struct Lit {
    radiosity: Block,
    irradiance: Block,
    result: VoxelResult,
    /// The power of light that goes where none does.
    leak_power: LeakPower,
}

impl Model {
    /// Divides the scene into voxels, finds their links and their light, and warns of parts that they do not resolve.
    ///
    /// # Errors
    /// [`WorkflowError::Voxel`], [`WorkflowError::VoxelMemory`], [`WorkflowError::NotClosed`], those of [`solve_system`](Self::solve_system), and [`WorkflowError::Interrupted`].
    pub fn solve_on_voxels(&mut self, request: &VoxelRequest, cx: &mut Context) -> Result<VoxelStudy, WorkflowError> {
        self.state_closure(request.closure, cx)?;
        voxel_links::expect_voxels(self, request, cx)?;
        let mut voxels = cx.time("discretise", || VoxelScene::new(&self.scene, request.n_voxels))?;
        if self.plan.watertight {
            voxels.expect_closed();
        }
        let sphere = DiscreteSphere::new(request.radius, request.solid_angle)?;
        let place = voxel_links::choose(self, &voxels, &sphere, request, cx)?;
        request.note_settings(cx);
        let small = cx.time("checks", || voxels.small_surfaces(&self.scene));
        self.warn_of_small_surfaces(&small, &voxels, cx);
        let gaps = cx.time("checks", || voxels.thin_gaps(&self.scene));
        self.warn_of_gaps(&gaps, request.n_voxels, cx);
        let reached = if self.plan.watertight {
            cx.time("checks", || voxels.reached_from_outside())
        } else {
            let nothing = "search for leaks: the scene's faces do not close a space";
            self.plan.left_out.push(nothing.into());
            Vec::new()
        };
        self.warn_of_leaks(&voxels, &reached, cx);
        let hausdorff = cx.time("checks", || voxels.hausdorff_distance(&self.scene));
        let materials = Materials::new(&self.scene, &voxels, self.plan.n_channels);
        let emission = if request.plain_emission {
            &materials.exitance
        } else {
            &materials.emission
        };
        let (of_scene, of_surfels) = ((&voxels, &sphere), (&materials, emission));
        let (lit, links) = match &request.light {
            &VoxelLight::Cells {
                passes,
                tolerance,
                coarsest,
            } => {
                let settings = AdaptiveSettings {
                    coarsest,
                    tolerance,
                    n_passes: passes,
                    row_weights: request.row_weights,
                };
                self.light_on_cells(of_scene, of_surfels, &settings, cx)?
            }
            &VoxelLight::Propagations { passes, form } => {
                on_links(of_scene, place, request, cx, |operator, context| {
                    light_by_propagations(operator, of_surfels, (passes, form), context)
                })?
            }
            VoxelLight::Solver { name, tolerance } => {
                let is_costly = place == LinkPlace::Recompute;
                on_links(of_scene, place, request, cx, |operator, context| {
                    self.light_by_solver(operator, of_surfels, (name, *tolerance), is_costly, context)
                })?
            }
        };
        cx.audited(audit::sides(&lit.leak_power.passed));
        let leak = Leak::new(&lit.leak_power, &voxels, &materials.exitance);
        let n_escaped = links.n_escaped.unwrap_or(0);
        if self.plan.watertight && (n_escaped > 0 || leak.lost_share > TOLD_LOSS) {
            cx.warn(Warning::EscapingLinks {
                n_escaped,
                n_links: links.n_links,
                power: leak.lost_power,
                share: leak.lost_share,
            });
        }
        warn_of_leak(&voxels, &leak, cx);
        Ok(VoxelStudy {
            voxels,
            sphere,
            links,
            radiosity: lit.radiosity,
            irradiance: lit.irradiance,
            result: lit.result,
            small,
            gaps,
            reached,
            leak,
            hausdorff,
        })
    }

    /// Finds light with one unknown for each cell, with cells as fine as the light requires.
    fn light_on_cells(
        &self,
        (voxels, sphere): (&VoxelScene, &DiscreteSphere),
        (materials, emission): (&Materials, &Block),
        settings: &AdaptiveSettings,
        cx: &mut Context,
    ) -> Result<(Lit, LinkFigures), WorkflowError> {
        cx.settings.adaptive = Some(settings.tolerance);
        cx.settings.coarsest = Some(settings.coarsest);
        cx.settings.passes = Some(settings.n_passes as u64);
        let rho = &materials.reflectance;
        let result = {
            let watch = cx.progress();
            cx.time("cells", || {
                solve_adaptively(&self.scene, voxels, sphere, rho, emission, settings, &watch)
            })
        };
        cx.go_on()?;
        // The light of surfels is spread over cells and back, so their rows sum to at most 1.
        let row_sums = vec![1.0; voxels.n_surfels()];
        if settings.row_weights == RowWeights::Normalised {
            let (b, h) = (&result.radiosity, &result.irradiance);
            cx.audited(audit::propagation(rho, emission, &row_sums, b, h));
        }
        let figures = LinkFigures {
            n_links: result.n_links,
            n_backs: Some(result.n_backs),
            n_escaped: Some(result.n_escaped),
            n_bytes: result.link_byte,
        };
        let lit = Lit {
            radiosity: materials.radiosity(&result.irradiance),
            irradiance: result.irradiance,
            leak_power: result.leak_power,
            result: VoxelResult::Cells {
                changes: result.changes,
                n_by_level: result.cells.n_by_level(),
                n_by_round: result.n_cells,
            },
        };
        Ok((lit, figures))
    }

    fn light_by_solver(
        &mut self,
        operator: &LinkOperator<'_>,
        (materials, emission): (&Materials, &Block),
        (name, tolerance): (&str, f64),
        is_costly: bool,
        cx: &mut Context,
    ) -> Result<Lit, WorkflowError> {
        cx.settings.solver = Some(name.to_owned());
        cx.settings.tolerance = Some(tolerance);
        let voxels = operator.scene();
        let rho = materials.reflectance.clone();
        let system = RadiositySystem::new(operator, voxels.areas(), rho, emission.clone())
            .map_err(|error| self.refused_of_voxels(voxels, error, cx))?;
        let options = SolveOptions {
            tolerance: Tolerance::ResidualL2(tolerance),
            ..SolveOptions::default()
        };
        let solver = solver::solver(name, &SolverSettings::default())?;
        let solved = {
            let watch = cx.progress();
            cx.time("solve", || solver.solve(&system, &options, &mut |_| go_on(&watch)))
        };
        let solution = solved.map_err(|error| self.refused_of_voxels(voxels, error, cx))?;
        cx.go_on()?;
        let given = Given {
            gain: None,
            costly: is_costly,
        };
        let found = cx.time("audit", || audit::solution(&system, &solution, given))?;
        cx.audited(found);
        if let Some(choice) = &solution.choice {
            self.plan.decide("solver", choice.solver, choice.why.to_string());
        }
        Ok(Lit {
            leak_power: operator.leak_power(&solution.radiosity),
            radiosity: materials.radiosity(&solution.irradiance),
            irradiance: solution.irradiance.clone(),
            result: VoxelResult::Solver(Box::new(solution)),
        })
    }

    /// Adds the remedy, for voxels, to the error of a system that a solver refuses.
    fn refused_of_voxels(&self, voxels: &VoxelScene, error: SolverError, cx: &Context) -> WorkflowError {
        if let SolverError::NeedsRows { .. } = error {
            return WorkflowError::Unsuited(Unsuited::RecomputedRows(error.to_string()));
        }
        let face = |surfel: usize| voxels.surfels.get(surfel).map(|surfel| surfel.face.0 as usize);
        let surface = |surfel| Some(self.scene.faces.get(face(surfel)?)?.surface);
        refused((&self.scene, &self.file), error, surface, cx)
    }

    fn name(&self, id: SurfaceId) -> String {
        self.scene.surfaces[id.0 as usize].name.clone()
    }

    fn warn_of_small_surfaces(&self, small: &[(SurfaceId, f64)], voxels: &VoxelScene, cx: &Context) {
        if let Some(&(surface, side)) = small.first() {
            let size = voxels.grid.voxel_size;
            let [x, y, z] = voxels.grid.n_voxels;
            cx.warn(Warning::SmallSurfaces {
                count: small.len(),
                surface: self.name(surface),
                side,
                size,
                enough: (2.0 * size / side * f64::from(x.max(y).max(z))).ceil(),
            });
        }
    }

    fn warn_of_gaps(&self, gaps: &[ThinGap], n_voxels: u32, cx: &Context) {
        if !gaps.is_empty() {
            cx.warn(Warning::ThinGaps {
                n_voxels,
                pairs: gaps.iter().map(|gap| gap.surfaces.map(|id| self.name(id))).collect(),
            });
        }
    }

    fn warn_of_leaks(&self, voxels: &VoxelScene, reached: &[u32], cx: &Context) {
        let of_surfel = |&s: &u32| self.scene.faces[voxels.surfels[s as usize].face.0 as usize].surface;
        let mut surfaces: Vec<SurfaceId> = reached.iter().map(of_surfel).collect();
        surfaces.sort_unstable();
        surfaces.dedup();
        if !reached.is_empty() {
            cx.warn(Warning::OpenVoxels {
                count: reached.len(),
                surfaces: surfaces.into_iter().map(|id| self.name(id)).collect(),
            });
        }
    }
}

/// Finds the links, stores them as planned, and finds light with one unknown for each surfel.
fn on_links(
    (voxels, sphere): (&VoxelScene, &DiscreteSphere),
    place: LinkPlace,
    request: &VoxelRequest,
    cx: &mut Context,
    light: impl FnOnce(&LinkOperator<'_>, &mut Context) -> Result<Lit, WorkflowError>,
) -> Result<(Lit, LinkFigures), WorkflowError> {
    let links = match place {
        LinkPlace::Memory | LinkPlace::Auto { .. } => {
            cx.time("links", || Links::in_memory(voxels, sphere, &cx.progress()))
        }
        LinkPlace::Recompute => Links::recomputed(voxels, sphere),
        LinkPlace::Disk => cx.time("links", || {
            Links::on_disk(voxels, sphere, &request.link_file, &cx.progress())
        })?,
    };
    cx.go_on()?;
    let operator = LinkOperator::new(voxels, sphere, &links, request.row_weights);
    let lit = light(&operator, cx);
    // A failure of the links explains the solver's result.
    if let Some(error) = links.failure() {
        return Err(error.into());
    }
    let figures = LinkFigures {
        n_links: links.n_links(),
        n_backs: links.n_backs(),
        n_escaped: links.n_escaped(),
        n_bytes: links.n_bytes(),
    };
    Ok((lit?, figures))
}

fn light_by_propagations(
    operator: &LinkOperator<'_>,
    (materials, emission): (&Materials, &Block),
    (passes, form): (usize, Form),
    cx: &mut Context,
) -> Result<Lit, WorkflowError> {
    cx.settings.form = Some(form);
    cx.settings.passes = Some(passes as u64);
    let rho = &materials.reflectance;
    let result = {
        let watch = cx.progress();
        cx.time("propagation", || {
            propagate(operator, rho, emission, form, passes, &watch)
        })
    };
    cx.go_on()?;
    let mut row_sums = Block::zeros(operator.n_rows(), 1);
    let ones = Block::from_values(vec![1.0; operator.n_rows()], 1);
    let (b, h) = (&result.radiosity, &result.irradiance);
    let found = cx.time("audit", || {
        operator.apply(&ones, &mut row_sums);
        audit::propagation(rho, emission, row_sums.values(), b, h)
    });
    cx.audited(found);
    let unshot = unshot(&result.changes);
    if unshot > MAX_UNSHOT {
        cx.warn(Warning::UnshotLight { passes, unshot });
    }
    Ok(Lit {
        leak_power: operator.leak_power(b),
        radiosity: materials.radiosity(&result.irradiance),
        irradiance: result.irradiance,
        result: VoxelResult::Propagations(result.changes),
    })
}

/// Returns the relative light of all further propagations, extrapolated from the relative changes of the earlier ones as a geometric series.
fn unshot(changes: &[f64]) -> f64 {
    match *changes {
        [.., before, last] if last < before => last / (1.0 - last / before),
        [.., last] => last,
        [] => 0.0,
    }
}

/// Warns of light that passes through closed surfaces.
fn warn_of_leak(voxels: &VoxelScene, leak: &Leak, cx: &Context) {
    if leak.power > 0.0 {
        let wall = voxels.thin_walls.first();
        cx.warn(Warning::PassedWalls {
            power: leak.power,
            share: leak.share,
            thickness: wall.map(|wall| wall.thickness),
            enough: wall.and_then(|wall| voxels.n_voxels_for(wall)),
        });
    }
}

impl VoxelRequest {
    fn note_settings(&self, cx: &mut Context) {
        let settings = &mut cx.settings;
        settings.voxels = Some(self.n_voxels);
        settings.radius = Some(self.radius);
        settings.exact_solid_angles = Some(self.solid_angle == SolidAngle::Exact);
        settings.unnormalised = Some(self.row_weights == RowWeights::Plain);
        settings.plain_emission = Some(self.plain_emission);
    }
}
