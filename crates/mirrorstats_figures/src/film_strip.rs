//! The paper's qualitative figure: frames of one episode in a row, with the action and claim at each, and its moments.

use crate::Figure;
use crate::kit::{Fill, Frame, MARGIN, Mark, PALETTE, Rgb, Sheet, Stroke, label, lettering, many};

#[derive(Clone, Debug, PartialEq)]
pub struct Still {
    pub t: i32,
    pub png: Vec<u8>,
    pub size: (u32, u32),
    pub action: String,
    pub claim: String,
    pub visible: bool,
    pub moments: Vec<&'static str>,
}

/// The colour for evidence in view and for the story's moments.
const SEEN: Rgb = Rgb(0, 119, 187);
/// The width of a frame, px.
const WIDTH: f64 = 160.0;
const GAP: f64 = 6.0;
/// The line height of text, px.
const LINE: f64 = 15.0;

pub fn film_strip(title: &str, stills: &[Still]) -> Figure {
    let heading = lettering::heading();
    let frames = many(stills.len().max(1)) * (WIDTH + GAP) - GAP;
    let width = (2.0 * MARGIN + frames).max(2.0 * MARGIN + heading.width(title));
    let mut sheet = Sheet::new(width);
    let mut y = MARGIN + LINE / 2.0;
    sheet.text((MARGIN, y), title, heading);
    y += LINE;
    let (mut left, mut bottom) = (MARGIN, y);
    for still in stills {
        bottom = bottom.max(draw(&mut sheet, still, left, y));
        left += WIDTH + GAP;
    }
    Figure::new(sheet, bottom + MARGIN, title, described(stills))
}

fn draw(sheet: &mut Sheet, still: &Still, left: f64, top: f64) -> f64 {
    let moments = still.moments.join(", ");
    let label = lettering::label();
    sheet.text((left, top + LINE / 2.0), &moments, label.semibold());
    let frame = Frame::new(left, top + LINE, WIDTH, WIDTH * ratio(still.size));
    let mark = Mark::new(format!("t = {}", still.t))
        .with("t", still.t)
        .with("action", &still.action)
        .with("claim", &still.claim)
        .with("mirror", if still.visible { "visible" } else { "not visible" });
    sheet.mark(&mark, |sheet| {
        sheet.picture(frame, &still.png);
        if !still.moments.is_empty() {
            let (left, top, right, bottom) = (frame.left, frame.top, frame.right(), frame.bottom());
            let outline = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
            sheet.line(&outline, Stroke::solid(SEEN, 2.0));
        }
    });
    let mut y = frame.bottom() + LINE * 0.8;
    let (mirror, paint) =
        if still.visible { ("mirror evidence in view", SEEN) } else { ("no mirror evidence", PALETTE.surface.quiet) };
    sheet.rectangle(Frame::new(left, y - 4.0, 8.0, 8.0), Fill::plain(paint));
    let action = format!("t = {}: {}", still.t, still.action);
    for (indent, words) in [(12.0, mirror), (0.0, action.as_str()), (0.0, still.claim.as_str())] {
        let lettering = lettering::tick();
        sheet.text((left + indent, y), &label::cut(words, WIDTH - indent, lettering), lettering);
        y += LINE;
    }
    y - LINE / 2.0
}

fn ratio((width, height): (u32, u32)) -> f64 {
    if width == 0 { 0.75 } else { f64::from(height) / f64::from(width) }
}

fn described(stills: &[Still]) -> String {
    let words = stills.iter().map(|still| {
        let moments = if still.moments.is_empty() { String::new() } else { format!(" ({})", still.moments.join(", ")) };
        format!("t = {}{moments}: {}, {}", still.t, still.action, still.claim)
    });
    words.collect::<Vec<_>>().join("; ")
}
