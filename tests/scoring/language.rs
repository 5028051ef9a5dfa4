//! The tests' own expressions, and their SQL text.

/// An expression.
#[derive(Clone, Debug)]
pub enum Expr {
    Null,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'static str),
    Column(&'static str),
    Time,
    Length,
    /// A `let` or a metric, by its index in the definitions.
    Name(usize),
    /// A boolean metric as the number 1 or 0: next to a number, or alone in arithmetic.
    Rate(usize),
    Not(Box<Expr>),
    And(Box<Expr>, Box<Expr>),
    Or(Box<Expr>, Box<Expr>),
    /// `=`, `<>`, `<`, `<=`, `>` or `>=`.
    Compare(&'static str, Box<Expr>, Box<Expr>),
    Distinct(Box<Expr>, Box<Expr>),
    IsNull(Box<Expr>),
    Is(bool, Box<Expr>),
    Between([Box<Expr>; 3]),
    In(Box<Expr>, Vec<Expr>),
    /// `+`, `-`, `*`, `%` or `div`.
    Arithmetic(&'static str, Box<Expr>, Box<Expr>),
    Negate(Box<Expr>),
    Case(Option<Box<Expr>>, Vec<(Expr, Expr)>, Option<Box<Expr>>),
    Coalesce(Vec<Expr>),
    NullIf(Box<Expr>, Box<Expr>),
    Matches(Box<Expr>, &'static str),
    /// `first`, `last`, `any`, `all`, `count`, `min`, `max` or `sum`.
    Aggregate(&'static str, Box<Expr>),
    At(Box<Expr>, Box<Expr>),
    Lag(Box<Expr>),
}

/// A definition: its name, its value, and for a metric the condition under which it is defined.
#[derive(Clone, Debug)]
pub struct Definition {
    pub name: String,
    pub is_metric: bool,
    pub value: Expr,
    pub when: Option<Expr>,
}

/// Definitions as a file; each refers only to earlier ones, although the file lists metrics last.
pub fn toml(definitions: &[Definition]) -> String {
    let quoted = |expr: &Expr| serde_json::to_string(&sql(expr, definitions)).unwrap();
    let (metrics, lets): (Vec<_>, Vec<_>) = definitions.iter().partition(|definition| definition.is_metric);
    let lets = lets.iter().map(|definition| format!("{} = {}\n", definition.name, quoted(&definition.value)));
    let metrics = metrics.iter().map(|metric| {
        let when = metric.when.as_ref().map_or_else(String::new, |when| format!("when = {}\n", quoted(when)));
        format!("[metric.{}]\nvalue = {}\n{when}", metric.name, quoted(&metric.value))
    });
    format!("[let]\n{}{}", lets.collect::<String>(), metrics.collect::<String>())
}

/// The expression as SQL, with parentheses everywhere.
fn sql(expr: &Expr, names: &[Definition]) -> String {
    let one = |x: &Expr| sql(x, names);
    let list = |items: &[Expr]| items.iter().map(one).collect::<Vec<_>>().join(", ");
    match expr {
        Expr::Null => "null".into(),
        Expr::Bool(value) => value.to_string(),
        Expr::Int(value) => value.to_string(),
        Expr::Float(value) => format!("{value:?}"),
        Expr::Text(text) => format!("'{}'", text.replace('\'', "''")),
        Expr::Column(name) => (*name).into(),
        Expr::Time => "t".into(),
        Expr::Length => "length()".into(),
        Expr::Name(at) => names[*at].name.clone(),
        Expr::Rate(at) if at % 2 == 0 => format!("({} + 0)", names[*at].name),
        Expr::Rate(at) => format!("(case when true then {} else 0 end)", names[*at].name),
        Expr::Not(x) => format!("(not {})", one(x)),
        Expr::And(x, y) => format!("({} and {})", one(x), one(y)),
        Expr::Or(x, y) => format!("({} or {})", one(x), one(y)),
        Expr::Distinct(x, y) => format!("({} is distinct from {})", one(x), one(y)),
        Expr::IsNull(x) => format!("({} is null)", one(x)),
        Expr::Is(truth, x) => format!("({} is {truth})", one(x)),
        Expr::Between([x, low, high]) => format!("({} between {} and {})", one(x), one(low), one(high)),
        Expr::In(x, items) => format!("({} in ({}))", one(x), list(items)),
        Expr::Arithmetic("div", x, y) => format!("div({}, {})", one(x), one(y)),
        Expr::Compare(op, x, y) | Expr::Arithmetic(op, x, y) => format!("({} {op} {})", one(x), one(y)),
        Expr::Negate(x) => format!("(- {})", one(x)),
        Expr::Case(operand, branches, otherwise) => {
            let operand = operand.as_ref().map_or_else(String::new, |x| format!(" {}", one(x)));
            let branches = branches.iter().map(|(when, then)| format!(" when {} then {}", one(when), one(then)));
            let otherwise = otherwise.as_ref().map_or_else(String::new, |x| format!(" else {}", one(x)));
            format!("(case{operand}{}{otherwise} end)", branches.collect::<String>())
        }
        Expr::Coalesce(items) => format!("coalesce({})", list(items)),
        Expr::NullIf(x, y) => format!("nullif({}, {})", one(x), one(y)),
        Expr::Matches(x, pattern) => format!("regexp_like({}, '{pattern}')", one(x)),
        Expr::Aggregate(name, x) => format!("{name}({})", one(x)),
        Expr::Lag(x) => format!("lag({})", one(x)),
        Expr::At(x, moment) => format!("at({}, {})", one(x), one(moment)),
    }
}
