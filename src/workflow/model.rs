//! A scene with its patches, ready for computation.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use super::{Context, Memory, Parameter, Warning, WorkflowError};
use crate::form_factor::Input;
use crate::geometry::polygon;
use crate::matrix::operator::Block;
use crate::mesh::{ContactEdges, Mesh, MeshOptions, Patch, PatchId};
use crate::plan::Plan;
use crate::report::memory_used_byte;
use crate::scene::{
    ARRAYS_NAME, Arrays, Lighting, LoadOptions, Loaded, Material, Pose, Scene, SceneErrorKind, SceneWarning,
    from_arrays, load_within,
};
use crate::solver::power_of_two_below;
use crate::visibility::Visibility as _;
use crate::visibility::embree::EmbreeVisibility;
use crate::visibility::facing::look;
use crate::visibility::gaps::narrowest_gap;

/// Bytes of a patch with its vertices, while patches are made; the measured range is 113 to 128.
const PATCH_BYTE: u64 = 160;

/// Bytes of a face while the ray tracer's tree is built.
const FACE_BYTE: u64 = 256;

/// The greatest number of surfaces with apparently inverted faces that warnings name one by one.
const MAX_TURNED: usize = 5;

/// The distance of rays' origins from a face, relative to a patch's width, above which it changes the exchange between neighbours by more than the noise of many rays.
const MAX_OFFSET: f64 = 1e-3;

/// A scene with its patches, ready for ray queries.
pub struct Model {
    /// The scene.
    pub scene: Scene,
    /// The name of the scene in messages: its file.
    pub file: PathBuf,
    /// Its needs, and the omitted steps.
    pub plan: Plan,
    /// The subdivision of its faces.
    pub options: MeshOptions,
    /// Its patches.
    pub mesh: Mesh,
    /// True if the patches differ from those of the scene as loaded: moved surfaces stand on them.
    pub is_cut_anew: bool,
    /// The ray tracer.
    pub visibility: EmbreeVisibility,
}

/// The use of patches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// The light that they exchange: contact edges cut them, and light may leak.
    Light,
    /// Points on them, which do not leak.
    Points,
    /// None.
    Nothing,
}

/// Reads a scene within the memory limit, and passes on its warnings.
///
/// If no face emits light, `on_darkness` decides whether to warn now.
///
/// # Errors
/// [`WorkflowError::MemoryLimit`] and [`WorkflowError::Scene`].
pub fn load(
    path: &Path,
    options: &LoadOptions,
    cx: &Context,
    on_darkness: impl Fn(&SceneWarning) -> bool,
) -> Result<Scene, WorkflowError> {
    let refused = RefCell::new(None);
    let room = |needed| {
        let asked = expect_room(path, "to read it", needed, &cx.memory, "or split the scene");
        asked.map_err(|error| {
            *refused.borrow_mut() = Some(error);
            SceneErrorKind::NoRoom { needed }
        })
    };
    let loaded = cx.time("scene", || load_within(path, options, &room));
    if let Some(error) = refused.into_inner() {
        return Err(error);
    }
    cx.go_on()?;
    Ok(told(loaded?, cx, on_darkness))
}

/// Makes a scene of arrays, and passes on its warnings, as [`load`] does.
///
/// # Errors
/// [`WorkflowError::MemoryLimit`] and [`WorkflowError::Scene`].
///
/// # Panics
/// If the arrays do not fit each other.
#[track_caller]
pub fn load_arrays(
    arrays: &Arrays<'_>,
    options: &LoadOptions,
    cx: &Context,
    on_darkness: impl Fn(&SceneWarning) -> bool,
) -> Result<Scene, WorkflowError> {
    let needed = arrays.needed_bytes();
    expect_room(
        Path::new(ARRAYS_NAME),
        "to make it",
        needed,
        &cx.memory,
        "or split the scene",
    )?;
    let loaded = cx.time("scene", || from_arrays(arrays, options))?;
    Ok(told(loaded, cx, on_darkness))
}

/// Passes on the warnings of a scene.
fn told(loaded: Loaded, cx: &Context, on_darkness: impl Fn(&SceneWarning) -> bool) -> Scene {
    for warning in loaded.warnings {
        if !warning.kind.is_about_light() || on_darkness(&warning) {
            cx.warn(Warning::Scene(warning));
        }
    }
    loaded.scene
}

/// Refuses work that exceeds the memory limit, before it begins.
///
/// # Errors
/// [`WorkflowError::MemoryLimit`].
pub fn expect_room(
    file: &Path,
    what: &str,
    needed: u64,
    memory: &Memory,
    remedy: &'static str,
) -> Result<(), WorkflowError> {
    let needed = needed.saturating_add(memory_used_byte().unwrap_or(0));
    let limit = memory.limit();
    if needed <= limit {
        return Ok(());
    }
    Err(WorkflowError::MemoryLimit {
        file: file.to_owned(),
        what: what.to_owned(),
        needed,
        limit,
        remedy,
    })
}

impl Model {
    /// Cuts a scene into patches and builds the ray tracer's tree; messages call it `file`.
    ///
    /// It warns of faces that rays cannot hit and of faces that seem to have inverted normals, and finds the light leaks of patches for [`Use::Light`] that are not cut at contact edges.
    ///
    /// # Errors
    /// [`WorkflowError::Mesh`], [`WorkflowError::MemoryLimit`] and [`WorkflowError::Embree`].
    pub fn new(
        scene: Scene,
        file: impl Into<PathBuf>,
        options: MeshOptions,
        patches_for: Use,
        cx: &mut Context,
    ) -> Result<Self, WorkflowError> {
        let file = file.into();
        let plan = cx.time("plan", || Plan::new(&scene));
        let refused = |error| WorkflowError::Mesh {
            file: file.clone(),
            error,
        };
        cx.go_on()?;
        let contact_edges = ContactEdges::of(&scene);
        if options.cut_at_walls {
            cx.time("contact_edges", || contact_edges.n_crossed_faces());
        }
        cx.go_on()?;
        let n_patches = Mesh::count(&contact_edges, options).map_err(refused)?;
        let what = format!("to cut it into {n_patches} patches");
        let needed = PATCH_BYTE.saturating_mul(n_patches) + FACE_BYTE * scene.faces.len() as u64;
        expect_room(&file, &what, needed, &cx.memory, "or subdivide less")?;
        let mesh = cx.time("mesh", || Mesh::at_contact_edges(&contact_edges, options));
        let mesh = mesh.map_err(refused)?;
        drop(contact_edges);
        cx.go_on()?;
        let visibility = ray_tracer(&scene, &file, cx)?;
        let mut model = Self {
            scene,
            file,
            plan,
            options,
            mesh,
            is_cut_anew: false,
            visibility,
        };
        model.warn_of_vanished_faces(cx);
        if !model.plan.convex_and_empty {
            model.warn_of_turned_faces(cx);
        }
        for &id in model.plan.turned.iter().take(MAX_TURNED) {
            let face = &model.scene.faces[id.0 as usize];
            cx.warn(Warning::InsideOut {
                at: model.scene.origin(&model.file, id),
                surface: model.scene.surfaces[face.surface.0 as usize].name.clone(),
            });
        }
        if patches_for != Use::Nothing {
            model.note_cut_faces(cx);
        }
        if patches_for == Use::Light {
            cx.find_leaks(&model);
        }
        Ok(model)
    }

    fn warn_of_vanished_faces(&self, cx: &Context) {
        let vanished = self.visibility.vanished_faces();
        if let Some(&face) = vanished.first() {
            cx.warn(Warning::VanishedFaces {
                at: self.scene.origin(&self.file, face),
                count: vanished.len(),
            });
        }
    }

    /// Warns of faces that see nothing, as faces with inverted normals do.
    fn warn_of_turned_faces(&self, cx: &Context) {
        let scene = &self.scene;
        let facing = cx.time("checks", || look(scene, &self.visibility));
        let file = || self.file.clone();
        let name = |surface: u32| scene.surfaces[surface as usize].name.clone();
        if facing.none_sees {
            let surface = match &scene.surfaces[..] {
                [only] => Some(only.name.clone()),
                _ => None,
            };
            cx.warn(Warning::NoneSees { file: file(), surface });
            return;
        }
        if facing.no_emitter_sees {
            cx.warn(Warning::NoEmitterSees { file: file() });
        }
        let n_faces = scene.faces.len();
        if 2 * facing.n_see_only_backs > n_faces {
            cx.warn(Warning::MostSeeBacks {
                file: file(),
                count: facing.n_see_only_backs,
                n_faces,
            });
        }
        for surface in facing.inside_out.iter().take(MAX_TURNED) {
            cx.warn(Warning::TurnedSurface {
                file: file(),
                surface: name(surface.0),
            });
        }
        for turned in facing.turned.iter().take(MAX_TURNED) {
            cx.warn(Warning::TurnedFaces {
                at: scene.numbering.origin(&self.file, turned.line),
                surface: name(turned.surface.0),
                count: turned.n_faces,
            });
        }
        if let count @ 1.. = facing.turned.len().saturating_sub(MAX_TURNED) {
            cx.warn(Warning::MoreTurned { file: file(), count });
        }
    }

    /// Moves the surfaces of a scene with their patches; where contact edges then cross patches, the faces are cut again.
    ///
    /// # Errors
    /// [`WorkflowError::Scene`] for a pose that the scene cannot take, [`WorkflowError::Mesh`] and [`WorkflowError::Embree`].
    pub fn posed(&self, pose: &Pose, cx: &mut Context) -> Result<Self, WorkflowError> {
        let scene = self.scene.posed(pose)?;
        let plan = cx.time("plan", || Plan::new(&scene));
        let options = self.options;
        let mesh = cx.time("mesh", || self.mesh.posed(pose, &scene));
        let cut_anew = cx.time("contact_edges", || {
            let contact_edges = ContactEdges::of(&scene);
            let is_crossed = options.cut_at_walls && !contact_edges.crossed_patches(&mesh).is_empty();
            is_crossed.then(|| Mesh::at_contact_edges(&contact_edges, options))
        });
        let cut_anew = cut_anew.transpose().map_err(|error| WorkflowError::Mesh {
            file: self.file.clone(),
            error,
        })?;
        let visibility = ray_tracer(&scene, &self.file, cx)?;
        let mut moved = Self {
            scene,
            file: self.file.clone(),
            plan,
            options,
            is_cut_anew: cut_anew.is_some(),
            mesh: cut_anew.unwrap_or(mesh),
            visibility,
        };
        moved.note_cut_faces(cx);
        cx.find_leaks(&moved);
        Ok(moved)
    }

    /// Warns, once in a study, if rays start too far off the faces for the narrowest gap.
    pub fn warn_of_narrow_gaps(&self, cx: &Context) {
        if cx.has_looked_at_gaps.replace(true) {
            return;
        }
        let offset = self.visibility.offset();
        // Four times the area over the border: the side of a square, and the width of a needle.
        let widths = self.mesh.patches.iter().enumerate().map(|(i, patch)| {
            let corners = self.mesh.polygon(PatchId::from_index(i));
            4.0 * patch.area / polygon::perimeter(&corners)
        });
        let width = widths.fold(f64::INFINITY, f64::min);
        if offset > MAX_OFFSET * width {
            cx.warn(Warning::FarStart { offset, width });
        }
        let Some(gap) = narrowest_gap(&self.scene, offset) else {
            return;
        };
        let surfaces = gap.faces.map(|id| {
            let face = &self.scene.faces[id.0 as usize];
            let name = self.scene.surfaces[face.surface.0 as usize].name.clone();
            (name, self.scene.numbering.label(face.line))
        });
        cx.warn(Warning::NarrowGap {
            surfaces,
            width: gap.width,
            offset,
        });
    }

    /// Warns of lightings in which no face emits light, with their files; the scene's own lighting is checked when the scene is read.
    pub fn warn_of_darkness<'a>(&self, lightings: impl IntoIterator<Item = (&'a Path, &'a Lighting)>, cx: &Context) {
        for (file, lighting) in lightings {
            if !lighting.is_emitting(&self.scene) {
                cx.warn(Warning::DarkLighting { file: file.to_owned() });
            }
        }
    }

    fn note_cut_faces(&mut self, cx: &Context) {
        let whole = (cx.naming)(Parameter::CutAtWalls, Some("false"));
        self.plan
            .note_cut_faces(self.mesh.n_cut_faces(), self.options.cut_at_walls, &whole);
    }

    /// Returns the input of form-factor methods.
    #[must_use]
    pub fn input(&self) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: self.plan.convex_and_empty,
        }
    }

    /// Returns the area of each surface, in m².
    #[must_use]
    pub fn surface_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.scene.surfaces.len()];
        for patch in &self.mesh.patches {
            areas[patch.surface.0 as usize] += patch.area;
        }
        areas
    }

    /// Returns the area mean of `per_patch` over each surface, per channel.
    #[must_use]
    pub fn surface_means(&self, per_patch: &Block) -> Vec<Vec<f64>> {
        let areas = self.surface_areas();
        let mut units = vec![vec![0.0_f64; per_patch.n_channels()]; areas.len()];
        let mut means = units.clone();
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            for (greatest, value) in units[patch.surface.0 as usize].iter_mut().zip(per_patch.row(i)) {
                *greatest = greatest.max(value.abs());
            }
        }
        // Powers of two change no digit, and keep a sum from overflowing where its mean does not.
        for unit in units.iter_mut().flatten() {
            *unit = power_of_two_below(std::iter::once(*unit));
        }
        let area_unit = power_of_two_below(areas.iter().copied());
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            let k = patch.surface.0 as usize;
            for ((mean, unit), value) in means[k].iter_mut().zip(&units[k]).zip(per_patch.row(i)) {
                *mean += patch.area / area_unit * (value / unit);
            }
        }
        for ((mean, own_units), area) in means.iter_mut().zip(units).zip(areas) {
            // A surface whose faces were all skipped has no area; its mean is 0.
            if area > 0.0 {
                for (value, unit) in mean.iter_mut().zip(own_units) {
                    *value = *value / (area / area_unit) * unit;
                }
            }
        }
        means
    }

    /// Returns ρ and E of every patch, in one channel if all are grey, else in three.
    #[must_use]
    pub fn materials(&self) -> (Block, Block) {
        materials(&self.scene, &self.mesh, self.plan.n_channels)
    }
}

/// Returns ρ and E of every patch in its first channels.
pub(crate) fn materials(scene: &Scene, mesh: &Mesh, n_channels: usize) -> (Block, Block) {
    let collect = |value: fn(&Material) -> [f64; 3]| {
        let of_patch = |patch: &Patch| value(&scene.materials[patch.material.0 as usize]);
        let values = mesh
            .patches
            .iter()
            .flat_map(|p| of_patch(p).into_iter().take(n_channels));
        Block::from_values(values.collect(), n_channels)
    };
    (collect(|m| m.reflectance), collect(|m| m.exitance))
}

fn ray_tracer(scene: &Scene, file: &Path, cx: &Context) -> Result<EmbreeVisibility, WorkflowError> {
    cx.time("ray_tracer", || EmbreeVisibility::new(scene))
        .map_err(|error| WorkflowError::Embree {
            file: file.to_owned(),
            error,
        })
}
