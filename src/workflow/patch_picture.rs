//! Images of the values of patches.

use super::{Context, ImageView, Model, WorkflowError};
use crate::matrix::operator::Block;
use crate::render::{Outdoors, RenderInput, RenderSettings, render};

impl Model {
    /// Returns the value of the patch at the centre of each pixel, row by row from the top, and the number of pixels in a row.
    ///
    /// A value is `None` where no front of a face is visible.
    ///
    /// # Errors
    /// [`WorkflowError::Render`].
    ///
    /// # Panics
    /// If there is not one value for each patch.
    pub fn picture_of(
        &self,
        view: &ImageView,
        values: &[f64],
        cx: &Context,
    ) -> Result<(usize, Vec<Option<f64>>), WorkflowError> {
        assert_eq!(values.len(), self.mesh.n_patches(), "one value for each patch");
        let dark = Block::zeros(values.len(), 1);
        let input = RenderInput {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            radiosity: &dark,
            irradiance: &dark,
            indirect_irradiance: None,
            error: None,
            outdoors: Outdoors::default(),
        };
        let settings = RenderSettings {
            flat: true,
            ..RenderSettings::default()
        };
        let image = render(&input, view.as_view(), &settings, &cx.progress())?;
        let patches = image.u32("patch").unwrap_or_default();
        let value = |&patch: &u32| values.get(patch as usize).copied();
        Ok((image.width(), patches.iter().map(value).collect()))
    }
}
