//! The features that this build has.

/// Every feature, in the order of their names, and whether it is there.
const ALL: [(&str, bool); 4] = [
    ("polars", cfg!(feature = "polars")),
    ("raster", cfg!(feature = "raster")),
    ("sim", cfg!(feature = "sim")),
    ("view", cfg!(feature = "view")),
];

/// The features that are there, separated by commas.
pub fn present() -> String {
    let names: Vec<&str> = ALL.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The features to build for one more than these: `polars,sim`. Those of every build are left out.
pub fn with(name: &str) -> String {
    let chosen = ALL.into_iter().filter(|(known, is_there)| (*is_there && *known != "raster") || *known == name);
    chosen.map(|(known, _)| known).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::{present, with};

    #[test]
    fn a_feature_is_added_to_those_that_are_there() {
        assert!(with("polars").split(',').any(|name| name == "polars"));
        assert_eq!(with("polars").split(',').any(|name| name == "sim"), cfg!(feature = "sim"));
        assert_eq!(present().contains("sim"), cfg!(feature = "sim"));
    }
}
