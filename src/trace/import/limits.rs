//! What the values of steps are held against besides the schema.

use crate::trace::schema::colors::palette::Palette;

/// What there is of experiments and colours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Limits<'a> {
    /// The experiments that there are; any if `None`.
    pub experiments: Option<&'a [String]>,
    /// The colours that there are, which the trace then declares; any if `None`.
    pub palette: Option<&'a Palette>,
}
