//! Finds the nearest valid name, for the "did you mean" of an error.

/// The candidate most similar to `name`, if any is similar. Similarity is Jaro-Winkler, ignoring ASCII case, or one
/// typing error (a letter added, missing or replaced, or two exchanged). The first of equal candidates wins, so the
/// answer depends only on the given order. Long names are not compared, since that takes the product of their lengths.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LIKE_ENOUGH: f64 = 0.75;
    const ONE_SLIP: f64 = 0.85;
    const LONGEST: usize = 100;
    const MOST: usize = 10_000;
    if name.len() > LONGEST {
        return None;
    }
    let name = name.to_ascii_lowercase();
    let mut best: Option<(&str, f64)> = None;
    for candidate in candidates.into_iter().filter(|candidate| candidate.len() <= LONGEST).take(MOST) {
        let known = candidate.to_ascii_lowercase();
        let slip = name.chars().count() > 1 && strsim::osa_distance(&name, &known) == 1;
        let likeness = strsim::jaro_winkler(&name, &known).max(if slip { ONE_SLIP } else { 0.0 });
        if likeness >= LIKE_ENOUGH && best.is_none_or(|(_, b)| likeness > b) {
            best = Some((candidate, likeness));
        }
    }
    best.map(|(candidate, _)| candidate)
}

pub fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(name, candidates).map(|near| format!("did you mean `{near}`?"))
}

/// `; did you mean ...?` with the most similar candidate; empty if no candidate is similar.
pub fn hint<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    did_you_mean(name, candidates).map_or_else(String::new, |question| format!("; {question}"))
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn the_closest_name_is_suggested_and_distant_ones_are_not() {
        let names = ["self_color", "selected_cube", "body_color"];
        assert_eq!(nearest("self_colour", names), Some("self_color"));
        assert_eq!(nearest("SELF_COLOR", names), Some("self_color"));
        assert_eq!(nearest("zzz", names), None);
        assert_eq!(nearest("MRC", ["TSA", "MCR", "CR"]), Some("MCR"));
        let long = "x".repeat(1 << 20);
        assert_eq!((nearest(&long, ["x"]), nearest("self_colour", [&long, "self_color"])), (None, Some("self_color")));
    }
}
