//! The drawing kit: building blocks of figures, without knowledge of their content.

#[cfg(feature = "raster")]
pub mod convert;

pub(super) mod dodge;
pub(super) mod label;
pub(super) mod legend;
pub(super) mod lettering;
pub(super) mod marker;
pub(super) mod palette;
pub(super) mod panels;
pub(super) mod plot;
pub(super) mod roster;
pub(super) mod sheet;
pub(super) mod svg;
pub(super) mod tiles;

pub(super) use legend::{Legend, Swatch};
pub(super) use lettering::{Lettering, MARGIN, TextAnchor, leading};
pub(super) use palette::{PALETTE, text_on};
pub(super) use panels::Grid;
pub(super) use plot::{Plot, ROOM_BELOW, ROOM_LEFT, Tick, rate_ticks, whole_ticks};
pub(super) use roster::{Member, Roster};
pub(super) use sheet::{Fill, Frame, Mark, Point, Rgb, Sheet, Stroke, many};
