//! Sequences of images with several lightings, cameras and poses.
//!
//! Form factors that stay the same are computed once, and the lightings of a pose are solved together.

use std::path::{Path, PathBuf};

use super::{
    Context, Daylight, DirectDaylight, FormFactorRequest, FormFactorStudy, ImageFile, ImageRequest, ImageView,
    MeshError, Model, SolveRequest, Stack, TotalError, Unsuited, ViewRequest, WorkflowError, gathered, image_byte,
    render_shown,
};
use crate::form_factor::{Before, Change};
use crate::matrix::FormFactors;
use crate::render::{DirectMethod, GatherReport, Image, MAX_PICTURE_EXITANCE, RenderInput, RenderSettings};
use crate::scene::{Lighting, Motion, Pose, SceneError, frames};
use crate::solver::{Coarsened, Solution};

/// An image of a sequence.
pub struct Frame {
    /// Its name.
    pub name: String,
    /// The number of its lighting.
    pub lighting: usize,
    /// The number of its pose.
    pub pose: usize,
    /// Its motions.
    pub motions: Vec<Motion>,
    /// The view.
    pub view: ImageView,
    /// The camera file that it names.
    pub camera_file: Option<PathBuf>,
    /// The settings of the image.
    pub settings: RenderSettings,
    /// The OpenEXR file.
    pub output: PathBuf,
    /// Its preview, a PNG file.
    pub preview: PathBuf,
}

/// All images of a sequence, with their lightings and poses.
pub struct Sequence {
    /// The images, in the order of their list.
    pub frames: Vec<Frame>,
    /// The lightings; `None` is the scene's own.
    pub lightings: Vec<Option<Lighting>>,
    /// Their files.
    pub lighting_files: Vec<Option<PathBuf>>,
    /// The different poses, in the order of their first frames.
    pub poses: Vec<Pose>,
}

/// Defaults for images whose list does not set them.
pub struct FrameDefaults<'a> {
    /// The file of the scene, in whose folder a camera may be.
    pub scene_file: &'a Path,
    /// The view.
    pub view: &'a ViewRequest,
    /// The settings, depending on whether the view is unfolded.
    pub settings: &'a dyn Fn(bool) -> RenderSettings,
    /// The file into which each frame's name is inserted: `B-NAME.exr` for `B.exr`.
    pub output: &'a Path,
}

/// The request for the light and the files of a sequence.
#[derive(Clone, Copy)]
pub struct SequenceRequest<'a> {
    /// The request for form factors.
    pub method: &'a FormFactorRequest,
    /// The request to the solver.
    pub solver: &'a SolveRequest,
    /// Sun and sky over all frames.
    pub daylight: Daylight,
    /// The format of image files.
    pub file: ImageFile,
    /// The address of a viewer that shows the images.
    pub viewer: Option<&'a str>,
}

/// A written image, with its light.
pub struct FrameStudy<'a> {
    /// Its number in the sequence.
    pub number: usize,
    /// The request.
    pub frame: &'a Frame,
    /// The file of its lighting; `None` if the materials are the scene's own.
    pub lighting_file: Option<&'a Path>,
    /// The model in its pose.
    pub model: &'a Model,
    /// The solution for its lighting.
    pub solution: Solution,
    /// The direct light of sun and sky.
    pub direct: DirectDaylight,
    /// The total error by solver and form factors.
    pub error: TotalError,
    /// The change by a coarser mesh; `None` where unknown.
    pub mesh_error: Option<MeshError>,
    /// The cost of final gather.
    pub gather: Option<GatherReport>,
    /// The image.
    pub image: Image,
}

/// A finished pose.
pub struct PoseStudy<'a> {
    /// Its frames.
    pub frames: Vec<&'a Frame>,
    /// The number of lightings that were solved together.
    pub n_lightings: usize,
    /// The model in this pose.
    pub model: &'a Model,
    /// Its form factors.
    pub factors: &'a FormFactorStudy,
    /// The solution of all its lightings.
    pub solution: &'a Solution,
    /// The worst error of a lighting by solver and form factors.
    pub error: TotalError,
    /// The motion since the first pose; `None` for the first.
    pub change: Option<&'a Change>,
}

/// Receives each image and each pose of a sequence as soon as it is finished.
pub trait SequenceObserver {
    /// Receives an image, in the order of the poses.
    fn frame(&mut self, frame: &FrameStudy<'_>);

    /// Receives a pose, after its images.
    fn pose(&mut self, pose: &PoseStudy<'_>);
}

impl Sequence {
    /// Prepares the views of a list of frames, loads every lighting once, and groups the frames by pose.
    ///
    /// # Errors
    /// [`WorkflowError::Scene`] for a lighting or a pose, those of [`ViewRequest::view`], and [`WorkflowError::InFrame`] for files and settings of a frame.
    pub fn new(
        list: &Path,
        wanted: Vec<frames::Frame>,
        model: &Model,
        defaults: &FrameDefaults<'_>,
    ) -> Result<Self, WorkflowError> {
        let mut all = Self {
            frames: Vec::new(),
            lightings: Vec::new(),
            lighting_files: Vec::new(),
            poses: Vec::new(),
        };
        for frame in wanted {
            all.push(list, frame, model, defaults)?;
        }
        Ok(all)
    }

    fn push(
        &mut self,
        list: &Path,
        frame: frames::Frame,
        model: &Model,
        defaults: &FrameDefaults<'_>,
    ) -> Result<(), WorkflowError> {
        let folder = list.parent().unwrap_or(Path::new(""));
        let (motions, pose) = (frame.motions(), frame.pose(list, &model.scene)?);
        let (line, name) = (frame.line, frame.name);
        let in_list = |error: WorkflowError| WorkflowError::InFrame {
            error: Box::new(error),
            list: list.to_owned(),
            line,
            frame: name.clone(),
        };
        let lighting_file = frame.lighting.map(|path| folder.join(path));
        let lighting = self
            .lighting(lighting_file, model)
            .map_err(|error| in_list(error.into()))?;
        let names_a_camera = frame.camera.is_some();
        let mut request = defaults.view.clone();
        if let Some(path) = frame.camera {
            request.camera = super::CameraChoice::of_list(folder, &path);
        }
        // The camera stays at its place in the scene as loaded; the tiles of an unfolded view move with their surfaces.
        let view = if request.is_unfolded() {
            request.view(defaults.scene_file, &model.scene.posed(&pose)?)
        } else {
            request.view(defaults.scene_file, &model.scene)
        };
        let view = view.map_err(|error| if names_a_camera { in_list(error) } else { error })?;
        let output = with_suffix(defaults.output, &name);
        let known = self.poses.iter().position(|other| *other == pose);
        let number = known.unwrap_or(self.poses.len());
        if known.is_none() {
            self.poses.push(pose);
        }
        self.frames.push(Frame {
            lighting,
            pose: number,
            motions,
            view,
            camera_file: request.camera_file().map(Path::to_owned),
            settings: (defaults.settings)(request.is_unfolded()),
            preview: output.with_extension("png"),
            output,
            name,
        });
        Ok(())
    }

    /// Returns the number of a lighting, and reads it on first use.
    fn lighting(&mut self, file: Option<PathBuf>, model: &Model) -> Result<usize, SceneError> {
        if let Some(known) = self.lighting_files.iter().position(|other| *other == file) {
            return Ok(known);
        }
        let load = |path: &PathBuf| Lighting::load_up_to(path, &model.scene, MAX_PICTURE_EXITANCE);
        self.lightings.push(file.as_ref().map(load).transpose()?);
        self.lighting_files.push(file);
        Ok(self.lightings.len() - 1)
    }

    /// Records the memory of the images and the reflectances of the lightings in the context, before form factors are stored.
    ///
    /// # Errors
    /// [`WorkflowError::ImageMemory`].
    pub fn announce(&self, model: &Model, cx: &mut Context) -> Result<(), WorkflowError> {
        let mut largest = 0;
        for frame in &self.frames {
            largest = largest.max(image_byte(frame.view.as_view(), &frame.settings, &cx.memory)?);
        }
        cx.demand.image_byte = largest;
        cx.demand.reflectance_max = Lighting::greatest_reflectance(self.lightings.iter().flatten());
        let has_direct = |frame: &Frame| frame.settings.direct != DirectMethod::Off;
        if self.frames.iter().any(has_direct) {
            model.warn_of_narrow_gaps(cx);
        }
        Ok(())
    }

    /// Computes, solves, renders and writes all frames, pose by pose; returns the model in the first pose.
    ///
    /// # Errors
    /// [`Unsuited::NoFrame`], those of [`form_factors`](Model::form_factors), [`solve_system`](Model::solve_system) and [`render_shown`].
    pub fn render(
        &self,
        as_loaded: &Model,
        request: SequenceRequest<'_>,
        observer: &mut dyn SequenceObserver,
        cx: &mut Context,
    ) -> Result<Model, WorkflowError> {
        let mut first: Option<First> = None;
        for number in 0..self.poses.len() {
            let of_pose = self.render_pose(number, as_loaded, request, first.as_ref(), observer, cx)?;
            first = first.or(Some(of_pose));
        }
        Ok(first.ok_or(Unsuited::NoFrame)?.model)
    }

    fn render_pose(
        &self,
        number: usize,
        as_loaded: &Model,
        request: SequenceRequest<'_>,
        first: Option<&First>,
        observer: &mut dyn SequenceObserver,
        cx: &mut Context,
    ) -> Result<First, WorkflowError> {
        let all = self.frames.iter().enumerate();
        let own: Vec<(usize, &Frame)> = all.filter(|(_, frame)| frame.pose == number).collect();
        let mut model = as_loaded.posed(&self.poses[number], cx)?;
        let change = first.map(|first| Change::between(&first.model.scene, &model.scene));
        cx.demand.part = u32::try_from(number).unwrap_or(u32::MAX);
        let (raw, factors) = pose_factors(&mut model, request, first.zip(change.as_ref()), cx)?;
        // The lightings of the frames in this pose.
        let mut numbers: Vec<usize> = own.iter().map(|(_, frame)| frame.lighting).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let lightings: Vec<Option<Lighting>> = numbers.iter().map(|&k| self.lightings[k].clone()).collect();
        let daylight = request.daylight;
        let mut stack = Stack::new(&model, &lightings, !daylight.is_grey());
        if daylight.shines() {
            stack.shine(&model.direct_daylight(&factors, &daylight, 3, cx));
        }
        let files: Vec<Option<PathBuf>> = numbers.iter().map(|&k| self.lighting_files[k].clone()).collect();
        stack.announce(&mut model, &files, cx);
        let materials = (&stack.reflectance, &stack.exitance);
        let solution = model.solve_system(&factors.factors, request.solver, materials, factors.known(), cx)?;
        let coarse = model.coarsened(&factors, &factors.factors, &stack.reflectance, &solution, cx)?;
        let solved = Solved {
            model: &model,
            factors: &factors,
            lightings: &self.lightings,
            lighting_files: &self.lighting_files,
            numbers: &numbers,
            stack: &stack,
            solution: &solution,
            coarse: coarse.as_ref(),
        };
        let mut error = TotalError::Relative(0.0);
        for &(k, frame) in &own {
            let study = solved.frame(k, frame, request, cx)?;
            error = error.or_worse(study.error);
            observer.frame(&study);
        }
        observer.pose(&PoseStudy {
            frames: own.iter().map(|&(_, frame)| frame).collect(),
            n_lightings: numbers.len(),
            model: &model,
            factors: &factors,
            solution: &solution,
            error,
            change: change.as_ref(),
        });
        Ok(First {
            raw,
            tolerance_met: factors.tolerance_met,
            model,
        })
    }
}

/// The data of the first pose that later ones need.
struct First {
    model: Model,
    /// The form factors without repairs, and whether they met their tolerance.
    raw: FormFactors,
    tolerance_met: bool,
}

/// Computes the form factors of a pose, reusing those of the first one that stay the same; returns them without repairs and with them.
fn pose_factors(
    model: &mut Model,
    request: SequenceRequest<'_>,
    first: Option<(&First, &Change)>,
    cx: &mut Context,
) -> Result<(FormFactors, FormFactorStudy), WorkflowError> {
    let method = request.method;
    let need = cx.memory.or_symmetry(method.balance, request.solver.need(cx)?)?;
    // Form factors are reusable only if the patches are the same.
    let known = first.filter(|(pose, _)| !model.is_cut_anew && !pose.model.is_cut_anew);
    let before = known.map(|(pose, change)| Before {
        factors: &pose.raw,
        tolerance_met: pose.tolerance_met,
        change,
    });
    let raw = model.raw_form_factors(method, need, before, cx)?;
    let factors = raw.computed.factors.clone();
    let study = model.repaired(raw, method, need, cx)?;
    Ok((factors, study))
}

/// The input of the frames of a pose.
struct Solved<'a> {
    model: &'a Model,
    factors: &'a FormFactorStudy,
    lightings: &'a [Option<Lighting>],
    lighting_files: &'a [Option<PathBuf>],
    /// The solved lightings.
    numbers: &'a [usize],
    stack: &'a Stack,
    /// The solution of all these lightings.
    solution: &'a Solution,
    /// The change by a coarser mesh in it.
    coarse: Option<&'a Coarsened>,
}

impl<'a> Solved<'a> {
    fn frame(
        &self,
        number: usize,
        frame: &'a Frame,
        request: SequenceRequest<'_>,
        cx: &mut Context,
    ) -> Result<FrameStudy<'a>, WorkflowError> {
        let Self { model, factors, .. } = *self;
        let place = self.numbers.partition_point(|&k| k < frame.lighting);
        let mut own = self.stack.solution(place, self.solution);
        let (reflectance, exitance) = self.stack.materials(place);
        let daylight = self.stack.in_daylight(place);
        let direct = daylight.map(|day| day.direct.clone()).unwrap_or_default();
        let emitted = daylight.map_or(&exitance, |day| &day.emitted);
        let indirect = cx.time("solve", || direct.indirect_irradiance(&factors.factors, emitted, &own));
        let lit_error = daylight.map(|day| &day.error);
        let carried = factors.carried_error((&reflectance, &exitance), lit_error, &own, cx)?;
        let coarse = self.coarse.map(|coarse| self.stack.coarsened(place, coarse));
        let mesh_error = model.mesh_error(coarse.as_ref(), (&exitance, &own), cx);
        let error = TotalError::of(model, carried.as_ref(), &own, cx);
        direct.add_to(&mut own.irradiance);
        factors.factors.if_readable(())?;
        let lighting = self.lightings[frame.lighting].as_ref();
        let lit = lighting.map(|lighting| lighting.apply(&model.scene));
        let input = RenderInput {
            scene: lit.as_ref().unwrap_or(&model.scene),
            mesh: &model.mesh,
            visibility: &model.visibility,
            radiosity: &own.radiosity,
            irradiance: &own.irradiance,
            indirect_irradiance: Some(&indirect),
            error: carried.as_ref(),
            outdoors: request.daylight.outdoors(),
        };
        let camera = frame.view.origin().map(|origin| origin.text(&cx.naming));
        let image = ImageRequest {
            view: frame.view.as_view(),
            camera: camera.as_deref(),
            settings: frame.settings,
            file: request.file,
            output: &frame.output,
            preview: &frame.preview,
        };
        let image = render_shown(&input, &image, request.viewer, cx)?;
        let gather = gathered(&image, frame.settings, &frame.output, cx);
        Ok(FrameStudy {
            number,
            frame,
            lighting_file: self.lighting_files[frame.lighting].as_deref(),
            model,
            solution: own,
            direct,
            error,
            mesh_error,
            gather,
            image,
        })
    }
}

/// Returns `B-NAME.csv` for `B.csv`.
#[must_use]
pub fn with_suffix(path: &Path, name: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let file = match path.extension() {
        Some(ending) => format!("{stem}-{name}.{}", ending.to_string_lossy()),
        None => format!("{stem}-{name}"),
    };
    path.with_file_name(file)
}
