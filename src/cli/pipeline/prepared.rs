//! A scene that is ready for work.

use std::path::Path;

use serde_json::{Value, json};

use super::Run;
use crate::cli::args::MeshArgs;
use crate::cli::failure::Failure;
use crate::cli::storage::limit_byte;
use crate::form_factor::Input;
use crate::matrix::operator::Block;
use crate::mesh::{ContactEdges, Mesh, MeshOptions, Patch, Subdivision};
use crate::plan::{Plan, byte_text};
use crate::render::MAX_PICTURE_EXITANCE;
use crate::report::memory_used_byte;
use crate::scene::reading::reading_byte;
use crate::scene::{Lighting, LoadOptions, Material, Pose, Scene, SceneWarning, Surface, builtin, load_with};
use crate::solver::{Solution, power_of_two_below};
use crate::visibility::Visibility as _;
use crate::visibility::embree::EmbreeVisibility;
use crate::visibility::facing::look;
use crate::visibility::gaps::narrowest_gap;

/// A scene with its patches, ready for ray queries.
pub(in crate::cli) struct Prepared {
    pub(in crate::cli) scene: Scene,
    pub(in crate::cli) plan: Plan,
    /// How its faces are cut.
    pub(in crate::cli) options: MeshOptions,
    pub(in crate::cli) mesh: Mesh,
    /// Whether the patches are others than those of the scene as it was loaded: surfaces that moved have come to stand on them.
    pub(in crate::cli) is_cut_anew: bool,
    pub(in crate::cli) visibility: EmbreeVisibility,
}

/// Bytes of a patch with its vertices, while patches are made: 113 to 128 are measured.
const PATCH_BYTE: u64 = 160;

/// Surfaces with faces that seem turned are named one by one up to here.
const MOST_TURNED: usize = 5;

/// Bytes of a face while the ray tracer's tree is built.
const FACE_BYTE: u64 = 256;

impl Run {
    /// Reads a scene, if that stays below the limit of memory, cuts it into patches and builds the ray tracer's tree. Without arguments for patches these play no part.
    pub(in crate::cli) fn prepare(
        &mut self,
        path: &Path,
        mesh_args: impl Into<Option<MeshArgs>>,
        memory_limit: Option<u64>,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Prepared, Failure> {
        let name = path.to_string_lossy();
        if !path.exists() && builtin::names().any(|known| known == name) {
            let message = format!(
                "{name}: no such file; `radiosity scene {name} -o {name}.obj` writes the built-in scene of that name"
            );
            return Err(Failure::new("unreadable", message).in_file(path));
        }
        expect_readable(path, memory_limit)?;
        let mut options = LoadOptions::default()
            .allow_outside(self.common.allow_outside)
            .flip(self.common.flip());
        if self.command == "render" {
            options = options.max_exitance(MAX_PICTURE_EXITANCE);
        }
        if !self.common.flip.is_empty() {
            self.set("flip", self.common.flip.clone());
        }
        let loaded = self.times.time("scene", || load_with(path, &options))?;
        let wants_light = !matches!(self.command, "form-factors" | "field" | "compare");
        for warning in &loaded.warnings {
            if matches!(warning, SceneWarning::NoEmission { .. }) && self.has_lightings {
                self.dark = Some(warning.to_string());
            } else if wants_light || !warning.is_about_light() {
                self.warn(&warning.to_string());
            }
        }
        self.prepare_scene(path, loaded.scene, mesh_args, memory_limit, default)
    }

    /// Warns of lightings in which no face emits light, each with its file; without a file it is the scene's own.
    pub(in crate::cli) fn warn_of_darkness(&mut self, scene: &Scene, lightings: &[(Option<&Path>, Option<&Lighting>)]) {
        for (file, lighting) in lightings {
            match (file, lighting) {
                (Some(file), Some(lighting)) if !lighting.is_emitting(scene) => self.warn(&format!(
                    "{}: no face emits light in this lighting; give a surface an `exitance`",
                    file.display()
                )),
                (_, None) => {
                    if let Some(message) = self.dark.take() {
                        self.warn(&message);
                    }
                }
                _ => {}
            }
        }
    }

    /// Cuts a scene into patches and builds the ray tracer's tree; `path` is what messages call it.
    pub(in crate::cli) fn prepare_scene(
        &mut self,
        path: &Path,
        scene: Scene,
        mesh_args: impl Into<Option<MeshArgs>>,
        memory_limit: Option<u64>,
        default: impl FnOnce(&Scene) -> Subdivision,
    ) -> Result<Prepared, Failure> {
        let plan = self.times.time("plan", || Plan::new(&scene));
        let mesh_args = mesh_args.into();
        let default = default(&scene);
        let options = mesh_args.map_or_else(|| default.into(), |args| args.options(default));
        match options.subdivision {
            Subdivision::Uniform(n) => self.set("subdivide", n),
            Subdivision::MaxEdge(length) => self.set("max_edge_m", length),
        }
        if mesh_args.is_some() {
            self.set("cut_at_walls", options.cut_at_walls);
        }
        let refused = |error| Failure::new("mesh", format!("{}: {error}", path.display())).in_file(path);
        let contact_edges = ContactEdges::of(&scene);
        if options.cut_at_walls {
            self.times.time("contact_edges", || contact_edges.n_crossed_faces());
        }
        let n_patches = Mesh::count(&contact_edges, options).map_err(refused)?;
        let what = format!("to cut it into {n_patches} patches");
        let needed = PATCH_BYTE.saturating_mul(n_patches) + FACE_BYTE * scene.faces.len() as u64;
        expect_room(path, &what, needed, memory_limit, "or subdivide less")?;
        let mesh = self
            .times
            .time("mesh", || Mesh::at_contact_edges(&contact_edges, options))
            .map_err(refused)?;
        let visibility = self
            .times
            .time("ray_tracer", || EmbreeVisibility::new(&scene))
            .map_err(|error| Failure::new("embree", format!("{}: {error}", path.display())).in_file(path))?;
        if let Some(&face) = visibility.vanished_faces().first() {
            self.warn(&format!(
                "{}:{}: this face and {} more are too small, beside the size of the scene, for rays to hit them",
                path.display(),
                scene.faces[face.0 as usize].line,
                visibility.vanished_faces().len() - 1
            ));
        }
        if !plan.convex_and_empty {
            self.warn_of_turned_faces(path, &scene, &visibility);
        }
        for &face in plan.turned.iter().take(MOST_TURNED) {
            let face = &scene.faces[face.0 as usize];
            self.warn(&format!(
                "{}:{}: `{}`: the closed surface that this face is part of stands inside of another and faces inwards, so that what is around it meets its black backs; reverse its winding, that of a whole surface with --flip=NAME",
                path.display(),
                face.line,
                scene.surfaces[face.surface.0 as usize].name
            ));
        }
        path.clone_into(&mut self.scene_file);
        self.surface_names = scene.surfaces.iter().map(|surface| surface.name.clone()).collect();
        let mut prepared = Prepared {
            scene,
            plan,
            options,
            mesh,
            is_cut_anew: false,
            visibility,
        };
        if mesh_args.is_some() {
            prepared.note_cut_faces();
            self.find_leaks(&prepared);
        }
        Ok(prepared)
    }

    /// Warns of faces that see nothing, as faces do that are wound the wrong way.
    fn warn_of_turned_faces(&mut self, path: &Path, scene: &Scene, visibility: &EmbreeVisibility) {
        let facing = self.times.time("checks", || look(scene, visibility));
        let file = path.display();
        if facing.none_sees {
            let of_surface = match &scene.surfaces[..] {
                [only] => format!(" of `{}`", only.name),
                _ => String::new(),
            };
            self.warn(&format!(
                "{file}: no face{of_surface} sees another, so none receives light from another: the normals are probably inverted; reverse all with --flip, or a surface's with --flip=NAME"
            ));
            return;
        }
        if facing.no_emitter_sees {
            self.warn(&format!(
                "{file}: no face that emits light sees another: the normals are probably inverted; reverse all with --flip, or a surface's with --flip=NAME"
            ));
        }
        let n_faces = scene.faces.len();
        if 2 * facing.n_see_only_backs > n_faces {
            self.warn(&format!(
                "{file}: {} of {n_faces} faces see only black backs of others: normals are probably inverted; reverse all with --flip, or a surface's with --flip=NAME",
                facing.n_see_only_backs
            ));
        }
        for surface in facing.inside_out.iter().take(MOST_TURNED) {
            let name = &scene.surfaces[surface.0 as usize].name;
            self.warn(&format!(
                "{file}: no face of `{name}` sees another, but from behind they would: its normals are probably inverted; reverse them with --flip={name}"
            ));
        }
        for turned in facing.turned.iter().take(MOST_TURNED) {
            let name = &scene.surfaces[turned.surface.0 as usize].name;
            let what = match turned.n_faces {
                1 => "the face sees no other".to_owned(),
                n => format!("this face and {} more see no other", n - 1),
            };
            self.warn(&format!(
                "{file}:{}: `{name}`: {what}, and others see the back; reverse what is meant to be seen, a whole surface with --flip={name}",
                turned.line
            ));
        }
        if let more @ 1.. = facing.turned.len().saturating_sub(MOST_TURNED) {
            self.warn(&format!("{file}: so it is with faces of {more} more surfaces"));
        }
    }

    /// Moves the surfaces of a scene, and its patches with them; where contact edges come to cross these, the faces are cut anew.
    pub(in crate::cli) fn posed(&mut self, prepared: &Prepared, pose: &Pose) -> Result<Prepared, Failure> {
        let scene = posed(&prepared.scene, pose)?;
        let plan = self.times.time("plan", || Plan::new(&scene));
        let options = prepared.options;
        let mesh = self.times.time("mesh", || prepared.mesh.posed(pose, &scene));
        let cut_anew = self.times.time("contact_edges", || {
            let contact_edges = ContactEdges::of(&scene);
            let is_crossed = options.cut_at_walls && !contact_edges.crossed_patches(&mesh).is_empty();
            is_crossed.then(|| Mesh::at_contact_edges(&contact_edges, options))
        });
        let cut_anew = cut_anew
            .transpose()
            .map_err(|error| Failure::new("mesh", error.to_string()))?;
        let visibility = self
            .times
            .time("ray_tracer", || EmbreeVisibility::new(&scene))
            .map_err(|error| {
                let file = &self.scene_file;
                Failure::new("embree", format!("{}: {error}", file.display())).in_file(file)
            })?;
        let mut moved = Prepared {
            scene,
            plan,
            options,
            is_cut_anew: cut_anew.is_some(),
            mesh: cut_anew.unwrap_or(mesh),
            visibility,
        };
        moved.note_cut_faces();
        self.find_leaks(&moved);
        Ok(moved)
    }

    /// Warns if rays start too far off the faces to see what lies in the narrowest gap.
    pub(in crate::cli) fn warn_of_narrow_gaps(&mut self, prepared: &Prepared) {
        if std::mem::replace(&mut self.has_looked_at_gaps, true) {
            return;
        }
        let (scene, offset) = (&prepared.scene, prepared.visibility.offset());
        let widths = prepared.mesh.patches.iter().map(|patch| patch.area.sqrt());
        let width = widths.fold(f64::INFINITY, f64::min);
        if offset > MOST_OFFSET * width {
            self.warn(&format!(
                "rays start {offset:.2e} m off a face in a scene of this size, and the smallest patch is only {width:.2e} m wide: what patches near each other exchange is off by about {:.1e} of itself; \
                 leave out what is far away, or use a method without rays",
                offset / width
            ));
        }
        let Some(gap) = narrowest_gap(scene, offset) else {
            return;
        };
        let [first, second] = gap.faces.map(|id| {
            let face = &scene.faces[id.0 as usize];
            let name = &scene.surfaces[face.surface.0 as usize].name;
            format!("`{name}` (line {})", face.line)
        });
        self.warn(&format!(
            "{first} and {second} are {:.2e} m apart, and rays start {offset:.2e} m off a face: light between them is lost or blurred; \
             use a method without rays, or model the gap in a scene of its own",
            gap.width
        ));
    }
}

/// Rays that start farther off a face than this part of a patch's width bend what neighbours exchange by more than the noise of many.
const MOST_OFFSET: f64 = 1e-3;

/// Refuses a scene whose text alone does not fit the memory.
fn expect_readable(path: &Path, memory_limit: Option<u64>) -> Result<(), Failure> {
    // What cannot be opened is told by who reads it.
    let Ok(needed) = reading_byte(path) else {
        return Ok(());
    };
    expect_room(path, "to read it", needed, memory_limit, "or split the scene")
}

/// Refuses what takes more memory than there is to be, before it is begun.
pub(in crate::cli) fn expect_room(
    path: &Path,
    what: &str,
    needed: u64,
    memory_limit: Option<u64>,
    remedy: &str,
) -> Result<(), Failure> {
    let needed = needed.saturating_add(memory_used_byte().unwrap_or(0));
    let limit = limit_byte(memory_limit);
    if needed <= limit {
        return Ok(());
    }
    let (needed, limit) = (byte_text(needed), byte_text(limit));
    let message = format!(
        "{}: {what} takes up to {needed} of memory, and the limit is {limit}; raise --memory-limit, {remedy}",
        path.display()
    );
    Err(Failure::new("memory_limit", message).in_file(path))
}

/// Returns a scene in a pose.
pub(in crate::cli) fn posed(scene: &Scene, pose: &Pose) -> Result<Scene, Failure> {
    scene
        .posed(pose)
        .map_err(|error| Failure::new("bad_frames", error.to_string()))
}

impl Prepared {
    fn note_cut_faces(&mut self) {
        self.plan
            .note_cut_faces(self.mesh.n_cut_faces(), self.options.cut_at_walls);
    }

    /// Returns what form-factor methods look at.
    pub(in crate::cli) fn input(&self) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded: self.plan.convex_and_empty,
        }
    }

    /// Returns the area of each surface, in m².
    pub(in crate::cli) fn surface_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.scene.surfaces.len()];
        for patch in &self.mesh.patches {
            areas[patch.surface.0 as usize] += patch.area;
        }
        areas
    }

    /// Returns the area mean of `per_patch` over each surface, per channel.
    pub(in crate::cli) fn surface_means(&self, per_patch: &Block) -> Vec<Vec<f64>> {
        let areas = self.surface_areas();
        let mut units = vec![vec![0.0_f64; per_patch.n_channels()]; areas.len()];
        let mut means = units.clone();
        for (i, patch) in self.mesh.patches.iter().enumerate() {
            for (greatest, value) in units[patch.surface.0 as usize].iter_mut().zip(per_patch.row(i)) {
                *greatest = greatest.max(value.abs());
            }
        }
        // Powers of two, so that they change no digit: no sum overflows where its mean does not.
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
            // A surface whose faces were all skipped has no area and no mean but 0.
            if area > 0.0 {
                for (value, unit) in mean.iter_mut().zip(own_units) {
                    *value = *value / (area / area_unit) * unit;
                }
            }
        }
        means
    }

    /// Returns name, area and number of patches of each surface.
    pub(in crate::cli) fn surfaces_to_json(&self) -> Value {
        let mut n_patches = vec![0u64; self.scene.surfaces.len()];
        for patch in &self.mesh.patches {
            n_patches[patch.surface.0 as usize] += 1;
        }
        let areas = self.surface_areas();
        let surface =
            |(k, s): (usize, &Surface)| json!({"name": s.name, "area_m2": areas[k], "n_patches": n_patches[k]});
        self.scene.surfaces.iter().enumerate().map(surface).collect()
    }

    /// Returns name, area and mean radiosity of each surface.
    pub(in crate::cli) fn surfaces_with_radiosity(&self, solution: &Solution) -> Value {
        let means = self.surface_means(&solution.radiosity);
        let mut surfaces = self.surfaces_to_json();
        for (surface, mean) in surfaces.as_array_mut().into_iter().flatten().zip(means) {
            surface["radiosity"] = json!(mean);
        }
        surfaces
    }

    /// Returns ρ and E of every patch, in one channel where all are grey, else in three.
    pub(in crate::cli) fn materials(&self) -> (Block, Block) {
        let n_channels = self.plan.n_channels;
        let collect = |value: fn(&Material) -> [f64; 3]| {
            let of_patch = |patch: &Patch| value(&self.scene.materials[patch.material.0 as usize]);
            let patches = self.mesh.patches.iter();
            let values = patches.flat_map(|p| of_patch(p).into_iter().take(n_channels));
            Block::from_values(values.collect(), n_channels)
        };
        (collect(|m| m.reflectance), collect(|m| m.exitance))
    }
}
