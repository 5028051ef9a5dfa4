//! The ten colours of the study: what a body, a cube and a claim can be.

/// A colour of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each is the colour of its name")]
pub enum Color {
    Blue,
    Brown,
    Cyan,
    Green,
    Orange,
    Pink,
    Purple,
    Red,
    White,
    Yellow,
}

impl Color {
    /// All ten, by name.
    pub const ALL: [Self; 10] = [
        Self::Blue,
        Self::Brown,
        Self::Cyan,
        Self::Green,
        Self::Orange,
        Self::Pink,
        Self::Purple,
        Self::Red,
        Self::White,
        Self::Yellow,
    ];

    /// The name in traces and prompts.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blue => "blue",
            Self::Brown => "brown",
            Self::Cyan => "cyan",
            Self::Green => "green",
            Self::Orange => "orange",
            Self::Pink => "pink",
            Self::Purple => "purple",
            Self::Red => "red",
            Self::White => "white",
            Self::Yellow => "yellow",
        }
    }

    /// The colour of this name, as [`Color::name`] writes it.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|color| color.name() == name)
    }
}
