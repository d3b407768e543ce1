//! Free points: their view factors and irradiances.

use super::{Context, HeatStudy, Model, WorkflowError};
use crate::heat::{Boundary, PointQuery, PointScene, PointView};

/// The number of points between two checks for an interruption.
const AT_ONCE: usize = 1024;

impl Model {
    /// Returns the factors from free points to all surfaces, and with the heat of the scene the irradiance.
    ///
    /// `with_person` includes the sun in the mean radiant temperature as a standing person absorbs it.
    ///
    /// # Errors
    /// [`WorkflowError::Interrupted`].
    pub fn points(
        &self,
        queries: &[PointQuery],
        heat: Option<(&HeatStudy, &Boundary)>,
        with_person: bool,
        cx: &Context,
    ) -> Result<Vec<PointView>, WorkflowError> {
        let looked_at = PointScene {
            scene: &self.scene,
            mesh: &self.mesh,
            heat: heat.map(|(study, boundary)| ([&study.heat.thermal, &study.heat.solar], boundary)),
            with_person,
        };
        let watch = cx.progress();
        crate::progress::Progress::begin(&watch, "points", queries.len() as u64);
        let views = cx.time("points", || looked_at.views());
        let mut found = Vec::with_capacity(queries.len());
        for some in queries.chunks(AT_ONCE) {
            found.extend(cx.time("points", || looked_at.look(&views, some)));
            crate::progress::Progress::advance(&watch, some.len() as u64);
            cx.go_on()?;
        }
        Ok(found)
    }
}
