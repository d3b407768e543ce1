//! Form factors with their checks.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArrayMethods as _, PyReadonlyArray2};
use pyo3::prelude::*;
use radiosity::document::FormFactorRecord;
use radiosity::form_factor::Fraction;
use radiosity::matrix::operator::{Block, LinearOperator as _};
use radiosity::report::form_factors::FormFactorReport;
use radiosity::workflow::{FormFactorStudy, Settings};

use crate::arrays::{Numbers, array, block, table};
use crate::call::Call;
use crate::error::bad_argument;
use crate::model::Shared;

/// Form factors, with their model and settings.
#[expect(
    clippy::struct_field_names,
    reason = "a study of the library, with what belongs to it"
)]
pub(crate) struct Study {
    pub(crate) study: FormFactorStudy,
    pub(crate) model: Arc<Shared>,
    pub(crate) settings: Settings,
    pub(crate) warnings: Vec<String>,
}

#[pyclass(frozen, module = "radiosity._core")]
pub(crate) struct FormFactors {
    pub(crate) of: Arc<Study>,
}

impl FormFactors {
    pub(crate) fn new(study: Study) -> Self {
        Self { of: Arc::new(study) }
    }
}

/// An array of numbers, \[n\].
type Column<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl FormFactors {
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.of.warnings.clone()
    }

    #[getter]
    fn settings(&self) -> String {
        serde_json::Value::from(self.of.settings.record()).to_string()
    }

    /// Returns the checks, as the program prints them.
    #[getter]
    fn record(&self) -> String {
        serde_json::to_string(&FormFactorRecord::from(&self.of.study)).unwrap_or_default()
    }

    #[getter]
    fn errors_known(&self) -> bool {
        self.of.study.errors_known
    }

    #[getter]
    fn is_symmetric(&self) -> bool {
        self.of.study.factors.is_symmetric()
    }

    #[getter]
    fn density(&self) -> f64 {
        self.of.study.factors.density()
    }

    fn row_sums<'py>(&self, py: Python<'py>) -> Column<'py> {
        let sums = py.detach(|| self.of.study.factors.row_sums());
        PyArray1::from_vec(py, sums)
    }

    /// Returns the escaping fraction of the light of each patch and the one that backs absorb, with their errors, and the error of the fraction that fronts receive.
    ///
    /// With `of_surfaces` these are means over surfaces.
    fn sky<'py>(&self, py: Python<'py>, of_surfaces: bool) -> [Column<'py>; 5] {
        let own = &self.of.study.sky;
        let means = of_surfaces.then(|| {
            let model = self.of.model.lock();
            own.of_surfaces(&model.mesh, model.scene.surfaces.len())
        });
        let found = means.as_ref().unwrap_or(own);
        let column = |all: &[Fraction], of: fn(&Fraction) -> f64| PyArray1::from_vec(py, all.iter().map(of).collect());
        [
            column(&found.sky, |fraction| fraction.value),
            column(&found.sky, |fraction| fraction.error()),
            column(&found.back, |fraction| fraction.value),
            column(&found.back, |fraction| fraction.error()),
            column(&found.received, |fraction| fraction.error()),
        ]
    }

    /// Returns the form factors between surfaces and their errors, \[s, s\], and the fraction of the light of each that no front receives.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<(Numbers<'py>, Numbers<'py>, Column<'py>)> {
        let (of_patch, n) = {
            let model = self.of.model.lock();
            let of_patch: Vec<u32> = model.mesh.patches.iter().map(|patch| patch.surface.0).collect();
            (of_patch, model.scene.surfaces.len())
        };
        let found = py.detach(|| self.of.study.factors.surface_form_factors(&of_patch, n));
        self.expect_readable(py)?;
        Ok((
            table(py, found.form_factor, n)?,
            table(py, found.error, n)?,
            PyArray1::from_vec(py, found.lost_factor),
        ))
    }

    /// Returns the entries of compressed sparse rows: values, errors, columns, and the end of each row, preceded by a 0.
    #[expect(clippy::type_complexity, reason = "four arrays")]
    fn rows<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Column<'py>,
        Column<'py>,
        Bound<'py, PyArray1<i64>>,
        Bound<'py, PyArray1<i64>>,
    )> {
        let factors = &self.of.study.factors;
        let (values, errors, columns, ends) = py.detach(|| {
            let (mut values, mut errors, mut columns) = (Vec::new(), Vec::new(), Vec::new());
            let mut ends = vec![0_i64];
            for i in 0..factors.n_rows() {
                factors.for_each_in_row(i, |j, value, error| {
                    values.push(value);
                    errors.push(error);
                    columns.push(i64::try_from(j).unwrap_or(i64::MAX));
                });
                ends.push(i64::try_from(values.len()).unwrap_or(i64::MAX));
            }
            (values, errors, columns, ends)
        });
        self.expect_readable(py)?;
        Ok((
            PyArray1::from_vec(py, values),
            PyArray1::from_vec(py, errors),
            PyArray1::from_vec(py, columns),
            PyArray1::from_vec(py, ends),
        ))
    }

    /// Returns F in full, or the errors of its entries, \[n, n\].
    fn full<'py>(&self, py: Python<'py>, errors: bool) -> PyResult<Numbers<'py>> {
        let factors = &self.of.study.factors;
        let n = factors.n_rows();
        let values = py.detach(|| {
            let mut values = vec![0.0; n * n];
            for (i, row) in values.chunks_exact_mut(n).enumerate() {
                let put = |j: usize, value: f64, error: f64| row[j] = if errors { error } else { value };
                if errors {
                    factors.for_each_error_in_row(i, put);
                } else {
                    factors.for_each_in_row(i, put);
                }
            }
            values
        });
        self.expect_readable(py)?;
        PyArray1::from_vec(py, values).reshape([n, n])
    }

    /// Returns F x, or Fᵀ x of exchange areas that are symmetric, \[n, c\].
    fn apply<'py>(&self, py: Python<'py>, x: PyReadonlyArray2<'_, f64>, transposed: bool) -> PyResult<Numbers<'py>> {
        let factors = &self.of.study.factors;
        let mut x = block(py, "x", &x, factors.n_rows())?;
        let y = py.detach(|| {
            let scale = |rows: &mut Block, by: &dyn Fn(f64) -> f64| {
                let n_channels = rows.n_channels();
                for (row, area) in rows.values_mut().chunks_exact_mut(n_channels).zip(factors.areas()) {
                    for value in row {
                        *value *= by(*area);
                    }
                }
            };
            // For symmetric exchange areas Fᵀ = A F A⁻¹.
            if transposed {
                scale(&mut x, &|area| 1.0 / area);
            }
            let mut y = Block::zeros(x.n_rows(), x.n_channels());
            factors.apply(&x, &mut y);
            if transposed {
                scale(&mut y, &|area| area);
            }
            y
        });
        self.expect_readable(py)?;
        array(py, &y)
    }

    /// Writes a file, in the format of its ending.
    #[pyo3(signature = (path, dense=false, surface=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, dense: bool, surface: Option<&str>) -> PyResult<()> {
        let of = &self.of;
        let call = Call {
            settings: of.settings.clone(),
            ..Call::default()
        };
        let known = match surface {
            Some(name) => {
                let found = of.model.lock().scene.surface_named(name);
                let missing = || bad_argument(py, &format!("surface: there is no surface \"{name}\""));
                Some(found.ok_or_else(missing)?)
            }
            None => None,
        };
        call.run(py, |cx| {
            let model = of.model.lock();
            let report = FormFactorReport {
                scene: &model.scene,
                mesh: &model.mesh,
                factors: &of.study.factors,
                tolerance_met: of.study.tolerance_met,
                pairs: of.study.pairs,
                sky: Some(&of.study.sky),
                settings: &cx.settings.record(),
                surface: known,
                is_closed: of.study.closed,
                dense,
            };
            Ok(report.write(&path)?)
        })?;
        Ok(())
    }
}

impl FormFactors {
    fn expect_readable(&self, py: Python<'_>) -> PyResult<()> {
        match self.of.study.factors.failure() {
            Some(error) => Err(crate::error::raised(py, &error.clone().into())),
            None => Ok(()),
        }
    }
}
