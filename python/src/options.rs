//! Reads settings by their names in Python.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use glam::DVec3;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use radiosity::form_factor::{self, Closure, MethodSettings, TOLERANCE};
use radiosity::heat::{Sky, Sun, sun_direction};
use radiosity::matrix::Precision;
use radiosity::mesh::{MeshOptions, Subdivision};
use radiosity::scene::{Flip, Format, LengthUnit, LoadOptions, UpAxis};
use radiosity::setting::{Kind, Setting, Use, Value, Values};
use radiosity::solver::{self, SolverSettings, Start};
use radiosity::workflow::{
    Afterwards, Balance, FormFactorRequest, Memory, Parameter, SkyRequest, SolveRequest, Storage, SunRequest,
};

use crate::error::bad_argument;

/// Named settings of a call: each is taken once, and those left over are refused.
pub(crate) struct Options<'py> {
    given: Bound<'py, PyDict>,
}

impl<'py> Options<'py> {
    pub(crate) fn new(given: &Bound<'py, PyDict>) -> PyResult<Self> {
        Ok(Self { given: given.copy()? })
    }

    fn py(&self) -> Python<'py> {
        self.given.py()
    }

    /// Takes a setting; `None` if it is absent or None.
    pub(crate) fn take<T>(&self, name: &str) -> PyResult<Option<T>>
    where
        T: for<'a> FromPyObject<'a, 'py, Error: Into<PyErr>>,
    {
        let Some(value) = self.given.get_item(name)? else {
            return Ok(None);
        };
        self.given.del_item(name)?;
        if value.is_none() {
            return Ok(None);
        }
        let kind = value.get_type().name()?.to_string();
        let found = value.extract::<T>().map_err(Into::into);
        found.map(Some).map_err(|_| {
            bad_argument(
                self.py(),
                &format!("{name}: {} of type {kind} cannot be used", shown(&value)),
            )
        })
    }

    /// Takes a setting that has one of some names.
    pub(crate) fn choice<T: Copy>(&self, name: &str, known: &[(&str, T)]) -> PyResult<Option<T>> {
        let Some(text) = self.take::<String>(name)? else {
            return Ok(None);
        };
        let found = known.iter().find(|(own, _)| *own == text);
        found.map(|(_, value)| Some(*value)).ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(|(own, _)| *own).collect();
            bad_argument(
                self.py(),
                &format!("{name}: \"{text}\" is none of {}", names.join(", ")),
            )
        })
    }

    /// Takes a number that is above 0.
    pub(crate) fn positive(&self, name: &str) -> PyResult<Option<f64>> {
        let value = self.take::<f64>(name)?;
        match value.filter(|value| !(*value > 0.0 && value.is_finite())) {
            Some(value) => Err(bad_argument(self.py(), &format!("{name}: {value} is not above 0"))),
            None => Ok(value),
        }
    }

    /// Takes a whole number that is above 0.
    pub(crate) fn count(&self, name: &str) -> PyResult<Option<NonZeroUsize>> {
        let value = self.take::<usize>(name)?;
        let wrong = || bad_argument(self.py(), &format!("{name}: 0 is not above 0"));
        value
            .map(|value| NonZeroUsize::new(value).ok_or_else(wrong))
            .transpose()
    }

    /// Takes the settings that methods or solvers list, each by its name.
    fn values(&self, listed: Vec<(&'static Setting, Vec<(&'static str, Use)>)>) -> PyResult<Values> {
        let mut values = Values::default();
        for (setting, _) in listed {
            let name = setting.name;
            let value = match setting.kind {
                Kind::Flag => self.take::<bool>(name)?.map(Value::Flag),
                Kind::Count(_) => self.count(name)?.map(Value::from),
                Kind::Number if *setting == TOLERANCE => self.positive(name)?.map(Value::Number),
                Kind::Number => self.take::<f64>(name)?.map(Value::Number),
                Kind::Choice(words) => {
                    let words: Vec<(&str, Value)> =
                        words.iter().map(|(word, _)| (*word, Value::Choice(word))).collect();
                    self.choice(name, &words)?
                }
            };
            if let Some(value) = value {
                // The text of a value in range is one that the setting reads.
                let checked = setting.parse(&value.to_string());
                let checked = checked.map_err(|wrong| bad_argument(self.py(), &format!("{name}: {wrong}")))?;
                values.set(setting, checked);
            }
        }
        Ok(values)
    }

    /// Refuses settings that were not taken.
    pub(crate) fn finish(&self) -> PyResult<()> {
        match self.given.keys().iter().next() {
            Some(name) => Err(bad_argument(self.py(), &format!("{name}: there is no such setting"))),
            None => Ok(()),
        }
    }

    /// Takes the options for reading a scene.
    pub(crate) fn reading(&self) -> PyResult<LoadOptions> {
        let format = self.take::<String>("format")?;
        let known = format.as_deref().map(Format::named);
        if let (Some(name), Some(None)) = (&format, &known) {
            let names: Vec<&str> = Format::all().map(Format::name).collect();
            let text = format!("format: \"{name}\" is none of {}", names.join(", "));
            return Err(bad_argument(self.py(), &text));
        }
        let units = [
            ("m", LengthUnit::Metre),
            ("mm", LengthUnit::Millimetre),
            ("cm", LengthUnit::Centimetre),
            ("in", LengthUnit::Inch),
            ("ft", LengthUnit::Foot),
        ];
        let default = LoadOptions::default();
        Ok(default
            .clone()
            .format(known.flatten())
            .allow_outside(self.take("allow_outside")?.unwrap_or(false))
            .flip(self.flip()?)
            .unit(self.choice("unit", &units)?.unwrap_or_default())
            .up_axis(
                self.choice("up_axis", &[("y", UpAxis::Y), ("z", UpAxis::Z)])?
                    .unwrap_or_default(),
            )
            .merge_tolerance(self.positive("merge_tolerance")?.unwrap_or(0.0))
            .crease_angle(self.crease_angle()?.unwrap_or(default.crease_angle))
            .one_surface(self.take("one_surface")?.unwrap_or(false))
            .surface_array(self.take("surface_array")?)
            .materials(self.take::<PathBuf>("materials")?))
    }

    fn crease_angle(&self) -> PyResult<Option<f64>> {
        let angle = self.take::<f64>("crease_angle")?;
        match angle.filter(|angle| !(0.0..=180.0).contains(angle)) {
            Some(angle) => {
                let text = format!("crease_angle: {angle} is not from 0 to 180 degrees");
                Err(bad_argument(self.py(), &text))
            }
            None => Ok(angle),
        }
    }

    fn flip(&self) -> PyResult<Flip> {
        if let Some(Some(all)) = self.given.get_item("flip")?.map(|flip| flip.extract::<bool>().ok()) {
            self.given.del_item("flip")?;
            return Ok(if all { Flip::All } else { Flip::Nothing });
        }
        Ok(self.take::<Vec<String>>("flip")?.map_or(Flip::Nothing, Flip::Surfaces))
    }

    /// Takes the subdivision of faces.
    pub(crate) fn mesh(&self) -> PyResult<MeshOptions> {
        let (parts, length) = (self.count("subdivide")?, self.positive("max_edge")?);
        let subdivision = match (parts, length) {
            (Some(_), Some(_)) => {
                return Err(bad_argument(
                    self.py(),
                    "subdivide, max_edge: give one of them, not both",
                ));
            }
            (_, Some(length)) => Subdivision::MaxEdge(length),
            (parts, None) => Subdivision::Uniform(parts.map_or(1, |n| u32::try_from(n.get()).unwrap_or(u32::MAX))),
        };
        Ok(MeshOptions {
            subdivision,
            cut_at_walls: self.take("cut_at_walls")?.unwrap_or(true),
        })
    }

    /// Takes the request for form factors, for the steps after them.
    pub(crate) fn form_factors(&self, then: Afterwards) -> PyResult<FormFactorRequest> {
        let balances = [
            ("auto", Balance::Auto),
            ("on", Balance::On),
            ("closure", Balance::Closure),
            ("off", Balance::Off),
        ];
        let default = FormFactorRequest::default();
        let limit = self.positive("time_limit")?;
        let too_long = |seconds| bad_argument(self.py(), &format!("time_limit: {seconds:e} s are too many"));
        let duration = |seconds| Duration::try_from_secs_f64(seconds).map_err(|_| too_long(seconds));
        let limit = limit.map(duration).transpose()?;
        Ok(FormFactorRequest {
            method: self.take("method")?.unwrap_or(default.method),
            settings: MethodSettings {
                values: self.values(form_factor::registry::settings())?,
                seed: self.take("seed")?.unwrap_or(0),
            },
            tolerance_parameter: Parameter::Tolerance,
            balance: self.choice("balance", &balances)?.unwrap_or_default(),
            closure: self.closure()?,
            time_limit: limit.map(|limit| (limit, then)),
            ..FormFactorRequest::default()
        })
    }

    /// Takes the statement whether the scene is closed.
    pub(crate) fn closure(&self) -> PyResult<Closure> {
        Ok(match self.take::<bool>("closed")? {
            None => Closure::Detect,
            Some(true) => Closure::Closed,
            Some(false) => Closure::Open,
        })
    }

    /// Takes a table of settings; an empty one if it is absent.
    pub(crate) fn table(&self, name: &str) -> PyResult<Self> {
        let table = self.take::<Bound<'py, PyDict>>(name)?;
        Self::new(&table.unwrap_or_else(|| PyDict::new(self.py())))
    }

    /// Takes the memory limit and the storage of form factors.
    pub(crate) fn memory(&self) -> PyResult<Memory> {
        let storages = [
            ("auto", Storage::Auto),
            ("dense", Storage::Dense),
            ("symmetric", Storage::Symmetric),
            ("sparse", Storage::Sparse),
            ("disk", Storage::Disk),
        ];
        Ok(Memory {
            limit_byte: self.count("memory_limit")?.map(|n| n.get() as u64),
            storage: self.choice("storage", &storages)?.unwrap_or_default(),
            precision: self.choice("precision", &[("f64", Precision::F64), ("f32", Precision::F32)])?,
            scratch: self.take("scratch")?,
            ..Memory::default()
        })
    }

    /// Takes the request for a solution.
    pub(crate) fn solver(&self) -> PyResult<SolveRequest> {
        let starts = [
            ("exitance", Start::Exitance),
            ("zero", Start::Zero),
            ("ambient", Start::Ambient),
        ];
        let default = SolveRequest::default();
        let settings = SolverSettings {
            values: self.values(solver::registry::settings())?,
            ..SolverSettings::default()
        };
        let tolerance = self.take("tolerance")?.unwrap_or(default.tolerance);
        if !SolveRequest::TOLERANCES.contains(&tolerance) {
            let text = format!("tolerance: {tolerance} is outside [1e-300, 1)");
            return Err(bad_argument(self.py(), &text));
        }
        Ok(SolveRequest {
            solver: self.take("solver")?.unwrap_or(default.solver),
            settings,
            tolerance,
            max_passes: self.count("max_passes")?.map_or(default.max_passes, NonZeroUsize::get),
            start: self.choice("start", &starts)?.unwrap_or_default(),
        })
    }

    /// Takes the sun, in a scene where `up` is up.
    pub(crate) fn sun(&self, up: DVec3) -> PyResult<Option<SunRequest>> {
        let Some(sun) = self.take::<Bound<'py, PyDict>>("sun")? else {
            return Ok(None);
        };
        let py = self.py();
        let of_sun = Self::new(&sun)?;
        let strengths = match of_sun.given.get_item("irradiance")? {
            Some(value) if value.extract::<f64>().is_ok() => [of_sun.take("irradiance")?.unwrap_or(0.0); 3],
            Some(_) => of_sun.take("irradiance")?.unwrap_or_default(),
            None => return Err(bad_argument(py, "sun: `irradiance` is missing, in W/m²")),
        };
        let radius: f64 = of_sun.take("angular_radius")?.unwrap_or(0.0);
        let direction: Option<[f64; 3]> = of_sun.take("direction")?;
        let place = of_sun.take::<f64>("latitude")?.zip(of_sun.take::<f64>("longitude")?);
        let north: [f64; 3] = of_sun.take("north")?.unwrap_or([0.0, 1.0, 0.0]);
        let time: Option<String> = of_sun.take("time")?;
        of_sun.finish()?;
        let wrong = |(key, wrong): (&str, String)| bad_argument(py, &format!("sun: {key}: {wrong}"));
        let direction = match (direction, place, time) {
            (Some(direction), None, None) => DVec3::from_array(direction),
            (None, Some(place), Some(time)) => {
                sun_direction(place, &time, [DVec3::from_array(north), up]).map_err(wrong)?
            }
            _ => {
                let text = "sun: give `direction`, or `latitude`, `longitude` and `time`";
                return Err(bad_argument(py, text));
            }
        };
        Ok(Some(SunRequest {
            sun: Sun::new(direction, worst(strengths), radius).map_err(wrong)?,
            irradiance: strengths,
        }))
    }

    /// Takes the irradiance of a sky: a number, or one for each channel.
    pub(crate) fn sky(&self, up: DVec3) -> PyResult<Option<SkyRequest>> {
        let irradiance = match self.given.get_item("sky")? {
            Some(value) if value.extract::<f64>().is_ok() => self.take::<f64>("sky")?.map(|grey| [grey; 3]),
            _ => self.take::<[f64; 3]>("sky")?,
        };
        let made = irradiance.map(|irradiance| {
            let sky = Sky::new(worst(irradiance), up)?;
            Ok(SkyRequest { sky, irradiance })
        });
        made.transpose()
            .map_err(|(_, wrong)| bad_argument(self.py(), &format!("sky: {wrong}")))
    }
}

/// Returns a channel that is refused if any is: NaN, negative, or the greatest.
fn worst(channels: [f64; 3]) -> f64 {
    let is_wrong = |value: &f64| value.is_nan() || *value < 0.0;
    let greatest = channels.into_iter().fold(0.0, f64::max);
    channels.into_iter().find(is_wrong).unwrap_or(greatest)
}

/// Returns a value on one line, cut if it is long.
fn shown(value: &Bound<'_, PyAny>) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if line.chars().count() <= LONGEST {
        return line;
    }
    line.chars().take(LONGEST).chain(['…']).collect()
}
