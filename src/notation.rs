//! Symbols, names in the code, units and shapes (n patches, c channels).
//!
//! | Symbol | Name in code | Meaning | Unit | Shape |
//! |---|---|---|---|---|
//! | F_ij | `form_factor` (also: view factor, configuration factor) | the fraction leaving patch i that reaches patch j | 1 | n × n |
//! | A_i | `area` | area of patch i | m² | n |
//! | A_i F_ij | `exchange_area` | symmetric by reciprocity | m² | n × n |
//! | ρ | `rho`, reflectance | the fraction of the irradiance that leaves again | 1 | n × c |
//! | E | `exitance` | self-emitted | W·m⁻² | n × c |
//! | H | `irradiance` | incident: H = F B | W·m⁻² | n × c |
//! | B | `radiosity` | leaving: B = E + ρ H | W·m⁻² | n × c |
//! | L | `radiance` | L = B / π for a diffuse surface | W·m⁻²·sr⁻¹ | n × c |
//! | V_ij | `visibility` | the visible fraction; yes or no is `occluded` | 1 | n × n |
//! | r | `residual` | r = E − (I − diag(ρ) F) B, this sign only | W·m⁻² | n × c |
//! | ΔB | `unshot` | radiosity not yet sent on | W·m⁻² | n × c |
//!
//! Lengths are metres. Normals follow the right-hand rule of a face's winding; a face sees on that side and blocks on both.
