//! The contact sheet of `mirrorstats world sheet`: rows of pictures with a caption under each.

use std::fmt::Write as _;

use resvg::tiny_skia::{Pixmap, PremultipliedColorU8, Transform};

use crate::cli::Failure;
use mirrorstats_figures::kit::convert;
use mirrorstats_sim::contact_sheet::SheetPicture;
use mirrorstats_trace::episodes::frame::Frame;

/// The scale of pictures on the sheet: pixels per pixel of the sheet, along each side.
const SHRINK: usize = 2;

/// The height of a caption, px.
const CAPTION: usize = 22;

const GAP: usize = 6;

/// The sheet as PNG bytes.
pub fn png(rows: &[Vec<SheetPicture>]) -> Result<Vec<u8>, Failure> {
    let frames = || rows.iter().flatten().map(|picture| &picture.frame);
    let widest = frames().map(|frame| frame.width).max().unwrap_or_default();
    let highest = frames().map(|frame| frame.height).max().unwrap_or_default();
    if widest == 0 {
        return Err(Failure::input("the contact sheet cannot be encoded as PNG: it has no pictures"));
    }
    let cell = [widest / SHRINK + GAP, highest / SHRINK + CAPTION];
    let columns = rows.iter().map(Vec::len).max().unwrap_or_default();
    let size = [columns * cell[0] + GAP, rows.len() * cell[1] + GAP];
    let [width, height] = size.map(|px| u32::try_from(px).unwrap_or(u32::MAX));
    let mut sheet = Pixmap::new(width, height)
        .ok_or_else(|| Failure::input("the contact sheet cannot be encoded as PNG: it has no pixels"))?;
    sheet.fill(resvg::tiny_skia::Color::WHITE);
    let mut words = String::new();
    for (down, row) in rows.iter().enumerate() {
        for (right, picture) in row.iter().enumerate() {
            let corner = [GAP + right * cell[0], GAP + down * cell[1]];
            paste(&mut sheet, &picture.frame, corner);
            let (x, y) = (corner[0] + 2, corner[1] + cell[1] - CAPTION + 15);
            let _ = write!(words, r#"<text x="{x}" y="{y}" font-size="12" fill="black">{}</text>"#, picture.caption);
        }
    }
    let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">{words}</svg>"#);
    resvg::render(&convert::tree(&svg).map_err(Failure::input)?, Transform::identity(), &mut sheet.as_mut());
    sheet.encode_png().map_err(|error| Failure::input(format!("the contact sheet cannot be encoded as PNG: {error}")))
}

fn paste(sheet: &mut Pixmap, frame: &Frame, corner: [usize; 2]) {
    let stride = sheet.width() as usize;
    for y in 0..frame.height / SHRINK {
        for x in 0..frame.width / SHRINK {
            let [red, green, blue] = mean(frame, x * SHRINK, y * SHRINK);
            let color =
                PremultipliedColorU8::from_rgba(red, green, blue, 255).expect("an opaque colour is premultiplied");
            sheet.pixels_mut()[(corner[1] + y) * stride + corner[0] + x] = color;
        }
    }
}

fn mean(frame: &Frame, x: usize, y: usize) -> [u8; 3] {
    [0, 1, 2].map(|part| {
        let block = (0..SHRINK * SHRINK).map(|at| (x + at % SHRINK, y + at / SHRINK));
        let sum: usize = block.map(|(x, y)| usize::from(frame.rgb[3 * (y * frame.width + x) + part])).sum();
        u8::try_from(sum / (SHRINK * SHRINK)).expect("a mean of bytes is a byte")
    })
}
