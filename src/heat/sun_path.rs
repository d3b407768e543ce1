//! The sun at a sequence of times.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::boundary::{OutOfRange, Sun};
use super::sun_position::{seconds, sun_position};

/// The sun at a sequence of times.
#[derive(Clone, Debug, PartialEq)]
pub struct SunPath {
    /// The name in messages: its file.
    pub file: PathBuf,
    /// The times, in increasing order.
    pub steps: Vec<SunStep>,
    /// True if times are dates: [`SunStep::time`] is then in s from the first, else in the unit of the file.
    pub has_dates: bool,
    angular_radius_deg: f64,
    axes: [DVec3; 2],
    /// The time of the first step, s from 1970.
    begin: f64,
}

/// The sun at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SunStep {
    /// The line of the file, from 1.
    pub line: usize,
    /// The time as a number.
    pub time: f64,
    /// The time as the file writes it.
    pub time_text: String,
    /// The unit vector towards the sun.
    pub direction: DVec3,
    /// The sun; `None` where it is below the horizon of its place on Earth, or has no irradiance.
    pub sun: Option<Sun>,
}

/// The position of the sun at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SunPlace {
    /// A direction of any length.
    Direction(DVec3),
    /// The position in the sky of a place on Earth.
    OnEarth {
        /// Degrees north.
        latitude: f64,
        /// Degrees east.
        longitude: f64,
    },
}

impl SunPath {
    /// Returns a path without steps of a sun whose disc has an angular radius in degrees; `axes`: north and up of the scene, for places on Earth.
    #[must_use]
    pub fn new(file: &Path, angular_radius_deg: f64, axes: [DVec3; 2]) -> Self {
        Self {
            file: file.to_owned(),
            steps: Vec::new(),
            has_dates: false,
            angular_radius_deg,
            axes,
            begin: 0.0,
        }
    }

    /// Adds the sun at a `time` from `line` of the file: a number, or a date with time and offset in RFC 3339.
    ///
    /// `irradiance` is that of a plane that faces the sun, W·m⁻².
    ///
    /// # Errors
    /// The name of the value and the fault: a time that is neither a number nor a date, not after the previous one, or not of the same kind as it;
    /// faults of [`Sun::new`] and [`sun_direction`](super::sun_direction), except a sun below the horizon.
    pub fn push(
        &mut self,
        line: usize,
        time: &str,
        place: SunPlace,
        irradiance: f64,
    ) -> Result<(), (&'static str, String)> {
        let number = time.parse().ok().filter(|number: &f64| number.is_finite());
        let is_date = number.is_none();
        let (own, direction, is_up) = match (place, number) {
            (SunPlace::Direction(direction), Some(number)) => (number, direction, true),
            (SunPlace::Direction(direction), None) => {
                let found = seconds(time).map_err(|(key, wrong)| (key, format!("{wrong}, or as a number")))?;
                (found, direction, true)
            }
            (SunPlace::OnEarth { latitude, longitude }, _) => {
                let found = sun_position((latitude, longitude), time, self.axes)?;
                (found.time_s, found.direction, found.height_deg > 0.0)
            }
        };
        if self.steps.is_empty() {
            self.has_dates = is_date;
            self.begin = if is_date { own } else { 0.0 };
        }
        let sun = Sun::new(direction, irradiance, self.angular_radius_deg)
            .map_err(|(key, wrong)| (if key == "irradiance_w_m2" { "irradiance" } else { key }, wrong))?;
        let time_number = self.after_the_last(own - self.begin, is_date)?;
        self.steps.push(SunStep {
            line,
            time: time_number,
            time_text: time.to_owned(),
            direction: sun.direction(),
            sun: (is_up && irradiance > 0.0).then_some(sun),
        });
        Ok(())
    }

    /// Refuses a time that is of the other kind, or not after the last.
    fn after_the_last(&self, time: f64, is_date: bool) -> Result<f64, OutOfRange> {
        let wrong = match self.steps.last() {
            Some(_) if is_date != self.has_dates => "some times are numbers, others dates; write all in one way".into(),
            Some(last) if time <= last.time => format!("not after `{}` before it; sort the rows", last.time_text),
            _ => return Ok(time),
        };
        Err(("time", wrong))
    }

    /// Returns the times as numbers.
    #[must_use]
    pub fn times(&self) -> Vec<f64> {
        self.steps.iter().map(|step| step.time).collect()
    }

    /// Returns the times as texts.
    #[must_use]
    pub fn texts(&self) -> Vec<String> {
        self.steps.iter().map(|step| step.time_text.clone()).collect()
    }

    /// Returns the unit of the times: seconds for dates, else that of the file.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if self.has_dates { "s" } else { "as given" }
    }
}
