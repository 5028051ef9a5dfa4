//! Random well-typed definitions: every construct of the grammar, nested a few levels.

use proptest::collection::vec;
use proptest::prelude::*;

use crate::language::{Definition, Expr};

/// The leaves of expressions: columns by type, constants, patterns.
#[derive(Debug)]
pub struct Vocabulary {
    pub bools: &'static [&'static str],
    pub ints: &'static [&'static str],
    /// Integers that are constant in an episode.
    pub numbers: &'static [&'static str],
    pub floats: &'static [&'static str],
    pub texts: &'static [&'static str],
    /// Texts that are constant in an episode.
    pub names: &'static [&'static str],
    pub int_literals: &'static [i64],
    pub float_literals: &'static [f64],
    pub text_literals: &'static [&'static str],
    pub patterns: &'static [&'static str],
    /// True if any two integers may be multiplied. Otherwise one is a small constant, and nothing overflows.
    pub products: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    Bool,
    Int,
    Float,
    Text,
}

/// The level of an expression. A step-level one is valid only below an aggregate or in a `let`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Level {
    Episode,
    Step,
}

/// Choices from random bytes. When they run out, every choice is the first one, a leaf, so that a failure shrinks to a
/// small expression.
struct Author {
    bytes: std::vec::IntoIter<u8>,
    words: &'static Vocabulary,
    known: Vec<(Type, Level, bool)>,
}

/// The number of definitions in a file.
const DEFINITIONS: usize = 7;
const COMPARISONS: [&str; 6] = ["=", "<>", "<", "<=", ">", ">="];

impl Author {
    fn pick(&mut self, choices: usize) -> usize {
        usize::from(self.bytes.next().unwrap_or(0)) % choices
    }

    fn choose<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.pick(choices.len())]
    }

    /// Definitions that refer only to earlier ones: some lets of any type and level, some metrics.
    fn definitions(&mut self) -> Vec<Definition> {
        let mut definitions = Vec::new();
        for at in 0..DEFINITIONS {
            let is_metric = at == DEFINITIONS - 1 || self.pick(2) == 1;
            let level = if is_metric { Level::Episode } else { self.choose(&[Level::Episode, Level::Step]) };
            let types = [Type::Bool, Type::Int, Type::Float, Type::Text];
            let ty = self.choose(if is_metric { &types[..2] } else { &types });
            let value = self.of(ty, level, 4);
            let when = (is_metric && self.pick(3) == 2).then(|| self.boolean(Level::Episode, 3));
            let name = format!("{}{at}", if is_metric { "m" } else { "l" });
            definitions.push(Definition { name, is_metric, value, when });
            self.known.push((ty, level, is_metric));
        }
        definitions
    }

    fn of(&mut self, ty: Type, level: Level, depth: usize) -> Expr {
        match ty {
            Type::Bool => self.boolean(level, depth),
            Type::Int => self.int(level, depth),
            Type::Float => self.float(level, depth),
            Type::Text => self.text(level, depth),
        }
    }

    fn boxed(&mut self, ty: Type, level: Level, depth: usize) -> Box<Expr> {
        Box::new(self.of(ty, level, depth))
    }

    /// Sometimes the literal null, where something else determines the type.
    fn or_null(&mut self, ty: Type, level: Level, depth: usize) -> Expr {
        if self.pick(8) == 7 { Expr::Null } else { self.of(ty, level, depth) }
    }

    fn boxed_or_null(&mut self, ty: Type, level: Level, depth: usize) -> Box<Expr> {
        Box::new(self.or_null(ty, level, depth))
    }

    /// An operand for a value of this type: the same type, the other number type, or null.
    fn beside(&mut self, ty: Type, level: Level, depth: usize) -> Expr {
        match (self.pick(8), ty) {
            (7, _) => Expr::Null,
            (6, Type::Int) => self.float(level, depth),
            (6, Type::Float) => self.int(level, depth),
            _ => self.of(ty, level, depth),
        }
    }

    fn any_type(&mut self) -> Type {
        self.choose(&[Type::Text, Type::Int, Type::Float, Type::Bool])
    }

    /// A definition of this type that may be used at this level.
    fn named(&mut self, ty: Type, level: Level) -> Option<Expr> {
        let known = self.known.iter().enumerate();
        let fitting: Vec<usize> = known.filter(|(_, (t, l, _))| *t == ty && *l <= level).map(|(at, _)| at).collect();
        (!fitting.is_empty()).then(|| Expr::Name(self.choose(&fitting)))
    }

    /// A boolean metric as the number 0 or 1.
    fn rate_as_number(&mut self) -> Option<Expr> {
        let known = self.known.iter().enumerate();
        let rates: Vec<usize> =
            known.filter(|(_, (ty, _, metric))| *ty == Type::Bool && *metric).map(|(at, _)| at).collect();
        (!rates.is_empty()).then(|| Expr::Rate(self.choose(&rates)))
    }

    /// The forms that exist for every type.
    fn general(&mut self, ty: Type, level: Level, depth: usize) -> Expr {
        match self.pick(5) {
            0 => {
                let first = self.of(ty, level, depth);
                Expr::Coalesce(vec![first, self.or_null(ty, level, depth), self.or_null(ty, level, depth)])
            }
            1 => {
                let branches =
                    (0..=self.pick(2)).map(|_| (self.or_null(Type::Bool, level, depth), self.of(ty, level, depth)));
                let branches = branches.collect();
                let otherwise = (self.pick(2) == 1).then(|| self.boxed_or_null(ty, level, depth));
                Expr::Case(None, branches, otherwise)
            }
            2 => {
                let of = self.any_type();
                let operand = self.boxed(of, level, depth);
                let branch = |this: &mut Self| (this.beside(of, level, depth), this.of(ty, level, depth));
                let branches = vec![branch(self), branch(self)];
                Expr::Case(Some(operand), branches, None)
            }
            3 => Expr::NullIf(self.boxed(ty, level, depth), self.boxed_or_null(ty, level, depth)),
            4 if level == Level::Step && self.pick(2) == 0 => Expr::Lag(self.boxed(ty, level, depth)),
            _ => Expr::At(self.boxed(ty, Level::Step, depth), self.boxed_or_null(Type::Int, Level::Episode, depth)),
        }
    }

    fn boolean(&mut self, level: Level, depth: usize) -> Expr {
        let choices = if depth == 0 { 3 } else { 16 };
        let less = depth.saturating_sub(1);
        match self.pick(choices) {
            0 if level == Level::Step => Expr::Column(self.choose(self.words.bools)),
            0 | 1 => Expr::Bool(self.pick(2) == 0),
            2 => self.named(Type::Bool, level).unwrap_or(Expr::Bool(true)),
            3 => Expr::Not(self.boxed_or_null(Type::Bool, level, less)),
            4 => Expr::And(self.boxed_or_null(Type::Bool, level, less), self.boxed_or_null(Type::Bool, level, less)),
            5 => Expr::Or(self.boxed_or_null(Type::Bool, level, less), self.boxed_or_null(Type::Bool, level, less)),
            6 | 7 => {
                let ty = self.any_type();
                let (op, left) = (self.choose(&COMPARISONS), self.boxed(ty, level, less));
                Expr::Compare(op, left, Box::new(self.beside(ty, level, less)))
            }
            8 => {
                // A window: t compared with a moment of the episode, in either order.
                let (op, moment) = (self.choose(&COMPARISONS), self.boxed(Type::Int, Level::Episode, less));
                match (level, self.pick(2)) {
                    (Level::Episode, _) => Expr::Compare(op, moment, Box::new(Expr::Length)),
                    (Level::Step, 0) => Expr::Compare(op, Box::new(Expr::Time), moment),
                    (Level::Step, _) => Expr::Compare(op, moment, Box::new(Expr::Time)),
                }
            }
            9 => {
                let ty = self.any_type();
                Expr::Distinct(self.boxed(ty, level, less), Box::new(self.beside(ty, level, less)))
            }
            10 => {
                let ty = self.any_type();
                Expr::IsNull(self.boxed_or_null(ty, level, less))
            }
            11 => Expr::Is(self.pick(2) == 0, self.boxed_or_null(Type::Bool, level, less)),
            12 => {
                let ty = self.any_type();
                let operand = self.boxed(ty, level, less);
                Expr::Between([operand, Box::new(self.beside(ty, level, less)), Box::new(self.beside(ty, level, less))])
            }
            13 => {
                let ty = self.any_type();
                let operand = self.boxed(ty, level, less);
                let items = (0..=self.pick(3)).map(|_| self.beside(ty, level, less)).collect();
                Expr::In(operand, items)
            }
            14 => match self.pick(3) {
                0 => Expr::Matches(self.boxed(Type::Text, level, less), self.choose(self.words.patterns)),
                _ => Expr::Aggregate(self.choose(&["any", "all"]), self.boxed_or_null(Type::Bool, Level::Step, less)),
            },
            _ => self.general(Type::Bool, level, less),
        }
    }

    fn int(&mut self, level: Level, depth: usize) -> Expr {
        let choices = if depth == 0 { 4 } else { 11 };
        let less = depth.saturating_sub(1);
        match self.pick(choices) {
            0 => Expr::Int(self.choose(self.words.int_literals)),
            1 if level == Level::Step => Expr::Column(self.choose(self.words.ints)),
            1 => Expr::Column(self.choose(self.words.numbers)),
            2 if level == Level::Step => Expr::Time,
            2 => Expr::Length,
            3 => self.named(Type::Int, level).or_else(|| self.rate_as_number()).unwrap_or(Expr::Length),
            4 => {
                let op = self.choose(&["+", "-", "%", "div"]);
                Expr::Arithmetic(op, self.boxed(Type::Int, level, less), self.boxed_or_null(Type::Int, level, less))
            }
            5 if self.words.products => {
                let left = self.boxed(Type::Int, level, less);
                Expr::Arithmetic("*", left, self.boxed_or_null(Type::Int, level, less))
            }
            5 => {
                let factor = [2, -1, 3][self.pick(3)];
                Expr::Arithmetic("*", Box::new(Expr::Int(factor)), self.boxed_or_null(Type::Int, level, less))
            }
            6 => Expr::Negate(self.boxed_or_null(Type::Int, level, less)),
            7 | 8 => {
                let name = self.choose(&["first", "last", "count"]);
                Expr::Aggregate(name, self.boxed_or_null(Type::Bool, Level::Step, less))
            }
            9 => Expr::Aggregate(self.choose(&["min", "max", "sum"]), self.boxed_or_null(Type::Int, Level::Step, less)),
            _ => self.general(Type::Int, level, less),
        }
    }

    fn float(&mut self, level: Level, depth: usize) -> Expr {
        let choices = if depth == 0 { 3 } else { 7 };
        let less = depth.saturating_sub(1);
        match self.pick(choices) {
            0 => Expr::Float(self.choose(self.words.float_literals)),
            1 if level == Level::Step => Expr::Column(self.choose(self.words.floats)),
            1 => Expr::At(Box::new(Expr::Column(self.words.floats[0])), Box::new(Expr::Int(1))),
            2 => self.named(Type::Float, level).unwrap_or(Expr::Float(3.0)),
            3 => {
                let op = self.choose(&["+", "-", "*"]);
                Expr::Arithmetic(
                    op,
                    self.boxed(Type::Float, level, less),
                    Box::new(self.beside(Type::Float, level, less)),
                )
            }
            4 => Expr::Negate(self.boxed(Type::Float, level, less)),
            5 => Expr::Aggregate(self.choose(&["min", "max"]), self.boxed(Type::Float, Level::Step, less)),
            _ => self.general(Type::Float, level, less),
        }
    }

    fn text(&mut self, level: Level, depth: usize) -> Expr {
        match self.pick(if depth == 0 { 3 } else { 4 }) {
            0 => Expr::Text(self.choose(self.words.text_literals)),
            1 => Expr::Column(if level == Level::Step {
                self.choose(self.words.texts)
            } else {
                self.choose(self.words.names)
            }),
            2 => self.named(Type::Text, level).unwrap_or(Expr::Column("body_color")),
            _ => self.general(Type::Text, level, depth - 1),
        }
    }
}

/// The parts of the steps where `q` is true, by the value of `p`: true, false, null.
#[cfg(feature = "polars")]
pub const PARTS: [&str; 3] = ["t", "f", "n"];

#[cfg(feature = "polars")]
impl Author {
    /// Lets: `q` and `p`, conditions of steps; `x`, an integer of steps; `e`, a condition of the episode. Metrics
    /// `all_AGGREGATE` over the steps where `q` is true, and `PART_AGGREGATE` over each part. `norec_p` sums up the
    /// steps where `p` is true; `holds` is `e` as a metric.
    fn partition(&mut self) -> Vec<Definition> {
        let level = self.choose(&[Level::Step, Level::Episode]);
        let ty = self.choose(&[Type::Bool, Type::Int, Type::Float, Type::Text]);
        let mut lets = vec![("l".to_owned(), self.of(ty, level, 3))];
        self.known.push((ty, level, false));
        for (name, ty, level, depth) in [
            ("q", Type::Bool, Level::Step, 2),
            ("p", Type::Bool, Level::Step, 4),
            ("x", Type::Int, Level::Step, 3),
            ("e", Type::Bool, Level::Episode, 4),
        ] {
            lets.push((name.to_owned(), self.of(ty, level, depth)));
        }
        let [q, p, x, e] = [1, 2, 3, 4].map(|at| move || Box::new(Expr::Name(at)));
        let parts: [(&str, Expr); 4] = [
            ("all", *q()),
            (PARTS[0], Expr::And(q(), p())),
            (PARTS[1], Expr::And(q(), Box::new(Expr::Not(p())))),
            (PARTS[2], Expr::And(q(), Box::new(Expr::IsNull(p())))),
        ];
        let mut metrics = Vec::new();
        for (part, holds) in parts {
            let chosen = || Box::new(Expr::Case(None, vec![(holds.clone(), *x())], None));
            for name in ["count", "any", "first", "last"] {
                metrics.push((format!("{part}_{name}"), Expr::Aggregate(name, Box::new(holds.clone()))));
            }
            for name in ["min", "max", "sum"] {
                metrics.push((format!("{part}_{name}"), Expr::Aggregate(name, chosen())));
            }
        }
        let added = Expr::Case(None, vec![(*p(), Expr::Int(1))], Some(Box::new(Expr::Int(0))));
        metrics.push(("norec_p".to_owned(), Expr::Aggregate("sum", Box::new(added))));
        metrics.push(("count_p".to_owned(), Expr::Aggregate("count", p())));
        metrics.push(("holds".to_owned(), *e()));
        let definition = |is_metric| move |(name, value)| Definition { name, is_metric, value, when: None };
        lets.into_iter().map(definition(false)).chain(metrics.into_iter().map(definition(true))).collect()
    }
}

/// Random conditions with these words, and metrics over the parts that they make: see [`PARTS`].
#[cfg(feature = "polars")]
pub fn partitions(words: &'static Vocabulary) -> impl Strategy<Value = Vec<Definition>> {
    vec(any::<u8>(), 0..300)
        .prop_map(move |bytes| Author { bytes: bytes.into_iter(), words, known: Vec::new() }.partition())
}

/// Random definitions with these words.
pub fn definitions(words: &'static Vocabulary) -> impl Strategy<Value = Vec<Definition>> {
    vec(any::<u8>(), 0..700)
        .prop_map(move |bytes| Author { bytes: bytes.into_iter(), words, known: Vec::new() }.definitions())
}
