//! Gebhart factors, script-F and conductors of a thermal network.

use std::ops::Range;

use super::band::Enclosure;
use super::network::Network;
use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::{Solution, irradiance_error};

/// The name of the node that absorbs all escaping radiation.
pub const SURROUNDINGS: &str = "surroundings";

/// The fractions of the radiation emitted by nodes that nodes absorb, directly and over all reflections.
///
/// G_ij is emitted by i and absorbed by j, script-F_ij = ε_i G_ij, and the conductor ε_i A_i G_ij, in m², times σ (T_i⁴ − T_j⁴) is the heat flow from i to j. The last node is the black surroundings,
/// which include the absorption of black back faces: rows sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ExchangeFactors {
    /// The names of the nodes, the surroundings last.
    pub names: Vec<String>,
    /// ε A of each node, m²; for the surroundings Σ A (s + b): of the light of a patch, the fraction s escapes and b meets black backs.
    pub emitting_area: Vec<f64>,
    /// The area-mean ε of each node; 1 for the surroundings.
    pub emissivity: Vec<f64>,
    /// G, \[m, m\], row by row.
    pub gebhart: Vec<f64>,
    /// The errors of G by form factors and solver, \[m, m\].
    pub gebhart_error: Vec<f64>,
}

/// The nodes without the surroundings.
pub(crate) struct Nodes {
    pub(crate) names: Vec<String>,
    /// The node of each patch, \[n\].
    pub(crate) of_patch: Vec<usize>,
}

/// Sums of absorbed radiation, accumulated while columns are computed.
pub(crate) struct Gathered<'a> {
    network: &'a Network,
    enclosure: Enclosure<'a>,
    nodes: Nodes,
    /// Σ ε A G by emitting node and column, and its error.
    absorbed: Vec<[f64; 2]>,
}

impl<'a> Gathered<'a> {
    pub(crate) fn new(network: &'a Network, enclosure: Enclosure<'a>, nodes: Nodes) -> Self {
        let m = nodes.names.len();
        Self {
            network,
            enclosure,
            absorbed: vec![[0.0; 2]; m * (m + 1)],
            nodes,
        }
    }

    /// Returns the number of columns of G.
    pub(crate) fn n_columns(&self) -> usize {
        self.nodes.names.len() + 1
    }

    /// Returns ρ and E of the systems whose irradiances are columns of G, \[n, c\] each: those of the nodes in a range, and of the surroundings.
    ///
    /// G = (I − F ρ)⁻¹ F ε column by column: H = D + F B and B = E + ρ H, with E = ε on the patches of a node and D = 0, or E = ρ D and D = s for the surroundings.
    pub(crate) fn system(&self, columns: &Range<usize>) -> (Block, Block) {
        let (n, c) = (self.network.n_patches(), columns.len());
        let (mut reflectance, mut exitance) = (Block::zeros(n, c), Block::zeros(n, c));
        for i in 0..n {
            let emissivity = self.network.emissivity[i];
            reflectance.row_mut(i).fill(1.0 - emissivity);
            for (value, column) in exitance.row_mut(i).iter_mut().zip(columns.clone()) {
                *value = if column == self.nodes.names.len() {
                    (1.0 - emissivity) * self.outside(i)
                } else if self.nodes.of_patch[i] == column {
                    emissivity
                } else {
                    0.0
                };
            }
        }
        (reflectance, exitance)
    }

    /// Returns the fraction of a patch's light that no front receives.
    fn outside(&self, i: usize) -> f64 {
        self.enclosure.sky[i].value + self.enclosure.backs[i].value
    }

    /// Adds the irradiances of a system; `carried`: the errors of its radiosities.
    pub(crate) fn take(&mut self, columns: &Range<usize>, solution: &Solution, carried: Option<&Block>) {
        let factors = self.enclosure.factors;
        let (b, h) = (&solution.radiosity, &solution.irradiance);
        let error = carried.map(|carried| {
            let mut error = irradiance_error(factors, b, h, None);
            let mut of_light = Block::zeros(b.n_rows(), b.n_channels());
            factors.apply(carried, &mut of_light);
            error
                .values_mut()
                .iter_mut()
                .zip(of_light.values())
                .for_each(|(e, x)| *e += x);
            error
        });
        let n_columns = self.nodes.names.len() + 1;
        for i in 0..b.n_rows() {
            let weight = self.network.areas()[i] * self.network.emissivity[i];
            let row = self.nodes.of_patch[i] * n_columns;
            for (k, column) in columns.clone().enumerate() {
                let is_last = column + 1 == n_columns;
                let direct = if is_last { self.outside(i) } else { 0.0 };
                let direct_error = if is_last {
                    self.enclosure.sky[i].error() + self.enclosure.backs[i].error()
                } else {
                    0.0
                };
                let own = &mut self.absorbed[row + column];
                own[0] += weight * (direct + h.row(i)[k]);
                own[1] += weight * (direct_error + error.as_ref().map_or(f64::INFINITY, |error| error.row(i)[k]));
            }
        }
    }

    /// Returns the factors, once all columns are added.
    ///
    /// Conductors are averaged with their reverse, which makes them symmetric. The surroundings emit Σ A (s + b), and the part of it that no node absorbs returns to them.
    pub(crate) fn factors(self) -> ExchangeFactors {
        let m = self.nodes.names.len();
        let (mut areas, mut emitting_area) = (vec![0.0; m], vec![0.0; m]);
        let mut sent_in = 0.0;
        for (i, &node) in self.nodes.of_patch.iter().enumerate() {
            let area = self.network.areas()[i];
            areas[node] += area;
            emitting_area[node] += area * self.network.emissivity[i];
            sent_in += area * self.outside(i);
        }
        let conductor = |i: usize, j: usize| self.absorbed[i * (m + 1) + j];
        let mut gebhart = Vec::with_capacity((m + 1) * (m + 1));
        let mut gebhart_error = Vec::with_capacity((m + 1) * (m + 1));
        for (i, &emitting) in emitting_area.iter().enumerate() {
            let row = (0..=m).map(|j| conductor(i, j).map(|x| if emitting > 0.0 { x / emitting } else { 0.0 }));
            for [value, error] in row {
                gebhart.push(value);
                gebhart_error.push(error);
            }
        }
        let to_last = |j: usize| conductor(j, m).map(|x| if sent_in > 0.0 { x / sent_in } else { 0.0 });
        let back = 1.0 - (0..m).map(|j| to_last(j)[0]).sum::<f64>();
        let back_error = (0..m).map(|j| to_last(j)[1]).sum();
        for [value, error] in (0..m).map(to_last).chain([[back, back_error]]) {
            gebhart.push(value);
            gebhart_error.push(error);
        }
        let mean = |(emitting, area): (&f64, &f64)| if *area > 0.0 { emitting / area } else { 1.0 };
        let emissivity = emitting_area.iter().zip(&areas).map(mean).chain([1.0]).collect();
        emitting_area.push(sent_in);
        let mut names = self.nodes.names;
        names.push(SURROUNDINGS.to_owned());
        ExchangeFactors {
            names,
            emitting_area,
            emissivity,
            gebhart,
            gebhart_error,
        }
    }
}

impl ExchangeFactors {
    /// Returns the number of nodes, the surroundings included.
    #[must_use]
    pub fn n_nodes(&self) -> usize {
        self.names.len()
    }

    /// Returns script-F, ε_i G_ij, \[m, m\].
    #[must_use]
    pub fn script_f(&self) -> Vec<f64> {
        let m = self.n_nodes();
        let entry = |(k, g): (usize, &f64)| self.emissivity[k / m] * g;
        self.gebhart.iter().enumerate().map(entry).collect()
    }

    /// Returns the conductors ε_i A_i G_ij, m², the mean of both directions, \[m, m\].
    #[must_use]
    pub fn conductance(&self) -> Vec<f64> {
        let m = self.n_nodes();
        let one_way = |i: usize, j: usize| self.emitting_area[i] * self.gebhart[i * m + j];
        let both = |k: usize| {
            let (i, j) = (k / m, k % m);
            0.5 * (one_way(i, j) + one_way(j, i))
        };
        (0..m * m).map(both).collect()
    }
}
