//! A contact sheet: rows of pictures with a caption under each, as PNG.

use std::error::Error;
use std::fmt::Write as _;

use resvg::tiny_skia::{Pixmap, PremultipliedColorU8, Transform};

use super::kit::convert;

/// The pixels of a picture, row by row, and its caption.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    pub rgb: &'a [u8],
    pub width: usize,
    pub height: usize,
    pub caption: &'a str,
}

/// The scale of pictures on the sheet: pixels per pixel of the sheet, along each side.
const SHRINK: usize = 2;

/// The height of a caption, px.
const CAPTION: usize = 22;

const GAP: usize = 6;

/// The sheet as PNG bytes.
pub fn png(rows: &[Vec<Picture<'_>>]) -> Result<Vec<u8>, Box<dyn Error + Send + Sync>> {
    let pictures = || rows.iter().flatten();
    let widest = pictures().map(|picture| picture.width).max().unwrap_or_default();
    let highest = pictures().map(|picture| picture.height).max().unwrap_or_default();
    let cell = [widest / SHRINK + GAP, highest / SHRINK + CAPTION];
    let columns = rows.iter().map(Vec::len).max().unwrap_or_default();
    let size = [columns * cell[0] + GAP, rows.len() * cell[1] + GAP];
    let [width, height] = size.map(|px| u32::try_from(px).unwrap_or(u32::MAX));
    let mut sheet = Pixmap::new(width, height).ok_or("the contact sheet is too large")?;
    sheet.fill(resvg::tiny_skia::Color::WHITE);
    let mut words = String::new();
    for (down, row) in rows.iter().enumerate() {
        for (right, picture) in row.iter().enumerate() {
            let corner = [GAP + right * cell[0], GAP + down * cell[1]];
            paste(&mut sheet, picture, corner);
            let (x, y) = (corner[0] + 2, corner[1] + cell[1] - CAPTION + 15);
            let _ = write!(words, r#"<text x="{x}" y="{y}" font-size="12" fill="black">{}</text>"#, picture.caption);
        }
    }
    let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">{words}</svg>"#);
    resvg::render(&convert::tree(&svg)?, Transform::identity(), &mut sheet.as_mut());
    Ok(sheet.encode_png()?)
}

fn paste(sheet: &mut Pixmap, picture: &Picture<'_>, corner: [usize; 2]) {
    let stride = sheet.width() as usize;
    for y in 0..picture.height / SHRINK {
        for x in 0..picture.width / SHRINK {
            let [red, green, blue] = mean(picture, x * SHRINK, y * SHRINK);
            let color =
                PremultipliedColorU8::from_rgba(red, green, blue, 255).expect("an opaque colour is premultiplied");
            sheet.pixels_mut()[(corner[1] + y) * stride + corner[0] + x] = color;
        }
    }
}

fn mean(picture: &Picture<'_>, x: usize, y: usize) -> [u8; 3] {
    [0, 1, 2].map(|part| {
        let block = (0..SHRINK * SHRINK).map(|at| (x + at % SHRINK, y + at / SHRINK));
        let sum: usize = block.map(|(x, y)| usize::from(picture.rgb[3 * (y * picture.width + x) + part])).sum();
        u8::try_from(sum / (SHRINK * SHRINK)).expect("a mean of bytes is a byte")
    })
}
