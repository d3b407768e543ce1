//! One spectral band: light from outside, its reflections, and the errors of the irradiance.

use super::network::{Network, State};
use crate::form_factor::Fraction;
use crate::matrix::FormFactors;
use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::{RadiositySystem, SolverError, carried, irradiance_error};

/// Form factors with the rest of each row.
#[derive(Clone, Copy)]
pub(crate) struct Enclosure<'a> {
    /// F.
    pub(crate) factors: &'a FormFactors,
    /// The fraction of the light of each patch that escapes, \[n\].
    pub(crate) sky: &'a [Fraction],
    /// The fraction of the light of each patch that black back faces absorb, \[n\].
    pub(crate) backs: &'a [Fraction],
    /// The rows that are known to sum to 1, \[n\].
    pub(crate) closed_rows: &'a [bool],
    /// The power gained per unit of radiosity where form factors lack reciprocity, m², \[n\].
    pub(crate) gain: &'a [f64],
}

/// The irradiance of patches from outside, before any reflection.
#[derive(Clone, Debug)]
pub(crate) struct Outside {
    /// Its irradiance, W·m⁻², \[n, c\].
    pub(crate) irradiance: Block,
    /// The error of the irradiance, W·m⁻², \[n, c\]; for the surroundings it excludes the error of the escaping fraction where that is the remainder of a row.
    pub(crate) error: Block,
    /// The radiosity of the surroundings, W·m⁻².
    pub(crate) radiosity: f64,
}

/// The light of a band on each patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// B, W·m⁻², \[n\].
    pub radiosity: Vec<f64>,
    /// The error of B by form factors and solver, W·m⁻², \[n\]; infinite where unknown.
    pub radiosity_error: Vec<f64>,
    /// H, light from outside included, W·m⁻², \[n\].
    pub irradiance: Vec<f64>,
    /// The error of H by form factors and solver, W·m⁻², \[n\]; infinite where unknown.
    pub irradiance_error: Vec<f64>,
    /// The errors of B and H by form factors and solver alone, W·m⁻², \[n\] each.
    ///
    /// In a thermal band, [`radiosity_error`](Self::radiosity_error) and [`irradiance_error`](Self::irradiance_error) also include the error of the solar light by the mesh.
    pub own_errors: [Vec<f64>; 2],
    /// The change of H by a mesh of about a quarter of the patches, W·m⁻², \[n\]; `None` where it is unknown.
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

    /// Sets the errors by form factors and solver to unknown.
    pub(crate) fn forget_errors(&mut self) {
        let [own_radiosity, own_irradiance] = &mut self.own_errors;
        let errors = [
            &mut self.radiosity_error,
            &mut self.irradiance_error,
            own_radiosity,
            own_irradiance,
        ];
        for own in errors {
            own.fill(f64::INFINITY);
        }
    }

    /// Returns the whole error of H of a patch, with that of the mesh.
    pub(super) fn irradiance_error_with_mesh(&self, i: usize) -> f64 {
        self.irradiance_error[i] + self.mesh_change.as_ref().map_or(0.0, |change| change[i].abs())
    }
}

impl Enclosure<'_> {
    /// Returns F x.
    pub(crate) fn received(&self, x: &Block) -> Block {
        let mut y = Block::zeros(x.n_rows(), x.n_channels());
        self.factors.apply(x, &mut y);
        y
    }

    /// Returns Σ_j F_ij as F applied to 1, \[n\].
    pub(crate) fn row_sums(&self) -> Vec<f64> {
        let ones = vec![1.0; self.sky.len()];
        self.received(&Block::from_values(ones, 1)).values().to_vec()
    }

    /// Returns the power that an `operator` R F gains where form factors lack reciprocity, m², \[n\].
    ///
    /// Σ_i A_i (R F)_ij = Σ_i A_i F_ij, as A R is symmetric and its rows sum to A where it mixes patches; only row sums change: g_j = Σ_i A_i F_ij − A_j Σ_k (R F)_jk.
    pub(crate) fn gain_of(&self, operator: &dyn LinearOperator) -> Vec<f64> {
        let ones = Block::from_values(vec![1.0; self.sky.len()], 1);
        let mut mixed = Block::zeros(self.sky.len(), 1);
        operator.apply(&ones, &mut mixed);
        let sums = self.row_sums().into_iter().zip(mixed.values());
        let known = self.gain.iter().zip(self.factors.areas());
        known
            .zip(sums)
            .map(|((gain, area), (own, now))| gain + area * (own - now))
            .collect()
    }

    /// Returns whether a row lets light out by its sum, with the criterion of [`RadiositySystem`].
    pub(crate) fn lets_out(&self, i: usize, row_sum: f64) -> bool {
        !self.closed_rows[i] && row_sum < 1.0 - f64::from(f32::EPSILON)
    }

    /// Returns the irradiance from surroundings of a radiosity in all channels, with its error.
    pub(crate) fn surroundings(&self, radiosity: f64, n_channels: usize) -> Outside {
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
            irradiance: Block::from_channels(&vec![
                self.sky.iter().map(|sky| sky.value * radiosity).collect();
                n_channels
            ]),
            error: Block::from_channels(&vec![(0..n).map(|i| error(i) * radiosity).collect(); n_channels]),
            radiosity,
        }
    }

    /// Returns whether the escaping fraction is 1 less the row sum, so that its errors and those of the row cancel.
    fn is_remainder(&self, i: usize) -> bool {
        self.sky[i].value > 0.0 && self.factors.tallies()[i].n_rays == 0
    }

    /// Returns the error of H = F B by the errors of form factors, W·m⁻², \[n, c\], for surroundings of the given radiosity.
    ///
    /// The errors of a row with known sum 1 cancel except for differences of radiosities, so they count relative to the irradiance itself. Those of a row whose remainder sees the surroundings
    /// count relative to the radiosity of these.
    fn wrong(&self, b: &Block, received: &Block, surroundings: f64) -> Block {
        let mut references = Block::zeros(b.n_rows(), b.n_channels());
        for i in 0..b.n_rows() {
            let own = references.row_mut(i);
            if self.closed_rows[i] {
                own.copy_from_slice(received.row(i));
            } else if self.is_remainder(i) {
                own.fill(surroundings);
            }
        }
        let mut wrong = irradiance_error(self.factors, b, received, Some(&references));
        for (i, row_sum) in self.row_sums().iter().enumerate().filter(|(i, _)| self.closed_rows[*i]) {
            let off = (1.0 - row_sum).abs();
            for (own, light) in wrong.row_mut(i).iter_mut().zip(received.row(i)) {
                *own += off * light.abs();
            }
        }
        wrong
    }
}

/// A band that is solved for several boundary conditions, each a channel, with the input of its errors.
pub(crate) struct Solved<'a> {
    pub(crate) enclosure: Enclosure<'a>,
    /// R F or F.
    pub(crate) operator: &'a dyn LinearOperator,
    /// The part of R that the operator omits, for each row.
    pub(crate) reflectance: &'a Block,
    pub(crate) outside: &'a Outside,
    /// The errors of the emitted light, W·m⁻², \[n, c\]: by form factors and solver, and with that of the mesh.
    pub(crate) emitted_error: [&'a Block; 2],
    /// The solver's residual, W·m⁻², \[n, c\].
    pub(crate) residual: &'a Block,
    pub(crate) converged: bool,
}

impl Solved<'_> {
    /// Returns the band of each channel with its errors by form factors, light from outside and solver; `reflect`: x ← R x.
    ///
    /// e = (I − R F)⁻¹ (R w + e_E + |r|) and e_H = F e + w, with w the error of H by the errors of F and of the light from outside. All terms are of first order, with the sum of all reflections as in
    /// [`carried_error`](crate::solver::carried_error).
    ///
    /// # Errors
    /// [`SolverError`] where form factors on a disk cannot be read.
    pub(crate) fn bands(&self, radiosity: &Block, reflect: impl Fn(&mut Block)) -> Result<Vec<Band>, SolverError> {
        let Self {
            enclosure,
            outside,
            residual,
            ..
        } = self;
        let areas = enclosure.factors.areas();
        let received = enclosure.received(radiosity);
        let mut wrong = enclosure.wrong(radiosity, &received, outside.radiosity);
        add(&mut wrong, &outside.error);
        let [own, all] = self.emitted_error;
        let own_errors = self.errors(own, &wrong, &received, &reflect)?;
        let with_mesh = if all == own {
            own_errors.clone()
        } else {
            self.errors(all, &wrong, &received, &reflect)?
        };
        let mut irradiance = received;
        add(&mut irradiance, &outside.irradiance);
        let of_channel = |c: usize| {
            let [radiosity_error, irradiance_error] = with_mesh.each_ref().map(|block| block.channel(c));
            let left_out = residual.channel(c);
            Band {
                radiosity: radiosity.channel(c),
                irradiance_error,
                radiosity_error,
                irradiance: irradiance.channel(c),
                own_errors: own_errors.each_ref().map(|block| block.channel(c)),
                mesh_change: None,
                residual_power: left_out.iter().zip(areas).map(|(r, area)| area * r.abs()).sum(),
            }
        };
        Ok((0..radiosity.n_channels()).map(of_channel).collect())
    }

    /// Returns the errors e of B and e_H of H; `emitted_error` is that of the emitted light and `wrong` that of H by form factors.
    fn errors(
        &self,
        emitted: &Block,
        wrong: &Block,
        received: &Block,
        reflect: &impl Fn(&mut Block),
    ) -> Result<[Block; 2], SolverError> {
        let mut source = wrong.clone();
        reflect(&mut source);
        let emitted = emitted.values().iter().zip(self.residual.values());
        for (s, (own, r)) in source.values_mut().iter_mut().zip(emitted) {
            *s += own + r.abs();
        }
        let error = self.carried(source, received, reflect)?;
        let mut known = error.clone();
        known
            .values_mut()
            .iter_mut()
            .filter(|e| !e.is_finite())
            .for_each(|e| *e = 0.0);
        let mut of_irradiance = self.enclosure.received(&known);
        add(&mut of_irradiance, wrong);
        for (own, e) in of_irradiance.values_mut().iter_mut().zip(error.values()) {
            if !e.is_finite() {
                *own = f64::INFINITY;
            }
        }
        Ok([error, of_irradiance])
    }

    fn carried(&self, source: Block, received: &Block, reflect: &impl Fn(&mut Block)) -> Result<Block, SolverError> {
        let (n, n_channels) = (source.n_rows(), source.n_channels());
        let unknown = || Block::from_values(vec![f64::INFINITY; n * n_channels], n_channels);
        let areas = self.enclosure.factors.areas().to_vec();
        let system = match RadiositySystem::new(self.operator, areas, self.reflectance.clone(), source) {
            Ok(system) => system,
            Err(error @ SolverError::Disk(_)) => return Err(error),
            // Errors that large, or an enclosure that lets out so little, have no estimate.
            Err(_) => return Ok(unknown()),
        };
        let mut sizes = received.clone();
        reflect(&mut sizes);
        sizes.values_mut().iter_mut().for_each(|x| *x = x.abs());
        let next = |light: &Block| {
            let mut wrong = self.enclosure.wrong(light, &self.enclosure.received(light), 0.0);
            reflect(&mut wrong);
            wrong
        };
        match carried(&system, self.converged.then_some(&sizes), next) {
            Ok(error) => Ok(error),
            Err(error @ SolverError::Disk(_)) => Err(error),
            Err(_) => Ok(unknown()),
        }
    }
}

/// Adds a block to another.
fn add(to: &mut Block, more: &Block) {
    to.values_mut()
        .iter_mut()
        .zip(more.values())
        .for_each(|(sum, x)| *sum += x);
}

/// Returns ρ of a solar band and E of each channel: B = (1 − α) (D + F B), \[n, c\]; `direct`: D, W·m⁻², \[n, c\].
pub(crate) fn solar_system(network: &Network, direct: &Block) -> (Block, Block) {
    let mut reflectance = Block::zeros(direct.n_rows(), direct.n_channels());
    for (i, absorptance) in network.absorptance.iter().enumerate() {
        reflectance.row_mut(i).fill(1.0 - absorptance);
    }
    let exitance = reflectance.values().iter().zip(direct.values()).map(|(rho, d)| rho * d);
    let exitance = Block::from_values(exitance.collect(), direct.n_channels());
    (reflectance, exitance)
}

/// Returns the exitance E of the thermal band, B = E + R F B, W·m⁻², and its errors by those of the absorbed solar heat, \[n\] each.
///
/// `outside`: the irradiance from outside, W·m⁻², \[n\]; `absorbed`: the absorbed solar heat and its error, W·m⁻², \[n\]; `own_error`: that error without the mesh's.
pub(crate) fn thermal_exitance(
    network: &Network,
    outside: Vec<f64>,
    absorbed: [&[f64]; 2],
    own_error: &[f64],
) -> (Vec<f64>, [Vec<f64>; 2]) {
    let mut irradiance = Block::from_values(outside, 1);
    network.reflect(&mut irradiance);
    let mut exitance = irradiance.values().to_vec();
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
