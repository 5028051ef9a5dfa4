//! The drawing kit: building blocks of figures, without knowledge of their content.

#[cfg(feature = "raster")]
pub mod convert;

pub(super) mod legend;
pub(super) mod panels;
pub(super) mod tiles;

mod drawing;
mod frame;
mod plot;
mod roster;
mod sheet;

pub use drawing::palette;
pub(super) use drawing::{dodge, font, label, lettering, marker, picture};
use drawing::{ink, look, mark};

pub(super) use frame::{Frame, Point, many};
pub(super) use legend::{Legend, Swatch};
pub(super) use lettering::{FULL_WIDTH, Lettering, MARGIN, NAME_ROOM, TextAnchor, leading};
pub(super) use look::{Fill, Rgb, Stroke};
pub(super) use mark::Mark;
pub(super) use marker::polar;
pub(super) use palette::{PALETTE, text_on};
pub(super) use panels::{Arrangement, Panels};
pub(super) use plot::{Plot, Tick, rate_ticks, whole_ticks};
pub(super) use roster::{Member, Roster};
pub(super) use sheet::Sheet;
