#[cfg(feature = "sim")]
use std::sync::OnceLock;

use mirrorstats_exact::hash;

const COLUMNS: usize = 8;
const ROWS: usize = 6;
const HASH_DIGITS: usize = 16;

/// The form of a recording's digests, as named in its footer.
pub const DIGEST: &str = "sha256-16 and 8x6 means";

/// The largest difference between block means, in levels, of frames that count as alike.
pub const TOLERANCE: u8 = 2;

/// An immutable picture: rows from the top, three bytes (red, green, blue) per pixel.
#[derive(Clone, Debug)]
pub struct Frame {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
    #[cfg(feature = "sim")]
    png: OnceLock<Vec<u8>>,
}

impl Frame {
    pub const fn new(width: usize, height: usize, rgb: Vec<u8>) -> Self {
        Self {
            width,
            height,
            rgb,
            #[cfg(feature = "sim")]
            png: OnceLock::new(),
        }
    }

    pub fn digest(&self) -> String {
        let hash = hash::of_bytes(&self.rgb);
        let blocks = (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| [column, row]));
        let means: Vec<u8> = blocks.flat_map(|block| self.mean(block)).collect();
        format!("{}-{}", &hash[..HASH_DIGITS], hash::hex(&means))
    }

    fn mean(&self, [column, row]: [usize; 2]) -> [u8; 3] {
        let within = |at: usize, count: usize, side: usize| at * side / count..(at + 1) * side / count;
        let (across, down) = (within(column, COLUMNS, self.width), within(row, ROWS, self.height));
        let count = (across.len() * down.len()).max(1);
        let mut sums = [0_usize; 3];
        for y in down {
            let line = &self.rgb[3 * (y * self.width + across.start)..3 * (y * self.width + across.end)];
            for pixel in line.chunks_exact(3) {
                sums.iter_mut().zip(pixel).for_each(|(sum, level)| *sum += usize::from(*level));
            }
        }
        sums.map(|sum| u8::try_from((sum + count / 2) / count).unwrap_or(u8::MAX))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Likeness {
    Equal,
    /// Different bytes, but the means of all blocks are within [`TOLERANCE`].
    Alike,
    Different,
}

pub fn likeness(one: &str, other: &str) -> Option<Likeness> {
    let ([one_hash, one_means], [other_hash, other_means]) = (halves(one)?, halves(other)?);
    let (one, other) = (levels(one_means)?, levels(other_means)?);
    if one_hash == other_hash {
        return Some(Likeness::Equal);
    }
    let is_alike = one.len() == other.len() && one.iter().zip(&other).all(|(a, b)| a.abs_diff(*b) <= TOLERANCE);
    Some(if is_alike { Likeness::Alike } else { Likeness::Different })
}

fn halves(digest: &str) -> Option<[&str; 2]> {
    digest.split_once('-').filter(|(hash, _)| hash.len() == HASH_DIGITS).map(|(hash, means)| [hash, means])
}

fn levels(digits: &str) -> Option<Vec<u8>> {
    let pairs = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).ok());
    pairs.map(|pair| u8::from_str_radix(pair?, 16).ok()).collect()
}

impl PartialEq for Frame {
    fn eq(&self, other: &Self) -> bool {
        (self.width, self.height, &self.rgb) == (other.width, other.height, &other.rgb)
    }
}

impl Eq for Frame {}

#[cfg(feature = "sim")]
impl Frame {
    /// The picture as PNG; equal pictures give equal bytes.
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

#[cfg(test)]
mod tests {
    use super::{Frame, Likeness, likeness};

    fn frame(level: u8, dot: u8) -> Frame {
        let mut rgb = vec![level; 3 * 64 * 48];
        rgb[0] = dot;
        Frame::new(64, 48, rgb)
    }

    #[test]
    fn frames_are_equal_alike_or_different() {
        let base = frame(100, 100).digest();
        assert_eq!((base.len(), &base[16..22]), (16 + 1 + 2 * 3 * 48, "-64646"));
        let with = |other: Frame| likeness(&base, &other.digest()).unwrap();
        assert_eq!(with(frame(100, 100)), Likeness::Equal);
        assert_eq!(with(frame(100, 160)), Likeness::Alike);
        assert_eq!(with(frame(102, 102)), Likeness::Alike);
        assert_eq!(with(frame(103, 103)), Likeness::Different);
        assert_eq!(likeness(&base, "no digest"), None);
        assert_eq!(likeness(&base, "0123456789abcdef-6"), Some(Likeness::Different));
    }

    #[test]
    fn the_smallest_frames_have_a_digest() {
        assert_eq!(Frame::new(0, 0, Vec::new()).digest().len(), 16 + 1 + 2 * 3 * 48);
        assert_eq!(Frame::new(3, 2, vec![7; 18]).digest().len(), 16 + 1 + 2 * 3 * 48);
    }
}
