//! The names that an expression mentions.

use super::syntax::{Expr, ExprKind, parse};

/// The columns, `let`s and metrics that an expression mentions directly, each once, in the order of the text. Empty if
/// the text is not an expression.
pub fn mentioned(expression: &str) -> Vec<String> {
    let mut found = Vec::new();
    for part in parse(expression).iter().flat_map(all_parts) {
        if let ExprKind::Name(name) = &part.kind
            && !found.contains(name)
        {
            found.push(name.clone());
        }
    }
    found
}

/// Returns true if an expression uses only values of these names, and no aggregates of steps.
pub fn is_about(expression: &str, is_known: &dyn Fn(&str) -> bool) -> bool {
    let holds = |part: &Expr| match &part.kind {
        ExprKind::Name(name) => is_known(name),
        ExprKind::Call { name, .. } => matches!(name.as_str(), "coalesce" | "nullif" | "div" | "regexp_like"),
        _ => true,
    };
    parse(expression).is_ok_and(|expr| all_parts(&expr).into_iter().all(holds))
}

/// An expression and all that it is made of, in the order of the text.
fn all_parts(expr: &Expr) -> Vec<&Expr> {
    std::iter::once(expr).chain(parts(expr).into_iter().flat_map(all_parts)).collect()
}

/// The subexpressions of an expression, in the order of the text.
fn parts(expr: &Expr) -> Vec<&Expr> {
    match &expr.kind {
        ExprKind::Name(_) | ExprKind::Literal(_) => Vec::new(),
        ExprKind::Not(x) | ExprKind::Negate(x) | ExprKind::IsNull(x) | ExprKind::IsTruth(x, _) => vec![x],
        ExprKind::Binary(_, x, y) | ExprKind::Distinct(x, y) => vec![x, y],
        ExprKind::Between(x, [low, high]) => vec![x, low, high],
        ExprKind::InList(x, list) => std::iter::once(x.as_ref()).chain(list).collect(),
        ExprKind::Case { operand, branches, otherwise } => {
            let branches = branches.iter().flat_map(|(when, then)| [when, then]);
            operand.as_deref().into_iter().chain(branches).chain(otherwise.as_deref()).collect()
        }
        ExprKind::Call { arguments, .. } => arguments.iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::{is_about, mentioned};

    #[test]
    fn a_condition_on_aggregates_or_other_names_is_not_about_keys() {
        let is_key = |name: &str| ["seed", "model"].contains(&name);
        for text in ["seed = 1 and model in ('a', 'b')", "regexp_like(model, 'x')"] {
            assert!(is_about(text, &is_key), "{text}");
        }
        for text in ["TSA = 1", "seed = 1 and length() > 5", "any(seed = 1)", "seed ="] {
            assert!(!is_about(text, &is_key), "{text}");
        }
    }

    #[test]
    fn names_come_once_and_in_order_from_every_construct() {
        let text = "not (a = 1 or b is null) and c is not true and d between e and -f and g in (a, h) \
                    and case i when j then k else l end = m and any(n is distinct from o) and 'p' = coalesce(\"q r\", 1)";
        let expected = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "q r"];
        assert_eq!(mentioned(text), expected);
        assert_eq!(mentioned("a ="), Vec::<String>::new());
    }
}
