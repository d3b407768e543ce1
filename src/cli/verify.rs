//! `radiosity verify`.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::VerifyArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::{Outcome, SCHEMA_VERSION};
use crate::render::verify;
use crate::report::StageTimes;
