//! Deflation of Krylov methods by the even light of each connected component.

use super::scaled::{Scaled, TrueResidual};
use super::settings::SolverSettings;
use super::system::RadiositySystem;
use super::vectors::{add_scaled, equal_channels, inner, keep_channels, scale};
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Use, Value};

/// Whether a Krylov method deflates the even light of each component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Deflate {
    /// Where a component that emits has a mean reflectance above [`DEFLATED_FROM`].
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Whether the even light of each component is deflated in a Krylov method: a [`Deflate`].
pub static DEFLATION: Setting = Setting {
    name: "deflation",
    help: "Whether the even radiosity of each enclosure is deflated",
    letter: "DEFLATION",
    kind: Kind::Choice(Deflate::NAMES),
};

/// The setting, and the default.
pub(super) const DEFLATED: Use = DEFLATION.or(Value::Choice("auto"));

impl Deflate {
    /// The names, each with its description.
    pub const NAMES: &[(&str, &str)] = &[
        ("auto", "Where the mean reflectance is high enough to save time"),
        ("always", "Always"),
        ("never", "Never"),
    ];

    pub(super) fn with(settings: &SolverSettings) -> Option<Self> {
        match settings.values.get(&DEFLATION)?.choice()? {
            "auto" => Some(Self::Auto),
            "always" => Some(Self::Always),
            "never" => Some(Self::Never),
            _ => None,
        }
    }
}

/// The mean reflectance above which deflation saves more than it adds to the first pass and to the sums of each.
pub const DEFLATED_FROM: f64 = 0.4;

impl Deflate {
    /// Decides for each channel of a system alone, so that channels do not influence each other.
    fn channels(self, system: &RadiositySystem) -> Vec<bool> {
        match self {
            Self::Auto => {
                let means = system.greatest_mean_reflectances().iter();
                means.map(|mean| *mean > DEFLATED_FROM).collect()
            }
            Self::Always => vec![true; system.n_channels()],
            Self::Never => vec![false; system.n_channels()],
        }
    }
}

/// The images of even irradiances on all components.
pub(super) struct Sent {
    /// F ρ, \[n, c\]; 0 in channels without deflation.
    irradiance: Block,
    /// Whether a channel is deflated.
    channels: Vec<bool>,
}

/// Computes the residual of `radiosity`, and the images for deflation in the same pass over F, if any channel is deflated.
pub(super) fn first_pass(scaled: &Scaled, radiosity: &Block, deflate: Deflate) -> (TrueResidual, Option<Sent>) {
    let channels = deflate.channels(scaled.system);
    if !channels.contains(&true) {
        return (scaled.true_residual(radiosity), None);
    }
    let (reflectance, n_channels) = (scaled.system.reflectance(), radiosity.n_channels());
    let mut groups = equal_channels(reflectance);
    groups.retain(|group| group.iter().any(|&c| channels[c]));
    let mut both = Block::zeros(radiosity.n_rows(), n_channels + groups.len());
    let width = both.n_channels();
    let given = rows(radiosity).zip(rows(reflectance));
    for (row, (of_radiosity, of_reflectance)) in both.values_mut().chunks_exact_mut(width).zip(given) {
        let (own, even) = row.split_at_mut(n_channels);
        own.copy_from_slice(of_radiosity);
        for (value, group) in even.iter_mut().zip(&groups) {
            *value = of_reflectance[group[0]];
        }
    }
    let mut image = Block::zeros(both.n_rows(), width);
    scaled.system.operator().apply(&both, &mut image);
    let (mut irradiance, mut of_even) = (scaled.zeros(), scaled.zeros());
    let found = irradiance.values_mut().chunks_exact_mut(n_channels);
    let found = found.zip(of_even.values_mut().chunks_exact_mut(n_channels));
    for (row, (to_own, to_even)) in rows(&image).zip(found) {
        let (own, even) = row.split_at(n_channels);
        to_own.copy_from_slice(own);
        for (value, group) in even.iter().zip(&groups) {
            for &c in group.iter().filter(|c| channels[**c]) {
                to_even[c] = *value;
            }
        }
    }
    let sent = Sent {
        irradiance: of_even,
        channels,
    };
    (scaled.residual_of(radiosity, irradiance), Some(sent))
}

/// Returns the rows of a block.
fn rows(block: &Block) -> impl Iterator<Item = &[f64]> {
    block.values().chunks_exact(block.n_channels())
}

/// Sums and multiples by connected component.
struct ByComponent {
    labels: Vec<u32>,
    n_components: usize,
    /// A.
    weights: Vec<f64>,
}

impl ByComponent {
    fn new(system: &RadiositySystem, weights: &[f64]) -> Self {
        let components = system.components();
        Self {
            labels: components.labels.clone(),
            n_components: components.n_components,
            weights: weights.to_vec(),
        }
    }

    /// Returns Σ A u v over each component, \[components, c\].
    fn inner(&self, u: &Block, v: &Block) -> Block {
        if self.n_components == 1 {
            return Block::from_values(inner(&self.weights, u, v), u.n_channels());
        }
        let mut sums = Block::zeros(self.n_components, u.n_channels());
        for (i, (&label, weight)) in self.labels.iter().zip(&self.weights).enumerate() {
            let terms = u.row(i).iter().zip(v.row(i));
            for (sum, (a, b)) in sums.row_mut(label as usize).iter_mut().zip(terms) {
                *sum += weight * a * b;
            }
        }
        sums
    }

    /// to ← to + sign Σ amount_K v_K, v_K the part of `vectors` on component K.
    fn add(&self, to: &mut Block, vectors: &Block, amounts: &Block, sign: f64) {
        if self.n_components == 1 {
            let factors: Vec<f64> = amounts.values().iter().map(|amount| sign * amount).collect();
            return add_scaled(to, &factors, vectors);
        }
        for (i, &label) in self.labels.iter().enumerate() {
            let terms = vectors.row(i).iter().zip(amounts.row(label as usize));
            for (value, (v, amount)) in to.row_mut(i).iter_mut().zip(terms) {
                *value += sign * amount * v;
            }
        }
    }
}

/// The vectors z_K = ρ^½ on component K, 0 elsewhere (an even irradiance on K), with K z_K of the symmetric matrix
/// K = I − diag(ρ)^½ F diag(ρ)^½.
///
/// Light does not pass between components, so that ⟨z_K, K z_L⟩ = 0 for K ≠ L.
pub(super) struct Deflation {
    by_component: ByComponent,
    z: Block,
    kz: Block,
    /// 1 / ⟨z_K, K z_K⟩, \[components, c\]; 0 for a component without deflation.
    factors: Block,
}

/// The fraction of ⟨z, z⟩ below which ⟨z, K z⟩ is rounding, or negative.
///
/// Then the component is white and closed with undetermined even light, or K is not positive definite.
const RESOLVED_FROM: f64 = 1e-14;

impl Deflation {
    /// Sets up the vectors. `root`: ρ^½; `weights`: A.
    pub(super) fn new(system: &RadiositySystem, weights: &[f64], root: &Block, sent: Sent) -> Self {
        let by_component = ByComponent::new(system, weights);
        let mut kz = sent.irradiance;
        for (value, z) in kz.values_mut().iter_mut().zip(root.values()) {
            *value = z * (1.0 - *value);
        }
        let mut factors = by_component.inner(root, &kz);
        let lengths = by_component.inner(root, root);
        for (curvature, length) in factors.values_mut().iter_mut().zip(lengths.values()) {
            let resolved = *curvature > RESOLVED_FROM * length;
            *curvature = if resolved { curvature.recip() } else { 0.0 };
        }
        keep_channels(&mut factors, |c| sent.channels[c]);
        leave_undetermined(system, &mut factors);
        Self {
            by_component,
            z: root.clone(),
            kz,
            factors,
        }
    }

    /// Moves the even part of the residual into x in the channels that `need` it: x ← x + Z μ, r ← r − K Z μ.
    ///
    /// Then ⟨z_K, r⟩ = 0.
    pub(super) fn solve(&self, x: &mut Block, residual: &mut Block, need: impl Fn(usize) -> bool) {
        let mut amounts = self.amounts(&self.z, residual);
        keep_channels(&mut amounts, need);
        self.by_component.add(x, &self.z, &amounts, 1.0);
        self.by_component.add(residual, &self.kz, &amounts, -1.0);
    }

    /// Makes a direction conjugate to the vectors: p ← p − Σ z_K ⟨K z_K, u⟩ / ⟨z_K, K z_K⟩, u the part of p that is not conjugate yet.
    pub(super) fn project(&self, direction: &mut Block, of: &Block) {
        let amounts = self.amounts(&self.kz, of);
        self.by_component.add(direction, &self.z, &amounts, -1.0);
    }

    /// Returns ⟨v_K, u⟩ / ⟨z_K, K z_K⟩.
    fn amounts(&self, vectors: &Block, u: &Block) -> Block {
        let mut amounts = self.by_component.inner(vectors, u);
        scale(&mut amounts, &self.factors);
        amounts
    }
}

/// The vectors u_K = ρ on component K, 0 elsewhere (an even irradiance on K), and G u_K with G = I − diag(ρ) F.
///
/// They are in units in which ‖G u_K‖ = 1. Components share no patch, so that the images are orthonormal.
pub(super) struct EvenLight {
    by_component: ByComponent,
    u: Block,
    image: Block,
}

impl EvenLight {
    /// Sets up the vectors. `weights`: A.
    pub(super) fn new(system: &RadiositySystem, weights: &[f64], sent: Sent) -> Self {
        let by_component = ByComponent::new(system, weights);
        let mut u = system.reflectance().clone();
        let mut image = sent.irradiance;
        for (value, rho) in image.values_mut().iter_mut().zip(u.values()) {
            *value = rho - rho * *value;
        }
        let mut factors = by_component.inner(&image, &image);
        let lengths = by_component.inner(&u, &u);
        for (squared, length) in factors.values_mut().iter_mut().zip(lengths.values()) {
            let resolved = *squared > RESOLVED_FROM.powi(2) * length;
            *squared = if resolved { squared.sqrt().recip() } else { 0.0 };
        }
        keep_channels(&mut factors, |c| sent.channels[c]);
        leave_undetermined(system, &mut factors);
        for (i, &label) in by_component.labels.iter().enumerate() {
            for (c, factor) in factors.row(label as usize).iter().enumerate() {
                u.row_mut(i)[c] *= factor;
                image.row_mut(i)[c] *= factor;
            }
        }
        Self { by_component, u, image }
    }

    /// Returns ⟨G u_K, r⟩.
    pub(super) fn shares(&self, r: &Block) -> Block {
        self.by_component.inner(&self.image, r)
    }

    /// Returns zeros in the shape of [`shares`](Self::shares).
    pub(super) fn shares_of_none(&self, n_channels: usize) -> Block {
        Block::zeros(self.by_component.n_components, n_channels)
    }

    /// r ← r − Σ share_K G u_K.
    pub(super) fn take_out(&self, r: &mut Block, shares: &Block) {
        self.by_component.add(r, &self.image, shares, -1.0);
    }

    /// b ← b + sign Σ share_K u_K.
    pub(super) fn add(&self, radiosity: &mut Block, shares: &Block, sign: f64) {
        self.by_component.add(radiosity, &self.u, shares, sign);
    }
}

/// Sets the factors, \[components, c\], of components with undetermined even light to 0.
pub(super) fn leave_undetermined(system: &RadiositySystem, factors: &mut Block) {
    for c in 0..factors.n_channels() {
        for component in system.singular_components(c) {
            factors.row_mut(component as usize)[c] = 0.0;
        }
    }
}
