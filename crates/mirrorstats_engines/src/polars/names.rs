//! Names of columns in a query's text: by number, and those that DuckDB gives to columns without one.

use std::ops::ControlFlow;

use sqlparser::ast::{
    Expr, Function, FunctionArg, FunctionArgExpr, FunctionArguments, Ident, UnaryOperator, Value, ValueWithSpan,
    visit_expressions_mut,
};

/// The number that is written as an integer, such as the position of a column.
pub(super) fn integer(ast: &Expr) -> Option<i64> {
    match ast {
        Expr::Value(ValueWithSpan { value: Value::Number(text, false), .. }) => text.parse().ok(),
        Expr::UnaryOp { op: UnaryOperator::Plus, expr } => integer(expr),
        _ => None,
    }
}

/// The table, if it is given, and the name of a column.
pub(super) fn reference(ast: &Expr) -> Option<(Option<&Ident>, &Ident)> {
    match ast {
        Expr::Identifier(name) => Some((None, name)),
        Expr::CompoundIdentifier(parts) => match parts.as_slice() {
            [table, name] => Some((Some(table), name)),
            _ => None,
        },
        _ => None,
    }
}

pub(super) fn column_name(expr: &Expr) -> String {
    match expr {
        Expr::Nested(inner) => column_name(inner),
        Expr::BinaryOp { left, op, right } => format!("({} {op} {})", column_name(left), column_name(right)),
        Expr::Function(function) if is_count_of_rows(function) => "count_star()".to_owned(),
        _ => {
            let mut expr = expr.clone();
            let _ = visit_expressions_mut(&mut expr, |part| {
                if let Expr::Function(function) = part {
                    function.name = Ident::new(function.name.to_string().to_ascii_lowercase()).into();
                }
                ControlFlow::<()>::Continue(())
            });
            // A quote would end the name.
            expr.to_string().replace('"', "")
        }
    }
}

fn is_count_of_rows(function: &Function) -> bool {
    let FunctionArguments::List(list) = &function.args else { return false };
    let star = matches!(list.args.as_slice(), [FunctionArg::Unnamed(FunctionArgExpr::Wildcard)]);
    star && function.name.to_string().eq_ignore_ascii_case("count")
        && function.over.is_none()
        && function.filter.is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlparser::dialect::GenericDialect;
    use sqlparser::parser::Parser;

    #[test]
    fn unnamed_columns_are_named_as_in_duckdb() {
        let name = |text: &str| {
            let mut parser = Parser::new(&GenericDialect {}).try_with_sql(text).unwrap();
            column_name(&parser.parse_expr().unwrap())
        };
        let names = ["COUNT(*)", "AVG(x)", "(x + 1)", "max(\"TSA-C\")"].map(name);
        assert_eq!(names, ["count_star()", "avg(x)", "(x + 1)", "max(TSA-C)"]);
    }
}
