//! One spectral band: light from outside, its reflections, and the errors of the irradiance.

use super::network::{Network, State};
use crate::form_factor::Fraction;
use crate::matrix::FormFactors;
use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::{RadiositySystem, SolverError, carried, irradiance_error};

/// Form factors with what is known of the rest of each row.
#[derive(Clone, Copy)]
pub(crate) struct Enclosure<'a> {
    /// F.
    pub(crate) factors: &'a FormFactors,
    /// The fraction of the light of each patch that escapes, \[n\].
    pub(crate) sky: &'a [Fraction],
    /// The fraction that black backs take, \[n\].
    pub(crate) backs: &'a [Fraction],
    /// The rows that are known to sum to 1, \[n\].
    pub(crate) closed_rows: &'a [bool],
    /// The power that form factors without reciprocity make, m², \[n\].
    pub(crate) gain: &'a [f64],
}

/// The irradiance of patches from outside, before any reflection.
#[derive(Clone, Debug)]
pub(crate) struct Outside {
    /// Its irradiance, W·m⁻², \[n\].
    pub(crate) irradiance: Vec<f64>,
    /// The error of that, W·m⁻², \[n\]; of the surroundings without the error of what escapes, where that is the remainder of a row.
    pub(crate) error: Vec<f64>,
    /// The radiosity of the surroundings, W·m⁻².
    pub(crate) radiosity: f64,
}

/// The light of a band on each patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// B, W·m⁻², \[n\].
    pub radiosity: Vec<f64>,
    /// The error of B by form factors and solver, W·m⁻², \[n\]; infinite where nothing is known.
    pub radiosity_error: Vec<f64>,
    /// H, light from outside included, W·m⁻², \[n\].
    pub irradiance: Vec<f64>,
    /// The error of H by form factors and solver, W·m⁻², \[n\]; infinite where nothing is known.
    pub irradiance_error: Vec<f64>,
    /// The errors of B and H by form factors and solver alone, W·m⁻², \[n\] each: those of a thermal band have that of the solar light by the mesh too.
    pub own_errors: [Vec<f64>; 2],
    /// The change by a mesh of about a quarter of the patches in H, W·m⁻², \[n\]; `None` where that is not known.
    pub mesh_change: Option<Vec<f64>>,
    /// Σ A |r|, the power that the solver left out, W.
    pub residual_power: f64,
}

impl Band {
    /// Returns a band without light.
    #[must_use]
    pub fn dark(n_patches: usize) -> Self {
        let zeros = || vec![0.0; n_patches];
        Self {
            radiosity: zeros(),
            radiosity_error: zeros(),
            irradiance: zeros(),
            irradiance_error: zeros(),
            own_errors: [zeros(), zeros()],
            mesh_change: Some(zeros()),
            residual_power: 0.0,
        }
    }

    /// Returns the whole error of H of a patch, that of the mesh included.
    pub(super) fn irradiance_error_with_mesh(&self, i: usize) -> f64 {
        self.irradiance_error[i] + self.mesh_change.as_ref().map_or(0.0, |change| change[i].abs())
    }
}

impl Enclosure<'_> {
    /// Returns F x.
    pub(crate) fn received(&self, x: &[f64]) -> Vec<f64> {
        let mut y = Block::zeros(x.len(), 1);
        self.factors.apply(&Block::from_values(x.to_vec(), 1), &mut y);
        y.values().to_vec()
    }

    /// Returns whether a row lets light out, as [`RadiositySystem`] judges it from row sums s.
    pub(crate) fn lets_out(&self, i: usize, row_sum: f64) -> bool {
        !self.closed_rows[i] && row_sum < 1.0 - f64::from(f32::EPSILON)
    }

    /// Returns the irradiance from surroundings of a radiosity, with its error.
    pub(crate) fn surroundings(&self, radiosity: f64) -> Outside {
        let n = self.sky.len();
        let error = |i: usize| {
            let [sky, back] = [self.sky[i].error(), self.backs[i].error()];
            match () {
                () if self.closed_rows[i] => sky + back,
                () if self.is_remainder(i) => back,
                () => sky,
            }
        };
        Outside {
            irradiance: self.sky.iter().map(|sky| sky.value * radiosity).collect(),
            error: (0..n).map(|i| error(i) * radiosity).collect(),
            radiosity,
        }
    }

    /// Tells whether what escapes is what the form factors of a row leave of 1: then their errors and its own cancel.
    fn is_remainder(&self, i: usize) -> bool {
        self.sky[i].value > 0.0 && self.factors.tallies()[i].n_rays == 0
    }

    /// Returns what the errors of form factors make wrong of H = F B, W·m⁻², \[n\]; the surroundings have a `radiosity` of their own.
    ///
    /// The errors of a row that is known to sum to 1 cancel but for the differences of radiosities: they count relative to the irradiance itself. So do those of a row whose remainder sees the surroundings,
    /// relative to these.
    fn wrong(&self, b: &[f64], received: &[f64], surroundings: f64) -> Vec<f64> {
        let reference = |i: usize| match () {
            () if self.closed_rows[i] => received[i],
            () if self.is_remainder(i) => surroundings,
            () => 0.0,
        };
        let references: Vec<f64> = (0..b.len()).map(reference).collect();
        let [light, irradiance] = [b, received].map(|x| Block::from_values(x.to_vec(), 1));
        let wrong = irradiance_error(self.factors, &light, &irradiance, Some(&references));
        let row_sums = self.received(&vec![1.0; b.len()]);
        let of_row = |(i, own): (usize, &f64)| {
            let off = if self.closed_rows[i] {
                (1.0 - row_sums[i]).abs()
            } else {
                0.0
            };
            own + off * received[i].abs()
        };
        wrong.values().iter().enumerate().map(of_row).collect()
    }
}

/// A band that is solved, and what its errors depend on.
pub(crate) struct Solved<'a> {
    pub(crate) enclosure: Enclosure<'a>,
    /// R F or F.
    pub(crate) operator: &'a dyn LinearOperator,
    /// What of each row the operator leaves out of R.
    pub(crate) reflectance: &'a Block,
    pub(crate) outside: &'a Outside,
    /// The error of what is emitted, W·m⁻², \[n\]: by form factors and solver, and that of the mesh included.
    pub(crate) emitted_error: [&'a [f64]; 2],
    /// The solver's residual, W·m⁻², \[n\].
    pub(crate) residual: &'a [f64],
    pub(crate) converged: bool,
}

impl Solved<'_> {
    /// Returns the band with the errors that come from form factors, from outside and from the solver; `reflect`: x ← R x.
    ///
    /// e = (I − R F)⁻¹ (R w + e_E + |r|) and e_H = F e + w, with w what is wrong of H by the errors of F and of the light from outside. All of it is to first order, with the sum of all orders as in
    /// [`carried_error`](crate::solver::carried_error).
    ///
    /// # Errors
    /// [`SolverError`] where form factors on a disk cannot be read.
    pub(crate) fn band(&self, radiosity: &[f64], reflect: impl Fn(&mut [f64])) -> Result<Band, SolverError> {
        let Self {
            enclosure,
            outside,
            residual,
            ..
        } = self;
        let areas = enclosure.factors.areas();
        let received = enclosure.received(radiosity);
        let mut wrong = enclosure.wrong(radiosity, &received, outside.radiosity);
        wrong.iter_mut().zip(&outside.error).for_each(|(w, own)| *w += own);
        let [own, all] = self.emitted_error;
        let own_errors = self.errors(own, &wrong, &received, &reflect)?;
        let [radiosity_error, irradiance_error] = if all == own {
            own_errors.clone()
        } else {
            self.errors(all, &wrong, &received, &reflect)?
        };
        let sum = |(r, area): (&f64, &f64)| area * r.abs();
        Ok(Band {
            radiosity: radiosity.to_vec(),
            irradiance_error,
            radiosity_error,
            irradiance: received.iter().zip(&outside.irradiance).map(|(f, d)| f + d).collect(),
            own_errors,
            mesh_change: None,
            residual_power: residual.iter().zip(areas).map(sum).sum(),
        })
    }

    /// Returns the errors e of B and e_H of H, where what is emitted has an error of its own and `wrong` is what is wrong of H.
    fn errors(
        &self,
        emitted: &[f64],
        wrong: &[f64],
        received: &[f64],
        reflect: &impl Fn(&mut [f64]),
    ) -> Result<[Vec<f64>; 2], SolverError> {
        let mut source = wrong.to_vec();
        reflect(&mut source);
        for ((s, own), r) in source.iter_mut().zip(emitted).zip(self.residual) {
            *s += own + r.abs();
        }
        let error = self.carried(source, received, reflect)?;
        let known: Vec<f64> = error.iter().map(|e| if e.is_finite() { *e } else { 0.0 }).collect();
        let of_error = self.enclosure.received(&known);
        let all = |(i, e): (usize, &f64)| {
            if e.is_finite() {
                of_error[i] + wrong[i]
            } else {
                f64::INFINITY
            }
        };
        let of_irradiance = error.iter().enumerate().map(all).collect();
        Ok([error, of_irradiance])
    }

    fn carried(
        &self,
        source: Vec<f64>,
        received: &[f64],
        reflect: &impl Fn(&mut [f64]),
    ) -> Result<Vec<f64>, SolverError> {
        let n = source.len();
        let areas = self.enclosure.factors.areas().to_vec();
        let unknown = vec![f64::INFINITY; n];
        let built = RadiositySystem::new(
            self.operator,
            areas,
            self.reflectance.clone(),
            Block::from_values(source, 1),
        );
        let system = match built {
            Ok(system) => system,
            Err(error @ SolverError::Disk(_)) => return Err(error),
            // Errors so great, or an enclosure that lets out so little, have no estimate.
            Err(_) => return Ok(unknown),
        };
        let mut reflected = received.to_vec();
        reflect(&mut reflected);
        let sizes = || reflected.iter().map(|x| x.abs()).collect();
        let sizes = self.converged.then(|| Block::from_values(sizes(), 1));
        let next = |error: &Block| {
            let light = error.values();
            let mut wrong = self.enclosure.wrong(light, &self.enclosure.received(light), 0.0);
            reflect(&mut wrong);
            Block::from_values(wrong, 1)
        };
        match carried(&system, sizes.as_ref(), next) {
            Ok(error) => Ok(error.values().to_vec()),
            Err(error @ SolverError::Disk(_)) => Err(error),
            Err(_) => Ok(unknown),
        }
    }
}

/// Returns ρ and E of a solar band: B = (1 − α) (D + F B), \[n, 1\].
pub(crate) fn solar_system(network: &Network, direct: &[f64]) -> (Block, Block) {
    let reflectance: Vec<f64> = network
        .absorptance
        .iter()
        .map(|absorptance| 1.0 - absorptance)
        .collect();
    let exitance = reflectance.iter().zip(direct).map(|(rho, d)| rho * d).collect();
    (Block::from_values(reflectance, 1), Block::from_values(exitance, 1))
}

/// Returns the exitance of the thermal band, E of B = E + R F B, W·m⁻², and its errors by those of what is absorbed of the sun, \[n\] each.
///
/// `absorbed`: the absorbed solar heat and its error, W·m⁻², \[n\]; `own_error`: that error without the mesh's.
pub(crate) fn thermal_exitance(
    network: &Network,
    outside: &Outside,
    absorbed: [&[f64]; 2],
    own_error: &[f64],
) -> (Vec<f64>, [Vec<f64>; 2]) {
    let mut exitance = outside.irradiance.clone();
    network.reflect(&mut exitance);
    let mut errors = [own_error, absorbed[1]].map(|_| vec![0.0; exitance.len()]);
    let heats = network.heats(absorbed);
    let own_heats = network.heats([absorbed[0], own_error]);
    for (i, state) in network.state.iter().enumerate() {
        let emissivity = network.emissivity[i];
        match *state {
            State::Given(kelvin) => exitance[i] += emissivity * super::emissive_power(kelvin),
            State::Member(group) => {
                let emitted = |heat: f64| emissivity * heat / network.groups[group].absorbing;
                exitance[i] += emitted(heats[group][0]);
                errors[0][i] = emitted(own_heats[group][1]);
                errors[1][i] = emitted(heats[group][1]);
            }
        }
    }
    (exitance, errors)
}
