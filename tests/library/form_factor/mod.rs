//! Form factors: every method, the errors that it states, and the files.

mod closed_rows;
mod drawn;
mod exact;
mod far_away;
mod far_emitters;
mod files;
mod form_factors;
mod formats;
mod interruption;
mod methods;
mod moved;
mod near_pairs;
mod properties;
mod rounded;
mod row_tolerance;
mod sky;
mod stated_coverage;
mod streets;
