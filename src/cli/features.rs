//! The features of this build.

/// Every feature, ordered by name; true if this build has it.
const ALL: [(&str, bool); 4] = [
    ("polars", cfg!(feature = "polars")),
    ("raster", cfg!(feature = "raster")),
    ("sim", cfg!(feature = "sim")),
    ("view", cfg!(feature = "view")),
];

pub fn present() -> String {
    let names: Vec<&str> = ALL.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The features for a build with one more: `polars,sim`. Features of every build are left out.
pub fn with(name: &str) -> String {
    let chosen = ALL.into_iter().filter(|(known, is_there)| (*is_there && *known != "raster") || *known == name);
    chosen.map(|(known, _)| known).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::{present, with};

    #[test]
    fn a_missing_feature_is_added_to_the_present_ones() {
        assert!(with("polars").split(',').any(|name| name == "polars"));
        assert_eq!(with("polars").split(',').any(|name| name == "sim"), cfg!(feature = "sim"));
        assert_eq!(present().contains("sim"), cfg!(feature = "sim"));
    }
}
