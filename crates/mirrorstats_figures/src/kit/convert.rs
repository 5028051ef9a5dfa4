//! SVG to PNG and PDF, both from one parsed tree and only with the embedded font (feature `raster`).

use std::sync::{Arc, LazyLock};

use krilla::geom::Size;
use krilla::page::PageSettings;
use krilla::{Document, SerializeSettings};
use krilla_svg::{SurfaceExt, SvgSettings};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};

use super::lettering::{FAMILY, FILES};
use crate::figure::EncodeError;

/// PNG pixels per px of the figure: about 300 dpi for a figure that is 7 inches wide.
const PNG_SCALE: f32 = 3.0;
const POINTS_PER_PX: f32 = 0.75;

/// Only the embedded font: installed fonts are never used.
static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    for data in FILES {
        fonts.load_font_source(Source::Binary(Arc::new(data)));
    }
    fonts.set_sans_serif_family(FAMILY);
    Arc::new(fonts)
});

pub fn tree(svg: &str) -> Result<Tree, EncodeError> {
    let options = Options { fontdb: FONTS.clone(), font_family: FAMILY.to_owned(), ..Options::default() };
    Ok(Tree::from_str(svg, &options)?)
}

pub(crate) fn png(tree: &Tree) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = (tree.size().width() * PNG_SCALE, tree.size().height() * PNG_SCALE);
    let mut pixels = Pixmap::new(whole(width), whole(height)).ok_or(EncodeError::Size { width, height })?;
    resvg::render(tree, Transform::from_scale(PNG_SCALE, PNG_SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| EncodeError::Png(error.to_string()))
}

/// The picture as a one-page PDF with selectable text, without a date or a random identifier.
pub(crate) fn pdf(tree: &Tree) -> Result<Vec<u8>, EncodeError> {
    let (width, height) = (tree.size().width() * POINTS_PER_PX, tree.size().height() * POINTS_PER_PX);
    let fault = || EncodeError::Size { width, height };
    let page = PageSettings::from_wh(width, height).ok_or_else(fault)?;
    let size = Size::from_wh(width, height).ok_or_else(fault)?;
    let settings = SerializeSettings { xmp_metadata: false, ..SerializeSettings::default() };
    let mut document = Document::new_with(settings);
    let mut page = document.start_page_with(page);
    let mut surface = page.surface();
    surface.draw_svg(tree, size, SvgSettings::default()).ok_or_else(fault)?;
    surface.finish();
    page.finish();
    document.finish().map_err(|error| EncodeError::Pdf(format!("{error:?}")))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` clamps; 0 is refused by Pixmap")]
fn whole(size: f32) -> u32 {
    size.ceil() as u32
}
