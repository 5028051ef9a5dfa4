//! The definitions in their file's words, for readers.

use serde_json::{Value as Json, json};

use mirrorstats_exact::escape::visible;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind, Metric, StandardError};

pub fn metrics(catalog: &Catalog) -> Vec<Json> {
    let view = |(name, metric): (&String, &Metric)| {
        json!({
            "name": visible(name),
            "title": visible(&metric.title),
            "help": prose(&metric.help),
            "value": multiline(&metric.value),
            "when": metric.when.as_deref().map(multiline),
            "is_rate": metric.kind == Kind::Rate,
            "remarks": remarks(metric),
        })
    };
    catalog.metric.iter().map(view).collect()
}

pub(super) fn lets(catalog: &Catalog) -> Vec<Json> {
    catalog.lets.iter().map(|(name, value)| json!({ "name": visible(name), "value": multiline(value) })).collect()
}

pub(super) fn experiments(catalog: &Catalog) -> Vec<Json> {
    let view = |(name, experiment): (&String, &mirrorstats_metric::catalogs::catalog::Experiment)| {
        let chance = experiment.chance.iter().map(|(metric, level)| match level {
            Some(level) => format!("{} {level}", visible(metric)),
            None => format!("{} none", visible(metric)),
        });
        let reference = experiment.reference.iter().map(|(metric, levels)| {
            let levels: Vec<String> = levels.iter().map(ToString::to_string).collect();
            format!("{} {}", visible(metric), levels.join(", "))
        });
        json!({
            "name": visible(name),
            "title": visible(&experiment.title),
            "chance": chance.collect::<Vec<_>>().join("; "),
            "reference": reference.collect::<Vec<_>>().join("; "),
        })
    };
    catalog.experiment.iter().map(view).collect()
}

fn prose(text: &str) -> Vec<Json> {
    let stretches: Vec<&str> = text.split('`').collect();
    let (paired, rest) = stretches.split_at(stretches.len().saturating_sub(1) / 2 * 2);
    let pieces = paired.iter().enumerate().map(|(at, text)| (at % 2 == 1, (*text).to_owned()));
    pieces
        .chain(std::iter::once((false, rest.join("`"))))
        .filter(|(_, text)| !text.is_empty())
        .map(|(is_code, text)| json!({ "text": visible(&text), "is_code": is_code }))
        .collect()
}

fn remarks(metric: &Metric) -> String {
    let mut remarks = vec![match metric.kind {
        Kind::Rate => "rate, 0 or 1 for each episode".to_owned(),
        Kind::Quantity => visible(&metric.unit),
    }];
    remarks.extend(match metric.better {
        Better::Higher => Some("higher is better".to_owned()),
        Better::Lower => Some("lower is better".to_owned()),
        Better::Neither => None,
    });
    if metric.se == StandardError::Population {
        remarks.push("standard error of the population form".to_owned());
    }
    remarks.extend(metric.chance.map(|chance| format!("chance {chance}")));
    if !metric.section.is_empty() {
        remarks.push(format!("paper {}", visible(&metric.section)));
    }
    remarks.retain(|remark| !remark.is_empty());
    remarks.join(" · ")
}

fn multiline(text: &str) -> String {
    text.trim().lines().map(visible).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::prose;

    fn spelled(text: &str) -> Vec<String> {
        let piece = |piece: serde_json::Value| {
            let text = piece["text"].as_str().unwrap();
            if piece["is_code"] == true { format!("<{text}>") } else { text.to_owned() }
        };
        prose(text).into_iter().map(piece).collect()
    }

    #[test]
    fn names_between_backticks_stand_out() {
        assert_eq!(spelled("Without `done` there is no success."), ["Without ", "<done>", " there is no success."]);
        assert_eq!(spelled("`a` or `b`"), ["<a>", " or ", "<b>"]);
        assert_eq!(spelled("plain"), ["plain"]);
        assert_eq!(spelled("`a` and a ` alone"), ["<a>", " and a ` alone"]);
        assert_eq!(spelled("one ` alone"), ["one ` alone"]);
        assert_eq!(spelled(""), Vec::<String>::new());
    }
}
