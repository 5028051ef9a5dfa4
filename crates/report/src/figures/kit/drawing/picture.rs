//! A drawn figure, and what becomes of it.

#[cfg(feature = "raster")]
use crate::figures::kit::convert::{self, ConvertError};
use crate::figures::kit::font;
use crate::figures::kit::sheet::{Drawing, Sheet};

#[derive(Clone, Debug)]
pub struct Figure {
    drawing: Drawing,
    caption: String,
    models: usize,
}

impl Figure {
    pub(in crate::figures) fn new(sheet: Sheet, height: f64, title: &str, caption: impl Into<String>) -> Self {
        let caption = caption.into();
        Self { drawing: sheet.finish(height, title, &caption), caption, models: 0 }
    }

    /// The same figure, which shows so many models.
    pub(in crate::figures) fn with_models(self, models: usize) -> Self {
        Self { models, ..self }
    }

    /// The same figure with a remark behind its caption.
    #[must_use]
    pub fn remarked(self, remark: Option<&str>) -> Self {
        let caption = remark.map_or_else(|| self.caption.clone(), |remark| format!("{} {remark}", self.caption));
        Self { caption, ..self }
    }

    /// How many models it shows; 0 if it is of an episode.
    pub fn models(&self) -> usize {
        self.models
    }

    /// The same figure, `width` px wide.
    pub(in crate::figures) fn printed(self, width: f64) -> Self {
        Self { drawing: self.drawing.printed(width), ..self }
    }

    /// One or two sentences on how to read it.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// A document of its own: the font is inside.
    pub fn svg(&self) -> String {
        self.drawing.document(&font::style_sheet())
    }

    /// An `<svg>` element to set into HTML, which brings [`style_sheet`](font::style_sheet) along once for all figures.
    pub fn inline_svg(&self) -> String {
        self.drawing.inline()
    }

    #[cfg(feature = "raster")]
    pub fn png(&self) -> Result<Vec<u8>, ConvertError> {
        convert::png(&convert::tree(&self.inline_svg())?)
    }

    /// The picture as a PDF of one page.
    #[cfg(feature = "raster")]
    pub fn pdf(&self) -> Result<Vec<u8>, ConvertError> {
        convert::pdf(&convert::tree(&self.inline_svg())?)
    }
}
