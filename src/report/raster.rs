//! Pixels from a drawing.

use std::sync::{Arc, OnceLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, fontdb};

/// Why a drawing could not be turned into pixels.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The SVG cannot be read.
    #[error("the drawing is not readable SVG: {0}")]
    Svg(#[from] usvg::Error),
    /// The image would have no pixel, or more than memory holds.
    #[error("an image of {width} × {height} pixels cannot be made")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The PNG encoder failed.
    #[error("the image cannot be encoded: {0}")]
    Encode(String),
}

/// Returns a PNG of an SVG drawing, `scale` pixels to its unit of length.
///
/// Text is drawn in DejaVu Sans, which comes with the program, whatever fonts the drawing names: equal drawings give equal
/// bytes on every machine.
///
/// # Errors
/// [`RasterError`] if the drawing cannot be read, or the image is too large.
pub fn png_from_svg(svg: &str, scale: f32) -> Result<Vec<u8>, RasterError> {
    let options = usvg::Options {
        font_family: "DejaVu Sans".to_owned(),
        fontdb: fonts(),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(svg, &options)?;
    let size = tree.size().to_int_size().scale_by(scale);
    let size = size.ok_or(RasterError::Size { width: 0, height: 0 })?;
    let (width, height) = (size.width(), size.height());
    let mut pixels = Pixmap::new(width, height).ok_or(RasterError::Size { width, height })?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels
        .encode_png()
        .map_err(|error| RasterError::Encode(error.to_string()))
}

fn fonts() -> Arc<fontdb::Database> {
    static FONTS: OnceLock<Arc<fontdb::Database>> = OnceLock::new();
    FONTS
        .get_or_init(|| {
            let mut fonts = fontdb::Database::new();
            fonts.load_font_data(dejavu::sans::regular().to_vec());
            fonts.load_font_data(dejavu::sans::bold().to_vec());
            fonts.set_sans_serif_family("DejaVu Sans");
            Arc::new(fonts)
        })
        .clone()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn dark_pixels(svg: &str) -> usize {
        let bytes = png_from_svg(svg, 1.0).unwrap();
        let image = Pixmap::decode_png(&bytes).unwrap();
        assert_eq!((image.width(), image.height()), (60, 20));
        image
            .pixels()
            .iter()
            .filter(|p| p.red() < 100 && p.alpha() > 128)
            .count()
    }

    #[test]
    fn text_is_drawn_without_any_font_of_the_system() {
        let drawing = |text: &str| {
            format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="60" height="20"><rect width="60" height="20" fill="white"/><text x="2" y="15" font-family="sans-serif" font-size="14">{text}</text></svg>"#
            )
        };
        assert_eq!(dark_pixels(&drawing("")), 0);
        assert!(dark_pixels(&drawing("10⁻³")) > 20);
        assert!(matches!(png_from_svg("no drawing", 1.0), Err(RasterError::Svg(_))));
    }
}
