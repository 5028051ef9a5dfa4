//! A drawn figure and its output forms.

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

    /// Sets the number of models that the figure shows.
    pub(in crate::figures) fn with_models(self, models: usize) -> Self {
        Self { models, ..self }
    }

    /// Adds a remark after the caption.
    #[must_use]
    pub fn remarked(self, remark: Option<&str>) -> Self {
        let caption = remark.map_or_else(|| self.caption.clone(), |remark| format!("{} {remark}", self.caption));
        Self { caption, ..self }
    }

    /// The number of models that it shows; 0 for a figure of an episode.
    pub fn models(&self) -> usize {
        self.models
    }

    /// Scales the figure to `width` px.
    pub(in crate::figures) fn printed(self, width: f64) -> Self {
        Self { drawing: self.drawing.printed(width), ..self }
    }

    /// One or two sentences on how to read it.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// A standalone SVG document, with the font inside.
    pub fn svg(&self) -> String {
        self.drawing.document(&font::style_sheet())
    }

    /// An `<svg>` element for HTML; a page includes [`style_sheet`](font::style_sheet) once for all figures.
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
