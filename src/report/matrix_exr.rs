//! Writes form factors as an image: one pixel each, row i downwards, column j to the right.

use std::io::{Seek, Write};

use ::exr::error::Error;
use ::exr::image::{Encoding, Image, Layer, SpecificChannels};
use ::exr::math::Vec2;
use ::exr::meta::attribute::{AttributeValue, LineOrder, Text};
use ::exr::meta::header::LayerAttributes;
use ::exr::prelude::{Blocks, Compression, WritableImage};

use super::Description;
use crate::matrix::FormFactors;

/// Writes the channels `Y`, the form factors, and `error`, their standard errors, in f32.
///
/// The description is the attribute `radiosity`. Source: Lewis 1992, figure 1. Departures: brightness is left to the viewer.
pub(super) fn write(
    writer: &mut (impl Write + Seek),
    factors: &FormFactors,
    description: &Description,
) -> Result<(), Error> {
    let n = factors.n_rows();
    #[expect(clippy::cast_possible_truncation, reason = "pixels are f32")]
    let pixel = |at: Vec2<usize>| {
        let (i, j) = (at.y(), at.x());
        (factors.get(i, j) as f32, factors.std_error(i, j) as f32)
    };
    let channels = SpecificChannels::build()
        .with_channel::<f32>("Y")
        .with_channel::<f32>("error")
        .with_pixel_fn(pixel);
    let mut attributes = LayerAttributes::default();
    let text = Text::from(description.to_json().as_str());
    attributes.other.insert("radiosity".into(), AttributeValue::Text(text));
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new((n, n), attributes, encoding, channels);
    Image::from_layer(layer).write().to_buffered(writer)
}
