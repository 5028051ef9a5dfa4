//! One picture in memory.

#[cfg(feature = "sim")]
use std::sync::OnceLock;

/// Rows from the top, three bytes (red, green, blue) a pixel. A picture does not change once it is made.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
    #[cfg(feature = "sim")]
    png: OnceLock<Vec<u8>>,
}

impl Frame {
    /// A picture of `3 * width * height` bytes.
    pub const fn new(width: usize, height: usize, rgb: Vec<u8>) -> Self {
        Self {
            width,
            height,
            rgb,
            #[cfg(feature = "sim")]
            png: OnceLock::new(),
        }
    }
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        (self.width, self.height, &self.rgb) == (other.width, other.height, &other.rgb)
    }
}

impl Eq for Frame {}

#[cfg(feature = "sim")]
impl Frame {
    /// The picture as PNG; the same picture gives the same bytes.
    pub fn to_png(&self) -> Result<&[u8], png::EncodingError> {
        if let Some(png) = self.png.get() {
            return Ok(png);
        }
        let png = self.encode()?;
        Ok(self.png.get_or_init(|| png))
    }

    fn encode(&self) -> Result<Vec<u8>, png::EncodingError> {
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side(self.width), side(self.height));
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.write_header()?.write_image_data(&self.rgb)?;
        Ok(bytes)
    }
}
