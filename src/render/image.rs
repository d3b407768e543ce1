//! An image in memory: named layers of equal size.

use glam::DVec3;

use super::error::RenderError;

/// The greatest number of pixels of an image.
const MAX_PIXELS: u64 = 1 << 31;

/// The samples of one layer, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit unsigned integers, such as ids.
    U32(Vec<u32>),
}

impl Samples {
    fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }
}

/// One named channel of an [`Image`].
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// The name in an EXR file, such as `R` or `irradiance.R`.
    pub name: String,
    /// One sample per pixel.
    pub samples: Samples,
}

impl Layer {
    /// Returns whether the layer shows light: `R`, `G`, `B`, `irradiance.*`, `radiosity.*` or `direct.*`.
    #[must_use]
    pub fn is_light(&self) -> bool {
        let starts = ["irradiance.", "radiosity.", "direct."];
        ["R", "G", "B"].contains(&self.name.as_str()) || starts.iter().any(|start| self.name.starts_with(start))
    }
}

/// Named layers of width × height samples, in the order of their names' bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    layers: Vec<Layer>,
}

impl Image {
    /// Returns an image without layers.
    #[must_use]
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            layers: Vec::new(),
        }
    }

    /// Returns the width in pixels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the height in pixels.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns all layers, ordered by name.
    #[must_use]
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Returns the layers, ordered by name, and consumes the image.
    #[must_use]
    pub fn into_layers(self) -> Vec<Layer> {
        self.layers
    }

    /// Adds a layer, or replaces the one of that name.
    ///
    /// # Panics
    /// If `samples` does not hold width × height values.
    #[track_caller]
    pub fn insert(&mut self, name: &str, samples: Samples) {
        assert_eq!(samples.len(), self.width * self.height, "one sample per pixel");
        let layer = Layer {
            name: name.to_owned(),
            samples,
        };
        match self.layers.binary_search_by(|other| other.name.as_str().cmp(name)) {
            Ok(k) => self.layers[k] = layer,
            Err(k) => self.layers.insert(k, layer),
        }
    }

    /// Returns the samples of a layer of floats.
    #[must_use]
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        match self.samples(name)? {
            Samples::F32(values) => Some(values),
            Samples::U32(_) => None,
        }
    }

    /// Returns the samples of a layer of integers.
    #[must_use]
    pub fn u32(&self, name: &str) -> Option<&[u32]> {
        match self.samples(name)? {
            Samples::U32(values) => Some(values),
            Samples::F32(_) => None,
        }
    }

    /// Returns whether some pixel shows, at its centre, a face whose normal points to the side of `eye`.
    ///
    /// # Panics
    /// If the image lacks the layers `patch`, `P` or `N`, which every rendered image has.
    #[must_use]
    #[track_caller]
    pub fn shows_a_front(&self, eye: DVec3) -> bool {
        let layer = |prefix: &str| {
            channel_names(prefix, ['X', 'Y', 'Z'])
                .map(|name| self.f32(&name).unwrap_or_else(|| panic!("no layer {name}")))
        };
        let (points, normals) = (layer("P"), layer("N"));
        let patches = self.u32("patch").unwrap_or_else(|| panic!("no layer patch"));
        let at = |axes: [&[f32]; 3], k: usize| DVec3::from_array(axes.map(|values| f64::from(values[k])));
        (0..patches.len()).any(|k| patches[k] != u32::MAX && at(normals, k).dot(eye - at(points, k)) > 0.0)
    }

    fn samples(&self, name: &str) -> Option<&Samples> {
        let k = self
            .layers
            .binary_search_by(|layer| layer.name.as_str().cmp(name))
            .ok()?;
        Some(&self.layers[k].samples)
    }
}

/// Returns the names of a layer's channels: `R`, `G`, `B` without a prefix, else `prefix.R` and so on.
pub(super) fn channel_names(prefix: &str, suffixes: [char; 3]) -> [String; 3] {
    suffixes.map(|suffix| {
        if prefix.is_empty() {
            suffix.to_string()
        } else {
            format!("{prefix}.{suffix}")
        }
    })
}

/// Returns the size of an image, if it has pixels and no more than the limit.
pub(super) fn check_size(width: u64, height: u64) -> Result<(u32, u32), RenderError> {
    let too_large = || RenderError::TooLarge {
        width,
        height,
        limit: MAX_PIXELS,
    };
    if width == 0 || height == 0 {
        return Err(RenderError::Empty);
    }
    let side = |n: u64| i32::try_from(n).map_err(|_| too_large()).map(i32::unsigned_abs);
    let sides = (side(width)?, side(height)?);
    if width * height > MAX_PIXELS {
        return Err(too_large());
    }
    Ok(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_ordered_typed_and_replaced_by_name() {
        let mut image = Image::new(2, 1);
        image.insert("R", Samples::F32(vec![1.0, 2.0]));
        image.insert("B", Samples::F32(vec![3.0, 4.0]));
        image.insert("patch", Samples::U32(vec![7, 8]));
        image.insert("R", Samples::F32(vec![5.0, 6.0]));
        let names: Vec<&str> = image.layers().iter().map(|layer| layer.name.as_str()).collect();
        assert_eq!(names, ["B", "R", "patch"]);
        assert_eq!(image.f32("R"), Some(&[5.0, 6.0][..]));
        assert_eq!(image.u32("patch"), Some(&[7, 8][..]));
        assert_eq!(image.f32("patch"), None);
        assert_eq!(image.u32("G"), None);
    }
}
