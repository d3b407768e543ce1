//! The view of an unfolded layout.

use std::num::NonZeroU32;

use super::error::RenderError;
use super::unfolded::Unfolded;
use super::view::{Sight, View, ViewDescription};
use crate::scene::Scene;

/// The [`View`] of an [`Unfolded`] layout.
#[derive(Clone, Debug)]
pub struct UnfoldedView {
    layout: Unfolded,
    /// The tile of every pixel, `u32::MAX` for background.
    tile_of_pixel: Vec<u32>,
}

impl UnfoldedView {
    /// Prepares a layout for rendering.
    ///
    /// # Errors
    /// As [`Unfolded::new`].
    pub fn new(scene: &Scene, n_pixels: NonZeroU32) -> Result<Self, RenderError> {
        let layout = Unfolded::new(scene, n_pixels)?;
        let width = layout.width as usize;
        let mut tile_of_pixel = vec![u32::MAX; width * layout.height as usize];
        for (index, tile) in (0..).zip(&layout.tiles) {
            for row in tile.top..tile.top + tile.height {
                let start = row as usize * width + tile.left as usize;
                tile_of_pixel[start..start + tile.width as usize].fill(index);
            }
        }
        Ok(Self { layout, tile_of_pixel })
    }

    /// Returns the layout.
    #[must_use]
    pub fn layout(&self) -> &Unfolded {
        &self.layout
    }
}

impl View for UnfoldedView {
    fn size(&self) -> (u32, u32) {
        (self.layout.width, self.layout.height)
    }

    fn sight(&self, x: f64, y: f64) -> Option<Sight> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "coordinates inside the image; outside it the look-up fails or is cut to the border"
        )]
        let (column, row) = (x.floor() as usize, y.floor() as usize);
        let index = self.tile_of_pixel.get(row * self.layout.width as usize + column)?;
        let tile = self.layout.tiles.get(*index as usize)?;
        Some(Sight::Point {
            point: tile.point(x, y),
            normal: tile.normal(),
            clearance: tile.deviation,
            surface: tile.surface,
        })
    }

    fn description(&self) -> ViewDescription {
        ViewDescription::Unfolded(self.layout.clone())
    }
}
