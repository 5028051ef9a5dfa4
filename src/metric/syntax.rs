//! SQL text to the expressions of the calculus.
//!
//! The grammar is SQL's own, read by `sqlparser`; this file keeps the constructs that the calculus
//! has, refuses every other one by its name, and remembers where each stood in the text.

use std::ops::Range;

use sqlparser::ast::{self, Spanned as _};
use sqlparser::dialect::GenericDialect;
use sqlparser::keywords::Keyword;
use sqlparser::parser::{Parser, ParserError};
use sqlparser::tokenizer::{Location, Token, TokenWithSpan, Tokenizer};

use super::functions;

/// An expression as written.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// Its bytes in the text of the expression.
    pub span: Range<usize>,
}

/// The constructs of the calculus.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// A column, a `let` or a metric.
    Name(String),
    /// A constant.
    Literal(Literal),
    /// `not x`
    Not(Box<Expr>),
    /// `-x`
    Negate(Box<Expr>),
    /// `x op y`
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// `x is [not] null`
    IsNull { operand: Box<Expr>, negated: bool },
    /// `x is [not] true`, `x is [not] false`
    IsTruth { operand: Box<Expr>, truth: bool, negated: bool },
    /// `x is [not] distinct from y`
    Distinct { left: Box<Expr>, right: Box<Expr>, negated: bool },
    /// `x [not] between low and high`
    Between { operand: Box<Expr>, low: Box<Expr>, high: Box<Expr>, negated: bool },
    /// `x [not] in (a, b, ...)`
    InList { operand: Box<Expr>, list: Vec<Expr>, negated: bool },
    /// `case [x] when a then b ... [else c] end`
    Case { operand: Option<Box<Expr>>, branches: Vec<(Expr, Expr)>, otherwise: Option<Box<Expr>> },
    /// `name(a, b, ...)`, the name in lowercase
    Call { name: String, arguments: Vec<Expr> },
}

/// A constant.
#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    /// `null`
    Null,
    /// `true`, `false`
    Bool(bool),
    /// `42`
    Int(i64),
    /// `0.5`
    Float(f64),
    /// `'text'`
    Text(String),
}

/// Operators between two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BinaryOp {
    And,
    Or,
    Equal,
    NotEqual,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Add,
    Subtract,
    Multiply,
    Remainder,
}

impl BinaryOp {
    /// As it is written in SQL.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::And => "and",
            Self::Or => "or",
            Self::Equal => "=",
            Self::NotEqual => "<>",
            Self::Less => "<",
            Self::LessEqual => "<=",
            Self::Greater => ">",
            Self::GreaterEqual => ">=",
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Remainder => "%",
        }
    }
}

/// What keeps a text from being an expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntaxFault {
    /// What is wrong.
    pub message: String,
    /// Its bytes in the text.
    pub span: Range<usize>,
    /// What to write instead.
    pub help: Option<String>,
}

/// The longest text of one expression, in bytes.
const LONGEST: usize = 16 * 1024;
/// The most words and signs of one expression: the parser nests as deeply as a chain of operators is long, and takes its
/// tree apart again by recursion.
const MOST_TOKENS: usize = 4000;
/// The deepest nesting of one expression.
const DEEPEST: usize = 120;

/// The functions that SQL reads as keywords where a name could stand.
const QUANTIFIER_NAMES: [&str; 3] = ["any", "all", "some"];

/// Reads one expression.
///
/// # Errors
/// The first fault of the grammar, or every construct that the calculus does not have.
pub fn parse(text: &str) -> Result<Expr, Vec<SyntaxFault>> {
    if text.len() > LONGEST {
        let message = format!("an expression of {} bytes is too long: the most is {LONGEST}", text.len());
        return Err(vec![SyntaxFault { message, span: 0..text.len(), help: Some("name its parts in [let]".into()) }]);
    }
    let parsed = parse_sql(text).map_err(|fault| vec![fault])?;
    let mut reader = Reader { text, faults: Vec::new() };
    let expr = reader.read(&parsed, 0);
    match expr {
        Some(expr) if reader.faults.is_empty() => Ok(expr),
        _ => Err(reader.faults),
    }
}

fn parse_sql(text: &str) -> Result<ast::Expr, SyntaxFault> {
    let dialect = GenericDialect {};
    let tokens = Tokenizer::new(&dialect, text).tokenize_with_location().map_err(|error| SyntaxFault {
        message: format!("not an expression: {}", lowercase_first(&error.message)),
        span: byte_of(text, error.location)..text.len(),
        help: None,
    })?;
    let count = tokens.iter().filter(|token| !matches!(token.token, Token::Whitespace(_))).count();
    if count > MOST_TOKENS {
        return Err(SyntaxFault {
            message: format!("an expression of {count} words and signs is too long: the most is {MOST_TOKENS}"),
            span: 0..text.len(),
            help: Some("name its parts in [let]".into()),
        });
    }
    let mut parser = Parser::new(&dialect).with_tokens_with_locations(function_names_only(tokens));
    let parsed = parser.parse_expr().map_err(|error| grammar_fault(text, &error))?;
    let next = parser.peek_token();
    if next.token == Token::EOF {
        return Ok(parsed);
    }
    let before = parser.get_previous_token();
    if let Some(fault) = unread_construct(text, before) {
        return Err(fault);
    }
    let help = match &next.token {
        Token::Eq | Token::DoubleEq => None,
        Token::RParen => Some("no parenthesis opens before it".into()),
        Token::SemiColon => Some("a definition is one expression".into()),
        _ if function_of(before).is_some() => function_of(before).map(|usage| format!("write {usage}")),
        Token::Word(word) if word.keyword == Keyword::FROM => {
            Some("a definition reads one episode; there is no FROM".into())
        }
        _ => Some("join conditions with `and` or `or`".into()),
    };
    let start = byte_of(text, next.span.start);
    Err(SyntaxFault {
        message: format!("`{}` is one word too many: the expression ends before it", next.token),
        span: start..byte_of(text, next.span.end).max(start + 1),
        help,
    })
}

/// The parser takes `case` and `not` for names where it cannot read what follows them; this says what is the matter.
fn unread_construct(text: &str, before: &TokenWithSpan) -> Option<SyntaxFault> {
    let Token::Word(word) = &before.token else { return None };
    let (message, help) = match (word.keyword, word.quote_style) {
        (Keyword::CASE, None) => (
            "this `case` is faulty or not complete",
            "write `case when p then x else y end`, or `case x when 1 then y end`",
        ),
        (Keyword::NOT, None) => {
            ("what follows this `not` is faulty or nested too deeply", "write `not p` or `not (p and q)`")
        }
        _ => return None,
    };
    let span = byte_of(text, before.span.start)..byte_of(text, before.span.end);
    Some(SyntaxFault { message: message.to_owned(), span, help: Some(help.to_owned()) })
}

/// How the function that a word names is used.
fn function_of(token: &TokenWithSpan) -> Option<&'static str> {
    match &token.token {
        Token::Word(word) if word.quote_style.is_none() => {
            functions::find(&word.value.to_lowercase()).map(|entry| entry.usage)
        }
        _ => None,
    }
}

/// `any(`, `all(` and `some(` become plain names, so that they are functions wherever they stand.
fn function_names_only(mut tokens: Vec<TokenWithSpan>) -> Vec<TokenWithSpan> {
    for at in 1..tokens.len() {
        let opens = tokens[at].token == Token::LParen;
        if let Token::Word(word) = &mut tokens[at - 1].token
            && opens
            && QUANTIFIER_NAMES.contains(&word.value.to_ascii_lowercase().as_str())
        {
            word.keyword = Keyword::NoKeyword;
        }
    }
    tokens
}

/// The parser's own words, its position turned into a span.
fn grammar_fault(text: &str, error: &ParserError) -> SyntaxFault {
    let (message, help) = match error {
        ParserError::ParserError(message) | ParserError::TokenizerError(message) => (message.clone(), None),
        ParserError::RecursionLimitExceeded => {
            ("the expression is nested too deeply".to_owned(), Some("name its parts in [let]".to_owned()))
        }
    };
    let (words, span) = match split_location(&message) {
        Some((words, location)) => {
            let start = byte_of(text, location);
            (words.to_owned(), start..end_of_word(text, start))
        }
        None => (message.clone(), 0..text.len()),
    };
    let words = words.replace("EOF", "the end of the expression");
    SyntaxFault { message: format!("not an expression: {}", lowercase_first(&words)), span, help }
}

/// `Expected: x, found: y at Line: 1, Column: 2` -> the words and the location.
fn split_location(message: &str) -> Option<(&str, Location)> {
    let (words, place) = message.rsplit_once(" at Line: ")?;
    let (line, column) = place.split_once(", Column: ")?;
    Some((words, Location::new(line.parse().ok()?, column.parse().ok()?)))
}

fn lowercase_first(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| first.to_lowercase().chain(characters).collect())
}

fn end_of_word(text: &str, start: usize) -> usize {
    let rest = &text[start..];
    let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    start + word.max(rest.chars().next().map_or(0, char::len_utf8))
}

/// The byte of a 1-based line and column (in characters); the end of the text for a place beyond it.
fn byte_of(text: &str, location: Location) -> usize {
    if location.line == 0 {
        return text.len();
    }
    let mut lines = text.split_inclusive('\n');
    let mut start = 0;
    for _ in 1..location.line {
        start += lines.next().map_or(0, str::len);
    }
    let line = lines.next().unwrap_or("");
    let column = usize::try_from(location.column.saturating_sub(1)).unwrap_or(usize::MAX);
    start + line.char_indices().nth(column).map_or(line.len(), |(at, _)| at)
}

/// A fault that has been told already.
struct Told;

/// Walks the parser's tree and keeps what the calculus has.
struct Reader<'a> {
    text: &'a str,
    faults: Vec<SyntaxFault>,
}

impl Reader<'_> {
    fn read(&mut self, expr: &ast::Expr, depth: usize) -> Option<Expr> {
        let span = self.span(expr);
        if depth > DEEPEST {
            return self.refuse(span, "the expression is nested too deeply", Some("name its parts in [let]"));
        }
        let kind = self.read_kind(expr, &span, depth + 1)?;
        Some(Expr { kind, span })
    }

    fn read_kind(&mut self, expr: &ast::Expr, span: &Range<usize>, depth: usize) -> Option<ExprKind> {
        use ast::Expr as Sql;
        Some(match expr {
            Sql::Nested(inner) => self.read(inner, depth)?.kind,
            Sql::Identifier(name) => ExprKind::Name(name.value.clone()),
            Sql::Value(value) => ExprKind::Literal(self.literal(&value.value, span)?),
            Sql::UnaryOp { op, expr } => return self.unary(*op, expr, span, depth),
            Sql::BinaryOp { left, op, right } => {
                let op = self.operator(op, span);
                let (left, right) = (self.boxed(left, depth), self.boxed(right, depth));
                ExprKind::Binary(op?, left?, right?)
            }
            Sql::IsNull(inner) | Sql::IsUnknown(inner) => {
                ExprKind::IsNull { operand: self.boxed(inner, depth)?, negated: false }
            }
            Sql::IsNotNull(inner) | Sql::IsNotUnknown(inner) => {
                ExprKind::IsNull { operand: self.boxed(inner, depth)?, negated: true }
            }
            Sql::IsTrue(inner) => self.truth(inner, true, false, depth)?,
            Sql::IsNotTrue(inner) => self.truth(inner, true, true, depth)?,
            Sql::IsFalse(inner) => self.truth(inner, false, false, depth)?,
            Sql::IsNotFalse(inner) => self.truth(inner, false, true, depth)?,
            Sql::IsDistinctFrom(left, right) => self.distinct(left, right, false, depth)?,
            Sql::IsNotDistinctFrom(left, right) => self.distinct(left, right, true, depth)?,
            Sql::Between { expr, negated, low, high } => {
                let (operand, low, high) = (self.boxed(expr, depth), self.boxed(low, depth), self.boxed(high, depth));
                ExprKind::Between { operand: operand?, low: low?, high: high?, negated: *negated }
            }
            Sql::InList { expr, list, negated } => {
                let operand = self.boxed(expr, depth);
                ExprKind::InList { operand: operand?, list: self.all(list.iter(), depth)?, negated: *negated }
            }
            Sql::Case { operand, conditions, else_result, .. } => {
                return self.case(operand.as_deref(), conditions, else_result.as_deref(), depth);
            }
            Sql::Function(function) => return self.call(function, span, depth),
            other => return self.unsupported(other, span.clone()),
        })
    }

    fn boxed(&mut self, expr: &ast::Expr, depth: usize) -> Option<Box<Expr>> {
        self.read(expr, depth).map(Box::new)
    }

    fn all<'e>(&mut self, list: impl Iterator<Item = &'e ast::Expr>, depth: usize) -> Option<Vec<Expr>> {
        // Collected in two steps so that the faults of every item are found.
        let items: Vec<Option<Expr>> = list.map(|item| self.read(item, depth)).collect();
        items.into_iter().collect()
    }

    /// Absent is fine, unreadable is not.
    fn optional(&mut self, expr: Option<&ast::Expr>, depth: usize) -> Result<Option<Box<Expr>>, Told> {
        expr.map(|expr| self.boxed(expr, depth).ok_or(Told)).transpose()
    }

    fn truth(&mut self, inner: &ast::Expr, truth: bool, negated: bool, depth: usize) -> Option<ExprKind> {
        Some(ExprKind::IsTruth { operand: self.boxed(inner, depth)?, truth, negated })
    }

    fn distinct(&mut self, left: &ast::Expr, right: &ast::Expr, negated: bool, depth: usize) -> Option<ExprKind> {
        let (left, right) = (self.boxed(left, depth), self.boxed(right, depth));
        Some(ExprKind::Distinct { left: left?, right: right?, negated })
    }

    fn unary(
        &mut self,
        op: ast::UnaryOperator,
        inner: &ast::Expr,
        span: &Range<usize>,
        depth: usize,
    ) -> Option<ExprKind> {
        match op {
            ast::UnaryOperator::Not => Some(ExprKind::Not(self.boxed(inner, depth)?)),
            ast::UnaryOperator::Minus => Some(ExprKind::Negate(self.boxed(inner, depth)?)),
            ast::UnaryOperator::Plus => Some(self.read(inner, depth)?.kind),
            other => self.refuse(span.clone(), format!("the operator `{other}` is not supported"), None),
        }
    }

    fn operator(&mut self, op: &ast::BinaryOperator, span: &Range<usize>) -> Option<BinaryOp> {
        use ast::BinaryOperator as Sql;
        Some(match op {
            Sql::And => BinaryOp::And,
            Sql::Or => BinaryOp::Or,
            Sql::Eq => BinaryOp::Equal,
            Sql::NotEq => BinaryOp::NotEqual,
            Sql::Lt => BinaryOp::Less,
            Sql::LtEq => BinaryOp::LessEqual,
            Sql::Gt => BinaryOp::Greater,
            Sql::GtEq => BinaryOp::GreaterEqual,
            Sql::Plus => BinaryOp::Add,
            Sql::Minus => BinaryOp::Subtract,
            Sql::Multiply => BinaryOp::Multiply,
            Sql::Modulo => BinaryOp::Remainder,
            Sql::Divide => {
                let help = "an episode's value is an integer: write `div(a, b)`, which drops the fraction";
                return self.refuse(span.clone(), "the operator `/` is not supported", Some(help));
            }
            other => return self.refuse(span.clone(), format!("the operator `{other}` is not supported"), None),
        })
    }

    fn literal(&mut self, value: &ast::Value, span: &Range<usize>) -> Option<Literal> {
        match value {
            ast::Value::Null => Some(Literal::Null),
            ast::Value::Boolean(value) => Some(Literal::Bool(*value)),
            ast::Value::SingleQuotedString(text) => Some(Literal::Text(text.clone())),
            ast::Value::Number(digits, _) => self.number(digits, span),
            other => self.refuse(
                span.clone(),
                format!("the constant `{other}` is not supported"),
                Some("constants are numbers, 'text', true, false and null; names take double quotes"),
            ),
        }
    }

    fn number(&mut self, digits: &str, span: &Range<usize>) -> Option<Literal> {
        if digits.bytes().all(|b| b.is_ascii_digit()) {
            return match digits.parse() {
                Ok(value) => Some(Literal::Int(value)),
                Err(_) => self.refuse(span.clone(), format!("the number {digits} exceeds 64 bits"), None),
            };
        }
        match digits.parse::<f64>() {
            Ok(value) if value.is_finite() => Some(Literal::Float(value)),
            _ => self.refuse(span.clone(), format!("`{digits}` is not a number"), None),
        }
    }

    fn case(
        &mut self,
        operand: Option<&ast::Expr>,
        conditions: &[ast::CaseWhen],
        otherwise: Option<&ast::Expr>,
        depth: usize,
    ) -> Option<ExprKind> {
        let operand = self.optional(operand, depth);
        let whens = self.all(conditions.iter().map(|when| &when.condition), depth);
        let thens = self.all(conditions.iter().map(|when| &when.result), depth);
        let otherwise = self.optional(otherwise, depth);
        Some(ExprKind::Case {
            operand: operand.ok()?,
            branches: whens?.into_iter().zip(thens?).collect(),
            otherwise: otherwise.ok()?,
        })
    }

    fn call(&mut self, function: &ast::Function, span: &Range<usize>, depth: usize) -> Option<ExprKind> {
        let name = function.name.to_string().to_lowercase();
        let plain = function.filter.is_none()
            && function.over.is_none()
            && function.null_treatment.is_none()
            && function.within_group.is_empty()
            && matches!(function.parameters, ast::FunctionArguments::None)
            && !function.uses_odbc_syntax;
        let ast::FunctionArguments::List(list) = &function.args else {
            return self.refuse(span.clone(), format!("`{name}` needs arguments in parentheses"), None);
        };
        if !plain || list.duplicate_treatment.is_some() || !list.clauses.is_empty() {
            let message = format!("`{name}` takes plain arguments: no DISTINCT, FILTER, OVER or ORDER BY");
            return self.refuse(span.clone(), message, Some("put the condition inside: `count(a and b)`"));
        }
        let mut arguments = Vec::with_capacity(list.args.len());
        for argument in &list.args {
            match argument {
                ast::FunctionArg::Unnamed(ast::FunctionArgExpr::Expr(expr)) => arguments.push(expr),
                _ if name == "count" => {
                    return self.refuse(span.clone(), "`count(*)` is not supported", Some("write `length()`"));
                }
                other => return self.refuse(span.clone(), format!("the argument `{other}` is not supported"), None),
            }
        }
        Some(ExprKind::Call { name, arguments: self.all(arguments.into_iter(), depth)? })
    }

    fn unsupported(&mut self, expr: &ast::Expr, span: Range<usize>) -> Option<ExprKind> {
        use ast::Expr as Sql;
        let (what, help) = match expr {
            Sql::CompoundIdentifier(_) => ("a name with a dot", Some("there is one table: write the column alone")),
            Sql::Subquery(_) | Sql::Exists { .. } | Sql::InSubquery { .. } => ("a subquery", None),
            Sql::Cast { .. } | Sql::Convert { .. } => ("a cast", Some("types follow from the columns")),
            Sql::Like { .. } | Sql::ILike { .. } | Sql::SimilarTo { .. } | Sql::RLike { .. } => {
                ("pattern matching with LIKE", Some("write `regexp_like(text, 'pattern')`"))
            }
            Sql::Tuple(_) => ("a list of values", Some("lists stand after `in`")),
            Sql::AnyOp { .. } | Sql::AllOp { .. } => ("a quantified comparison", Some("write `any(p)` or `all(p)`")),
            _ => ("this construct", None),
        };
        self.refuse(span, format!("{what} is not supported: `{}`", shortened(&expr.to_string())), help)
    }

    fn refuse<T>(&mut self, span: Range<usize>, message: impl Into<String>, help: Option<&str>) -> Option<T> {
        self.faults.push(SyntaxFault { message: message.into(), span, help: help.map(str::to_owned) });
        None
    }

    fn span(&self, expr: &ast::Expr) -> Range<usize> {
        let span = expr.span();
        if span.start.line == 0 {
            return 0..self.text.len();
        }
        let start = byte_of(self.text, span.start);
        let end = byte_of(self.text, span.end).max(start);
        match expr {
            ast::Expr::Function(_) => start..end_of_call(self.text, start).unwrap_or(end),
            _ => start..end,
        }
    }
}

/// The beginning of a text that may be as long as an expression.
fn shortened(text: &str) -> String {
    const ENOUGH: usize = 60;
    match text.char_indices().nth(ENOUGH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Behind the parenthesis that closes the call that begins at `start`.
fn end_of_call(text: &str, start: usize) -> Option<usize> {
    let mut depth = 0usize;
    let mut quote = None;
    for (at, c) in text[start..].char_indices() {
        match (quote, c) {
            (Some(open), c) => quote = if c == open { None } else { quote },
            (None, '\'' | '"') => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') if depth == 1 => return Some(start + at + 1),
            (None, ')') => depth = depth.checked_sub(1)?,
            (None, _) => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;

    /// The expression with every operation in parentheses, to see how it was read.
    fn shape(expr: &Expr) -> String {
        let list = |items: &[Expr]| items.iter().map(shape).collect::<Vec<_>>().join(", ");
        let not = |negated: &bool| if *negated { "not " } else { "" };
        match &expr.kind {
            ExprKind::Name(name) => name.clone(),
            ExprKind::Literal(literal) => format!("{literal:?}"),
            ExprKind::Not(x) => format!("(not {})", shape(x)),
            ExprKind::Negate(x) => format!("(- {})", shape(x)),
            ExprKind::Binary(op, x, y) => format!("({} {} {})", shape(x), op.symbol(), shape(y)),
            ExprKind::IsNull { operand, negated } => format!("({} is {}null)", shape(operand), not(negated)),
            ExprKind::IsTruth { operand, truth, negated } => {
                format!("({} is {}{truth})", shape(operand), not(negated))
            }
            ExprKind::Distinct { left, right, negated } => {
                format!("({} is {}distinct from {})", shape(left), not(negated), shape(right))
            }
            ExprKind::Between { operand, low, high, negated } => {
                format!("({} {}between {} and {})", shape(operand), not(negated), shape(low), shape(high))
            }
            ExprKind::InList { operand, list: items, negated } => {
                format!("({} {}in [{}])", shape(operand), not(negated), list(items))
            }
            ExprKind::Case { operand, branches, otherwise } => {
                let operand = operand.as_ref().map_or_else(String::new, |x| format!(" {}", shape(x)));
                let branches: Vec<_> = branches.iter().map(|(a, b)| format!(" {}: {}", shape(a), shape(b))).collect();
                let otherwise = otherwise.as_ref().map_or_else(String::new, |x| format!(" else {}", shape(x)));
                format!("(case{operand}{}{otherwise})", branches.concat())
            }
            ExprKind::Call { name, arguments } => format!("{name}({})", list(arguments)),
        }
    }

    #[test]
    fn precedence_is_that_of_sql() {
        for (text, expected) in [
            ("a or b and not c", "(a or (b and (not c)))"),
            ("a = 1 and t < 2 + 3 * 4", "((a = Int(1)) and (t < (Int(2) + (Int(3) * Int(4)))))"),
            ("not a = b", "(not (a = b))"),
            ("a is not null and b <> 'x'", "((a is not null) and (b <> Text(\"x\")))"),
            ("t between 1 and 2 or c", "((t between Int(1) and Int(2)) or c)"),
            ("-1 - -a", "((- Int(1)) - (- a))"),
            ("\"TSA-C\" = 1", "(TSA-C = Int(1))"),
            ("case when a then b else c end", "(case a: b else c)"),
            ("case x when 1 then 2 end", "(case x Int(1): Int(2))"),
            ("a not in ('it''s', null)", "(a not in [Text(\"it's\"), Null])"),
            ("a is not distinct from 1.5", "(a is not distinct from Float(1.5))"),
        ] {
            assert_eq!(parse(text).map(|expr| shape(&expr)), Ok(expected.to_owned()), "{text}");
        }
    }

    #[test]
    fn quantifier_names_are_functions_wherever_they_stand() {
        for (text, expected) in [
            ("any(p)", "any(p)"),
            ("any(all(p))", "any(all(p))"),
            ("x = any(p)", "(x = any(p))"),
            ("not ALL(p) and q", "((not all(p)) and q)"),
            ("coalesce(all(p), any (q))", "coalesce(all(p), any(q))"),
        ] {
            assert_eq!(parse(text).map(|expr| shape(&expr)), Ok(expected.to_owned()), "{text}");
        }
    }

    #[test]
    fn every_refusal_names_what_and_where() {
        let mut told = String::new();
        for text in [
            "",
            "a +",
            "a b",
            "(a",
            "a / b",
            "a || b",
            "a like 'x%'",
            "a::int",
            "(select 1)",
            "a.b",
            "count(*)",
            "count(distinct a)",
            "sum(a) over ()",
            "x'00'",
            "99999999999999999999",
            "a = = b",
            "'open",
            "case a end",
            "first(a) from x",
            "exists (select 1)",
            "a in (select 1)",
            "é = 'b' /",
        ] {
            let faults = parse(text).expect_err(text);
            for SyntaxFault { message, span, help } in faults {
                let help = help.map_or_else(String::new, |help| format!("  [{help}]"));
                let span = format!("`{}`", &text[span]);
                writeln!(told, "{text:24} {span:14} {message}{help}").unwrap();
            }
        }
        insta::assert_snapshot!(told);
    }

    #[test]
    fn depth_and_length_are_limited() {
        let deep = format!("{}a{}", "(".repeat(5000), ")".repeat(5000));
        let long = vec!["a"; 4000].join(" or ");
        let longer = "a".repeat(LONGEST + 1);
        for text in [deep, long, longer] {
            assert!(parse(&text).is_err());
        }
    }
}
