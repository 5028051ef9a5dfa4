//! Relations between metrics of a catalog: durations and their completion, rates and the same among completed episodes.
//!
//! Rule: declarations hold. Without one, expressions may imply the relation, whatever the names of the metrics. A
//! metric may repeat another one if some moment is not null, while the other is 0 without that moment: then it is the
//! same among finished episodes. A duration that is that moment, or else the length of the episode, finishes there.

use crate::catalogs::catalog::{Catalog, Kind, Metric};
use crate::catalogs::measure::Measures;
use crate::syntax::{BinaryOp, Expr, ExprKind, Literal, parse};

const DEEPEST: usize = 64;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Relations {
    /// Each duration, and the rate that is defined only in finished episodes.
    pub durations: Vec<(String, String)>,
    /// Each rate that counts unfinished episodes as failures, and its version among finished episodes.
    pub completed: Vec<(String, String)>,
}

impl Relations {
    pub fn of(catalog: &Catalog) -> Self {
        let reader = RelationReader { catalog };
        let moments: Vec<Completed> =
            catalog.metric.iter().filter_map(|(name, one)| reader.completed(name, one)).collect();
        let mut found = Self::default();
        for (name, metric) in &catalog.metric {
            let known = |other: &&String| catalog.metric.contains_key(*other);
            let declared = metric.completes.as_ref().filter(known).cloned();
            let implied = || moments.iter().find(|moment| moment.name == *name).map(|moment| moment.whole.clone());
            found.completed.extend(declared.or_else(implied).map(|whole| (whole, name.clone())));
            let declared = metric.finished.as_ref().filter(known).cloned();
            let finished = declared.or_else(|| reader.finished(metric, &moments));
            found.durations.extend(finished.map(|finished| (name.clone(), finished)));
        }
        found
    }

    pub fn finished(&self, duration: &str) -> Option<&str> {
        self.durations.iter().find(|(known, _)| known == duration).map(|(_, finished)| finished.as_str())
    }

    pub fn completed<'r>(&'r self, whole: &'r str) -> impl Iterator<Item = &'r str> {
        self.completed.iter().filter(move |(known, _)| known == whole).map(|(_, completed)| completed.as_str())
    }

    pub fn whole(&self, completed: &str) -> Option<&str> {
        self.completed.iter().find(|(_, known)| known == completed).map(|(whole, _)| whole.as_str())
    }
}

/// A rate that repeats `whole` if a moment is not null.
struct Completed {
    name: String,
    whole: String,
    moment: Expr,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Without {
    Null,
    False,
    /// Null or false.
    NotTrue,
    Open,
}

struct RelationReader<'c> {
    catalog: &'c Catalog,
}

impl RelationReader<'_> {
    fn completed(&self, name: &str, metric: &Metric) -> Option<Completed> {
        let ExprKind::Name(whole) = parse(&metric.value).ok()?.kind else { return None };
        let (of_whole, when) = (self.catalog.metric.get(&whole)?, parse(metric.when.as_ref()?).ok()?);
        if [metric, of_whole].iter().any(|metric| metric.kind != Kind::Rate) {
            return None;
        }
        let others = of_whole.when.as_ref().and_then(|when| parse(when).ok());
        let others = others.as_ref().map_or_else(Vec::new, conditions);
        let own: Vec<&Expr> = conditions(&when).into_iter().filter(|condition| !others.contains(condition)).collect();
        let [condition] = own.as_slice() else { return None };
        let moment = not_null(condition)?;
        let is_failure = self.of_text(moment, &of_whole.value, DEEPEST) == Without::False;
        is_failure.then(|| Completed { name: name.to_owned(), whole, moment: moment.clone() })
    }

    fn finished(&self, duration: &Metric, moments: &[Completed]) -> Option<String> {
        let mut expr = parse(&duration.value).ok()?;
        for _ in 0..DEEPEST {
            let ExprKind::Name(name) = &expr.kind else { break };
            expr = parse(self.catalog.lets.get(name)?).ok()?;
        }
        let ExprKind::Call { name, arguments } = expr.kind else { return None };
        let [moment, Expr { kind: ExprKind::Call { name: last, .. }, .. }] = arguments.as_slice() else { return None };
        let is_duration = duration.measures.is_none_or(|declared| declared == Measures::Duration);
        let known = moments.iter().find(|known| known.moment == *moment);
        known.filter(|_| is_duration && name == "coalesce" && last == "length").map(|known| known.name.clone())
    }

    fn of_text(&self, moment: &Expr, text: &str, depth: usize) -> Without {
        parse(text).map_or(Without::Open, |expr| self.without(moment, &expr, depth))
    }

    /// The value of an expression if the moment is null.
    fn without(&self, moment: &Expr, expr: &Expr, depth: usize) -> Without {
        let of = |part: &Expr| self.without(moment, part, depth);
        let null_if = |is_null| if is_null { Without::Null } else { Without::Open };
        let is_null = |part: &Expr| of(part) == Without::Null;
        match &expr.kind {
            _ if expr == moment => Without::Null,
            ExprKind::Name(name) => self.of_name(moment, name, depth),
            ExprKind::Literal(Literal::Bool(false) | Literal::Int(0)) => Without::False,
            _ if not_null(expr).is_some_and(is_null) => Without::False,
            ExprKind::Binary(BinaryOp::And, x, y) => match (of(x), of(y)) {
                (Without::False, _) | (_, Without::False) => Without::False,
                (Without::Open, Without::Open) => Without::Open,
                _ => Without::NotTrue,
            },
            ExprKind::Binary(BinaryOp::Or, ..) => Without::Open,
            ExprKind::Binary(_, x, y) => null_if(is_null(x) || is_null(y)),
            ExprKind::Call { name, arguments } => match (name.as_str(), arguments.as_slice()) {
                ("any", [p]) if of(p) != Without::Open => Without::False,
                ("at", [_, at]) => null_if(is_null(at)),
                ("coalesce", values) => match values.iter().map(of).find(|value| *value != Without::Null) {
                    Some(Without::False) => Without::False,
                    first => null_if(first.is_none()),
                },
                _ => Without::Open,
            },
            _ => Without::Open,
        }
    }

    fn of_name(&self, moment: &Expr, name: &str, depth: usize) -> Without {
        let metric =
            || self.catalog.metric.get(name).filter(|metric| metric.when.is_none()).map(|metric| &metric.value);
        match (self.catalog.lets.get(name).or_else(metric), depth) {
            (Some(text), 1..) => self.of_text(moment, text, depth - 1),
            _ => Without::Open,
        }
    }
}

/// The moment in `moment is not null`.
fn not_null(expr: &Expr) -> Option<&Expr> {
    let ExprKind::Not(inner) = &expr.kind else { return None };
    if let ExprKind::IsNull(moment) = &inner.kind { Some(moment) } else { None }
}

fn conditions(expr: &Expr) -> Vec<&Expr> {
    match &expr.kind {
        ExprKind::Binary(BinaryOp::And, x, y) => conditions(x).into_iter().chain(conditions(y)).collect(),
        _ => vec![expr],
    }
}

#[cfg(test)]
mod tests {
    use super::Relations;
    use crate::definitions::Definitions;
    use crate::file::built_in;
    use crate::tests::schema_columns;

    fn of(text: &str) -> Relations {
        Relations::of(&Definitions::from_toml("test", text, &schema_columns()).unwrap().catalog)
    }

    fn pairs(found: &[(String, String)]) -> Vec<(&str, &str)> {
        found.iter().map(|(one, other)| (one.as_str(), other.as_str())).collect()
    }

    #[test]
    fn completion_follows_from_expressions_whatever_their_names() {
        for name in ["paper", "extended", "battery"] {
            let found = Relations::of(&Definitions::load(name, &schema_columns()).unwrap().catalog);
            assert_eq!(pairs(&found.durations), [("TTD", "TSA-C")], "{name}");
            assert_eq!(pairs(&found.completed), [("TSA", "TSA-C")], "{name}");
        }
        let found = of(&built_in("paper").unwrap().replace("TSA-C", "Q").replace("TSA", "X").replace("TTD", "Z"));
        assert_eq!((pairs(&found.durations), pairs(&found.completed)), (vec![("Z", "Q")], vec![("X", "Q")]));
    }

    #[test]
    fn definitions_side_by_side_keep_their_relations() {
        let columns = schema_columns();
        let part = |name: &str, one: &str| (Definitions::load(name, &columns).unwrap(), vec![one.to_owned()]);
        let parts = [part("paper", "E1"), part("reach", "reach-bare")];
        let both = Definitions::side_by_side(&parts, &columns).unwrap().unwrap();
        let found = Relations::of(&both.catalog);
        assert_eq!(
            (pairs(&found.durations), pairs(&found.completed)),
            (vec![("TTD", "TSA-C")], vec![("TSA", "TSA-C")])
        );
    }

    const RATES: &str = "[metric.V]\nvalue = \"any(mirror_visible)\"\n[metric.D]\nvalue = \"length()\"\n";

    #[test]
    fn a_failure_is_declared_or_unknown() {
        let among = "[metric.C]\nvalue = \"V\"\nwhen = \"last(action = 'done') is not null\"\n";
        assert_eq!(of(&format!("{RATES}{among}")), Relations::default());
        let found = of(&format!("{RATES}finished = \"C\"\n{among}completes = \"V\"\n"));
        assert_eq!((pairs(&found.durations), pairs(&found.completed)), (vec![("D", "C")], vec![("V", "C")]));
    }

    #[test]
    fn a_declared_count_is_not_a_duration() {
        let text =
            built_in("paper").unwrap().replace("value   = \"finish\"", "value = \"finish\"\nmeasures = \"count\"");
        assert!(of(&text).durations.is_empty());
    }

    #[test]
    fn a_declaration_that_does_not_fit_its_metric_is_refused_at_its_location() {
        let refused = |keys: &str| {
            let text =
                format!("[metric.R]\nvalue = \"any(mirror_visible)\"\n[metric.Q]\nvalue = \"length()\"\n{keys}\n");
            Definitions::from_toml("test", &text, &schema_columns()).unwrap_err().to_string()
        };
        for (keys, expected) in [
            ("finished = \"Z\"", "`Z` is no metric of these definitions"),
            ("finished = \"Q\"", "does not fit the values of the two metrics"),
            ("completes = \"R\"", "does not fit the values of the two metrics"),
            ("measures = \"rate\"", "`measures` does not fit the values of `Q`"),
            ("measures = \"duration\"", "does not say which episodes finished"),
            ("measures = \"fraction\"", "`Q` is a fraction without a whole"),
            ("range = { least = 3, most = 3 }", "the range of `Q` is empty"),
            ("range = { lest = 3 }", "unknown key `lest`"),
            ("measures = \"counts\"", "did you mean `count`?"),
        ] {
            assert!(refused(keys).contains(expected), "{keys}: {}", refused(keys));
        }
    }
}
