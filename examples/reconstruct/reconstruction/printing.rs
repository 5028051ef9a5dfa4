//! How the paper prints exact moments: two rounding rules and two standard errors.

use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::StandardError;

use super::published::{Pair, Source, Value};

/// Returns true if integers with these moments print as everything published about a metric.
pub fn matches(pair: &Pair, metric: &str, moments: Moments) -> bool {
    pair.prints(metric).iter().all(|print| value(print.source, metric, moments) == print.value)
}

/// Returns true if the mean alone prints as everything published about a metric.
pub fn matches_mean(pair: &Pair, metric: &str, moments: Moments) -> bool {
    let mean = |source| moments.mean().map(|mean| number(source, mean));
    pair.prints(metric).iter().all(|print| mean(print.source) == print.value.as_ref().map(|value| value.mean.clone()))
}

/// Mean and standard error as `source` prints them; `None` without a defined episode.
pub fn value(source: Source, metric: &str, moments: Moments) -> Option<Value> {
    let mean = number(source, moments.mean()?);
    // One episode has no spread; the paper prints 0.00.
    let se = number(source, moments.se(standard_error(metric)).unwrap_or(0.0));
    Some(Value { mean, se })
}

/// Only `AR_SC` uses the population form.
fn standard_error(metric: &str) -> StandardError {
    if metric == "AR_SC" { StandardError::Population } else { StandardError::Sample }
}

/// A non-negative number, rounded like in `source`.
pub fn number(source: Source, number: f64) -> String {
    match source {
        Source::Main => rounded_twice(number),
        Source::Appendix => format!("{number:.2}"),
        Source::Prose => format!("{number:.3}"),
    }
}

/// First to three decimals, then half up to two.
fn rounded_twice(number: f64) -> String {
    let thousandths: u64 =
        format!("{number:.3}").replace('.', "").parse().expect("a number with three decimals is digits and a point");
    let hundredths = (thousandths + 5) / 10;
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}

#[cfg(test)]
mod tests {
    use super::super::published::Source::{Appendix, Main, Prose};
    use super::number;

    #[test]
    fn each_place_rounds_in_its_own_way() {
        for (value, main, appendix, prose) in [
            (19.0 / 21.0, "0.91", "0.90", "0.905"),
            (0.125, "0.13", "0.12", "0.125"),
            (0.875, "0.88", "0.88", "0.875"),
            (1216.0 / 21.0, "57.91", "57.90", "57.905"),
            (0.9996, "1.00", "1.00", "1.000"),
            (0.0, "0.00", "0.00", "0.000"),
        ] {
            assert_eq!([Main, Appendix, Prose].map(|place| number(place, value)), [main, appendix, prose], "{value}");
        }
    }
}
