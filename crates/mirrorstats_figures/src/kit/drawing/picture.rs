//! A drawn figure and its output forms.

use std::error::Error;
use std::ffi::OsStr;
use std::path::Path;

#[cfg(feature = "raster")]
use crate::kit::convert::{self, ConvertError};
use crate::kit::font;
use crate::kit::ink::escaped;
use crate::kit::sheet::Sheet;
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
            width: sheet.width().ceil(),
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
    pub fn remarked(self, remark: Option<&str>) -> Self {
        let caption = remark.map_or_else(|| self.caption.clone(), |remark| format!("{} {remark}", self.caption));
        Self { caption, ..self }
    }

    /// The number of models that it shows; 0 for a figure of an episode.
    pub fn models(&self) -> usize {
        self.models
    }

    /// One or two sentences on how to read it.
    pub fn title(&self) -> &str {
        &self.title
    }

    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// A standalone SVG document, with the font inside.
    pub fn svg(&self) -> String {
        let (title, style) = (escaped(&self.title), font::style_sheet());
        self.element(&format!("<title>{title}</title>\n<style>{style}</style>\n"))
    }

    /// An `<svg>` element for HTML; a page includes [`style_sheet`](font::style_sheet) once for all figures.
    pub fn inline_svg(&self) -> String {
        self.element("")
    }

    fn element(&self, head: &str) -> String {
        let Self { body, width, height, .. } = self;
        let [shown_width, shown_height] = match self.printed {
            Some(px) => [px, height * px / width].map(|length| fixed(Some(length), 2)),
            None => [width, height].map(f64::to_string),
        };
        let (title, description, family) = (escaped(&self.title), escaped(&self.description), font::FAMILY);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{shown_width}\" height=\"{shown_height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\" \
             font-family=\"'{family}', sans-serif\" stroke-linejoin=\"round\">\n\
             {head}<desc>{description}</desc>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }

    /// The figure in every format, as PNG only if asked for; its SVG is parsed once.
    pub fn encode_all(&self, png: bool) -> Result<Vec<(FigureFormat, Vec<u8>)>, EncodeError> {
        #[cfg(feature = "raster")]
        let tree = &convert::tree(&self.inline_svg()).map_err(|error| EncodeError(error.into()))?;
        let encoded = |format: &FigureFormat| -> Result<_, Box<dyn Error + Send + Sync>> {
            let bytes = match format {
                FigureFormat::Svg => self.svg().into_bytes(),
                #[cfg(feature = "raster")]
                FigureFormat::Png => convert::png(tree)?,
                #[cfg(feature = "raster")]
                FigureFormat::Pdf => convert::pdf(tree)?,
            };
            Ok((*format, bytes))
        };
        let formats = FigureFormat::ALL.iter().filter(|format| png || format.ending() != "png");
        Ok(formats.map(encoded).collect::<Result<_, _>>()?)
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

/// A file format of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureFormat {
    /// Vector graphics for the web, with values on hover.
    Svg,
    /// Pixels, about 300 per inch at a width of 7 inches.
    #[cfg(feature = "raster")]
    Png,
    /// Vector graphics for LaTeX.
    #[cfg(feature = "raster")]
    Pdf,
}

#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct EncodeError(#[from] Box<dyn Error + Send + Sync>);

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
        match self {
            Self::Svg => Ok(figure.svg().into_bytes()),
            #[cfg(feature = "raster")]
            Self::Png => figure.png().map_err(|error| EncodeError(error.into())),
            #[cfg(feature = "raster")]
            Self::Pdf => figure.pdf().map_err(|error| EncodeError(error.into())),
        }
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
