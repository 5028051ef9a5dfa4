//! Styles of lines and areas: colours, strokes, fills.

use std::fmt;

use plotters::style::RGBColor;
use serde::Deserialize;

/// A colour, written `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Rgb(pub u8, pub u8, pub u8);

impl TryFrom<String> for Rgb {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let fault = || format!("expected a colour such as `#0063a6`, found `{text}`");
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6).ok_or_else(fault)?;
        let value = u32::from_str_radix(digits, 16).map_err(|_| fault())?;
        let [_, red, green, blue] = value.to_be_bytes();
        Ok(Self(red, green, blue))
    }
}

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

impl From<Rgb> for RGBColor {
    fn from(Rgb(red, green, blue): Rgb) -> Self {
        Self(red, green, blue)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub color: Rgb,
    pub width: f64,
    /// Alternating lengths of ink and gap, px; empty for a solid line.
    pub dash: &'static [f64],
}

impl Stroke {
    pub const fn solid(color: Rgb, width: f64) -> Self {
        Self { color, width, dash: &[] }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fill {
    pub color: Rgb,
    pub opacity: f64,
    /// The line around it, drawn half inside.
    pub outline: Option<Stroke>,
}

impl Fill {
    pub const fn plain(color: Rgb) -> Self {
        Self { color, opacity: 1.0, outline: None }
    }

    pub(crate) const fn outlined(color: Rgb, outline: Rgb, width: f64) -> Self {
        Self { color, opacity: 1.0, outline: Some(Stroke::solid(outline, width)) }
    }
}
