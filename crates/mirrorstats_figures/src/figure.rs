//! A drawn figure and its output forms.

use std::ffi::OsStr;
use std::path::Path;

#[cfg(feature = "raster")]
use crate::kit::convert;
use crate::kit::lettering::{FAMILY, style_sheet};
use crate::kit::sheet::Sheet;
use crate::kit::svg::escaped;
use mirrorstats_exact::format::fixed;

#[derive(Clone, Debug)]
pub struct Figure {
    body: String,
    width: f64,
    height: f64,
    /// The printed width, px; `None` for the width as drawn.
    pub(crate) printed: Option<f64>,
    title: String,
    /// The caption without remarks, for screen readers.
    description: String,
    caption: String,
    pub(crate) models: usize,
}

impl Figure {
    /// The sheet, cut at `height`.
    pub(crate) fn new(sheet: Sheet, height: f64, title: &str, caption: impl Into<String>) -> Self {
        let caption = caption.into();
        Self {
            width: sheet.width.ceil(),
            height: height.ceil(),
            body: sheet.into_body(),
            printed: None,
            title: title.to_owned(),
            description: caption.clone(),
            caption,
            models: 0,
        }
    }

    /// Adds a remark after the caption.
    #[must_use]
    pub fn remarked(mut self, remark: Option<&str>) -> Self {
        if let Some(remark) = remark {
            self.caption = format!("{} {remark}", self.caption);
        }
        self
    }

    /// The number of models that it shows; 0 for a figure of an episode.
    pub fn models(&self) -> usize {
        self.models
    }

    pub fn title(&self) -> &str {
        &self.title
    }

    /// One or two sentences on how to read it.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// A standalone SVG document, with the font inside.
    pub fn svg(&self) -> String {
        let (title, style) = (escaped(&self.title), style_sheet());
        self.element(&format!("<title>{title}</title>\n<style>{style}</style>\n"))
    }

    /// An `<svg>` element for HTML; a page includes [`font_style_sheet`](crate::font_style_sheet) once for all figures.
    pub fn inline_svg(&self) -> String {
        self.element("")
    }

    fn element(&self, head: &str) -> String {
        let Self { body, width, height, .. } = self;
        let [shown_width, shown_height] = match self.printed {
            Some(px) => [px, height * px / width].map(|length| fixed(Some(length), 2)),
            None => [width, height].map(f64::to_string),
        };
        let (title, description) = (escaped(&self.title), escaped(&self.description));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{shown_width}\" height=\"{shown_height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\" \
             font-family=\"'{FAMILY}', sans-serif\" stroke-linejoin=\"round\">\n\
             {head}<desc>{description}</desc>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }

    /// The figure in every format, as PNG only if asked for; its SVG is parsed once.
    pub fn encode_all(&self, png: bool) -> Result<Vec<(FigureFormat, Vec<u8>)>, EncodeError> {
        #[cfg(feature = "raster")]
        let tree = convert::tree(&self.inline_svg())?;
        let formats = FigureFormat::ALL.iter().filter(|format| png || format.ending() != "png");
        let encoded = formats.map(|format| {
            let bytes = match format {
                FigureFormat::Svg => self.svg().into_bytes(),
                #[cfg(feature = "raster")]
                FigureFormat::Png => convert::png(&tree)?,
                #[cfg(feature = "raster")]
                FigureFormat::Pdf => convert::pdf(&tree)?,
            };
            Ok((*format, bytes))
        });
        encoded.collect()
    }
}

/// A file format of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureFormat {
    /// Vector graphics for the web, with values on hover.
    Svg,
    /// Pixels, about 300 per inch at a width of 7 inches.
    #[cfg(feature = "raster")]
    Png,
    /// Vector graphics for LaTeX, on one page.
    #[cfg(feature = "raster")]
    Pdf,
}

/// A figure that cannot be encoded. SVG always can.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    #[cfg(feature = "raster")]
    #[error("the figure's SVG cannot be read back; please report this with the model names of the data")]
    Svg(#[from] resvg::usvg::Error),
    #[cfg(feature = "raster")]
    #[error("a picture of {width} x {height} px cannot be made; take svg or pdf, or fewer models")]
    Size { width: f32, height: f32 },
    #[cfg(feature = "raster")]
    #[error("the figure cannot be encoded as PNG: {0}")]
    Png(String),
    #[cfg(feature = "raster")]
    #[error("the figure cannot be written as PDF: {0}")]
    Pdf(String),
}

#[derive(Debug, thiserror::Error)]
#[error("expected a file that ends in {}, found the ending `{ending}`", endings())]
pub struct UnknownEnding {
    ending: String,
}

impl FigureFormat {
    pub const ALL: &[Self] = &[
        Self::Svg,
        #[cfg(feature = "raster")]
        Self::Png,
        #[cfg(feature = "raster")]
        Self::Pdf,
    ];

    pub const fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            #[cfg(feature = "raster")]
            Self::Png => "png",
            #[cfg(feature = "raster")]
            Self::Pdf => "pdf",
        }
    }

    /// The format for the extension of `path`, in any case; SVG without an extension.
    pub fn from_path(path: &Path) -> Result<Self, UnknownEnding> {
        let Some(ending) = path.extension().and_then(OsStr::to_str) else { return Ok(Self::Svg) };
        let named = Self::ALL.iter().copied().find(|format| format.ending().eq_ignore_ascii_case(ending));
        named.ok_or_else(|| UnknownEnding { ending: ending.to_owned() })
    }

    pub fn encode(self, figure: &Figure) -> Result<Vec<u8>, EncodeError> {
        Ok(match self {
            Self::Svg => figure.svg().into_bytes(),
            #[cfg(feature = "raster")]
            Self::Png => convert::png(&convert::tree(&figure.inline_svg())?)?,
            #[cfg(feature = "raster")]
            Self::Pdf => convert::pdf(&convert::tree(&figure.inline_svg())?)?,
        })
    }
}

fn endings() -> String {
    FigureFormat::ALL.iter().map(|format| format!(".{}", format.ending())).collect::<Vec<_>>().join(", ")
}

#[cfg(all(test, feature = "raster"))]
mod tests {
    use std::path::Path;

    use super::FigureFormat as Format;

    #[test]
    fn the_extension_selects_the_format() {
        for (name, format) in
            [("a.svg", Format::Svg), ("b/c.PNG", Format::Png), ("d.pdf", Format::Pdf), ("e", Format::Svg)]
        {
            assert_eq!(Format::from_path(Path::new(name)).unwrap(), format);
        }
        assert_eq!(
            Format::from_path(Path::new("f.jpg")).unwrap_err().to_string(),
            "expected a file that ends in .svg, .png, .pdf, found the ending `jpg`"
        );
    }
}
