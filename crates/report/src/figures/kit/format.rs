//! The file formats of figures.

use std::error::Error;
use std::ffi::OsStr;
use std::path::Path;

use super::picture::Figure;

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

/// An error of encoding a figure.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct EncodeError(#[from] Box<dyn Error + Send + Sync>);

/// A file extension that is no format of a figure.
#[derive(Debug, thiserror::Error)]
#[error("expected a file that ends in {}, found the ending `{ending}`", endings())]
pub struct UnknownEnding {
    ending: String,
}

impl FigureFormat {
    /// All formats of this build.
    pub const ALL: &[Self] = &[
        Self::Svg,
        #[cfg(feature = "raster")]
        Self::Png,
        #[cfg(feature = "raster")]
        Self::Pdf,
    ];

    /// The file extension of this format.
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
    pub fn of(path: &Path) -> Result<Self, UnknownEnding> {
        let Some(ending) = path.extension().and_then(OsStr::to_str) else { return Ok(Self::Svg) };
        let named = Self::ALL.iter().copied().find(|format| format.ending().eq_ignore_ascii_case(ending));
        named.ok_or_else(|| UnknownEnding { ending: ending.to_owned() })
    }

    /// The figure as bytes of this format.
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
    fn the_ending_decides_and_an_unknown_one_is_refused() {
        for (name, format) in
            [("a.svg", Format::Svg), ("b/c.PNG", Format::Png), ("d.pdf", Format::Pdf), ("e", Format::Svg)]
        {
            assert_eq!(Format::of(Path::new(name)).unwrap(), format);
        }
        assert_eq!(
            Format::of(Path::new("f.jpg")).unwrap_err().to_string(),
            "expected a file that ends in .svg, .png, .pdf, found the ending `jpg`"
        );
    }
}
