//! An episode as a film: one animated PNG of its frames, which browsers and papers' web pages can show.

use std::io::Cursor;

use super::{View, ViewError};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;

/// The duration of a step, as on the page: 1/4 s.
const PACE: (u16, u16) = (1, 4);

/// All frames are in memory until the film is written.
const LARGEST: Limit = Limit::new("bytes of the frames of a film", 512 << 20);

/// The frames of an episode in order; steps without a frame are skipped.
pub fn film(view: &View, id: &str) -> Result<Vec<u8>, ViewError> {
    let snapshot = view.newest();
    let opened = snapshot.episode(id)?;
    let (mut frames, mut bytes) = (Vec::new(), 0);
    snapshot.logs.each_moment(&opened, &mut |_, moment| frames.extend(moment.frame))?;
    if frames.is_empty() && snapshot.renders(&opened) {
        for t in 1..=opened.episode.steps.len() {
            frames.extend(snapshot.frame(&opened, t)?);
        }
    }
    for frame in &frames {
        bytes += frame.len() as u64;
        LARGEST.check(bytes).map_err(|exceeded| ViewError::Request(exceeded.to_string()))?;
    }
    if frames.is_empty() {
        return Err(ViewError::Absent(format!("`{}` has no frames", visible(id))));
    }
    animated(&frames)
        .map_err(|fault| ViewError::Request(format!("the frames of `{}` make no film: {fault}", visible(id))))
}

fn animated(frames: &[Vec<u8>]) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let (width, height, _) = pixels(&frames[0])?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(u32::try_from(frames.len())?, 0)?;
    encoder.set_frame_delay(PACE.0, PACE.1)?;
    let mut writer = encoder.write_header()?;
    for frame in frames {
        let (own_width, own_height, pixels) = pixels(frame)?;
        if (own_width, own_height) != (width, height) {
            return Err(format!("expected {width} x {height} pixels, found {own_width} x {own_height}").into());
        }
        writer.write_image_data(&pixels)?;
    }
    writer.finish()?;
    Ok(bytes)
}

/// The width, height and pixels of a frame of 8 bits of red, green and blue.
pub(super) fn pixels(frame: &[u8]) -> Result<(u32, u32, Vec<u8>), Box<dyn std::error::Error>> {
    let mut reader = png::Decoder::new(Cursor::new(frame)).read_info()?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("a frame is too large")?];
    let info = reader.next_frame(&mut pixels)?;
    if info.color_type != png::ColorType::Rgb || info.bit_depth != png::BitDepth::Eight {
        return Err("expected frames of 8 bits of red, green and blue".into());
    }
    pixels.truncate(info.buffer_size());
    Ok((info.width, info.height, pixels))
}
