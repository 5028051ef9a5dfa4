//! Random statements of every accepted shape, function and cast.

use mirrorstats_engines::polars::accepted::{Arg, CASTS, FUNCTIONS, Kind, Role, Signature};

/// Splitmix: the same statements on every machine.
pub struct Draw(pub u64);

impl Draw {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    pub fn between(&mut self, low: i64, high: i64) -> i64 {
        low + self.below((high - low + 1) as usize) as i64
    }

    fn of<'a>(&mut self, words: &[&'a str]) -> &'a str {
        words[self.below(words.len())]
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }
}

/// A table in FROM: its text and its columns.
struct From {
    text: String,
    columns: Vec<(String, Kind)>,
}

const KINDS: [Kind; 4] = [Kind::Int, Kind::Float, Kind::Bool, Kind::Text];
const STEPS: [(&str, Kind); 8] = [
    ("episode_id", Kind::Text),
    ("t", Kind::Int),
    ("k", Kind::Int),
    ("i", Kind::Int),
    ("j", Kind::Int),
    ("x", Kind::Float),
    ("b", Kind::Bool),
    ("s", Kind::Text),
];
const EPISODES: [(&str, Kind); 6] = [
    ("episode_id", Kind::Text),
    ("model", Kind::Text),
    ("seed", Kind::Int),
    ("TSA", Kind::Int),
    ("rate", Kind::Float),
    ("label_odd", Kind::Bool),
];

pub struct Generator {
    pub draw: Draw,
    columns: Vec<(String, Kind)>,
}

/// A statement, and whether its rows have one order.
pub struct Statement {
    pub sql: String,
    pub ordered: bool,
}

impl Generator {
    pub fn new(seed: u64) -> Self {
        Self { draw: Draw(seed), columns: Vec::new() }
    }

    fn named(table: &str, columns: &[(&str, Kind)]) -> Vec<(String, Kind)> {
        columns.iter().map(|(name, kind)| (format!("{table}{name}"), *kind)).collect()
    }

    fn from(&mut self) -> From {
        let both = || [Self::named("s.", &STEPS), Self::named("e.", &EPISODES)].concat();
        let (text, columns) = match self.draw.below(11) {
            0..=2 => ("steps".to_owned(), Self::named("", &STEPS)),
            3 => ("steps AS s".to_owned(), Self::named("s.", &STEPS)),
            4 => ("episodes".to_owned(), Self::named("", &EPISODES)),
            5 => {
                let how =
                    self.draw.of(&["JOIN", "INNER JOIN", "LEFT JOIN", "RIGHT JOIN", "FULL JOIN", "LEFT OUTER JOIN"]);
                (format!("steps s {how} episodes e ON s.episode_id = e.episode_id"), both())
            }
            6 => {
                let on = self.draw.of(&[
                    "s.k = e.TSA AND s.t > e.seed",
                    "e.seed = s.j",
                    "s.j + 1 = e.seed",
                    "s.x = e.rate",
                    "s.b = e.label_odd",
                ]);
                (format!("steps s JOIN episodes e ON {on}"), both())
            }
            7 => {
                let how = self.draw.of(&["JOIN", "LEFT JOIN"]);
                let columns = [Self::named("", &STEPS), Self::named("e.", &EPISODES[1..])].concat();
                (format!("steps {how} episodes e USING (episode_id)"), columns)
            }
            8 => {
                let text = "(SELECT episode_id AS id, count(*) AS n, sum(j) AS total, avg(x) AS mean, max(s) AS s FROM steps GROUP BY episode_id) AS d";
                let columns = [
                    ("id", Kind::Text),
                    ("n", Kind::Int),
                    ("total", Kind::Int),
                    ("mean", Kind::Float),
                    ("s", Kind::Text),
                ];
                (text.to_owned(), Self::named("", &columns))
            }
            9 => {
                let text = "(SELECT j, x FROM steps WHERE b UNION ALL SELECT seed, rate FROM episodes) u";
                (text.to_owned(), Self::named("u.", &[("j", Kind::Int), ("x", Kind::Float)]))
            }
            _ => (
                "(SELECT DISTINCT j, s, b FROM steps) AS d".to_owned(),
                Self::named("", &[("j", Kind::Int), ("s", Kind::Text), ("b", Kind::Bool)]),
            ),
        };
        From { text, columns }
    }

    fn column(&mut self, kind: Kind) -> Option<String> {
        let fitting: Vec<&String> =
            self.columns.iter().filter(|(_, found)| *found == kind).map(|(name, _)| name).collect();
        (!fitting.is_empty()).then(|| fitting[self.draw.below(fitting.len())].clone())
    }

    fn literal(&mut self, kind: Kind) -> String {
        match kind {
            Kind::Int => self.draw.between(-3, 12).to_string(),
            Kind::Float => format!("CAST({} AS DOUBLE)", self.draw.of(&["0.5", "2.5", "-1.25", "0.1", "3"])),
            Kind::Decimal => self.draw.of(&["0.5", "2.5", "-1.5", "0.25", "100.0"]).to_owned(),
            Kind::Bool => self.draw.of(&["TRUE", "FALSE"]).to_owned(),
            _ => self.draw.of(&["'a'", "''", "'A'", "'it''s'", "'é'", "'a%b'"]).to_owned(),
        }
    }

    fn any(&mut self, depth: usize) -> String {
        let kind = KINDS[self.draw.below(4)];
        self.value(kind, depth)
    }

    pub fn value(&mut self, kind: Kind, depth: usize) -> String {
        if depth == 0 || self.draw.one_in(4) {
            let column = self.column(kind).filter(|_| !self.draw.one_in(4));
            return column.unwrap_or_else(|| self.literal(kind));
        }
        let depth = depth - 1;
        match self.draw.below(8) {
            0 => format!("coalesce({}, {})", self.value(kind, depth), self.value(kind, depth)),
            1 => format!(
                "CASE WHEN {} THEN {} ELSE {} END",
                self.value(Kind::Bool, depth),
                self.value(kind, depth),
                self.value(kind, depth)
            ),
            2 => format!(
                "CASE {} WHEN {} THEN {} END",
                self.value(Kind::Int, depth),
                self.value(Kind::Int, depth),
                self.value(kind, depth)
            ),
            3 => self.scalar_of(kind, depth),
            _ => self.operation(kind, depth),
        }
    }

    fn operation(&mut self, kind: Kind, depth: usize) -> String {
        match kind {
            Kind::Int => {
                let op = self.draw.of(&["+", "-", "*"]);
                match self.draw.below(6) {
                    2 => format!("({} % {})", self.value(Kind::Int, depth), self.draw.between(1, 4)),
                    0 => format!("-({})", self.value(Kind::Int, depth)),
                    1 => format!("CAST({} AS INTEGER)", self.value(Kind::Bool, depth)),
                    _ => format!("({} {op} {})", self.short(depth), self.short(depth)),
                }
            }
            Kind::Float => {
                let op = self.draw.of(&["+", "-", "*", "/"]);
                match self.draw.below(5) {
                    0 => format!("({} / {})", self.value(Kind::Int, depth), self.value(Kind::Int, depth)),
                    1 => format!("CAST({} AS DOUBLE)", self.value(Kind::Int, depth)),
                    2 => format!("({} {op} {})", self.value(Kind::Float, depth), self.literal(Kind::Decimal)),
                    3 => format!("({} {op} {})", self.value(Kind::Float, depth), self.value(Kind::Int, depth)),
                    _ => format!("({} {op} {})", self.value(Kind::Float, depth), self.value(Kind::Float, depth)),
                }
            }
            Kind::Text => match self.draw.below(3) {
                0 => format!("CAST({} AS VARCHAR)", self.value(Kind::Int, depth)),
                1 => format!("{}::TEXT", self.column(Kind::Bool).unwrap_or_else(|| "TRUE".to_owned())),
                _ => format!("({} || {})", self.value(Kind::Text, depth), self.value(Kind::Text, depth)),
            },
            _ => self.condition(depth),
        }
    }

    /// A small integer: products of large ones leave 64 bits, at which both engines stop.
    fn short(&mut self, depth: usize) -> String {
        match self.draw.below(3) {
            0 => self.literal(Kind::Int),
            1 => format!("length({})", self.value(Kind::Text, depth)),
            _ => {
                let small: Vec<&(String, Kind)> = self
                    .columns
                    .iter()
                    .filter(|(name, kind)| *kind == Kind::Int && !name.ends_with('i') && !name.ends_with("total"))
                    .collect();
                if small.is_empty() { "7".to_owned() } else { small[self.draw.below(small.len())].0.clone() }
            }
        }
    }

    fn condition(&mut self, depth: usize) -> String {
        let kind = KINDS[self.draw.below(4)];
        let not = self.draw.of(&["", "", "NOT "]);
        match self.draw.below(13) {
            0 => format!(
                "({} {} {})",
                self.value(Kind::Bool, depth),
                self.draw.of(&["AND", "OR"]),
                self.value(Kind::Bool, depth)
            ),
            1 => format!("(NOT {})", self.value(Kind::Bool, depth)),
            2 => format!("({} IS {not}{})", self.value(Kind::Bool, depth), self.draw.of(&["TRUE", "FALSE", "UNKNOWN"])),
            3 => format!("({} IS {not}NULL)", self.value(kind, depth)),
            4 => format!("({} IS {not}DISTINCT FROM {})", self.value(kind, depth), self.value(kind, depth)),
            5 => format!(
                "({} {not}BETWEEN {} AND {})",
                self.value(kind, depth),
                self.value(kind, depth),
                self.value(kind, depth)
            ),
            6 => format!(
                "({} {not}IN ({}, {}, NULL))",
                self.value(kind, depth),
                self.value(kind, depth),
                self.literal(kind)
            ),
            7 => format!("({} {not}IN ({}, {}))", self.value(kind, depth), self.literal(kind), self.value(kind, depth)),
            8 => {
                let (kind, query) = [
                    (Kind::Int, "SELECT j FROM steps WHERE b"),
                    (Kind::Int, "SELECT seed FROM episodes"),
                    (Kind::Text, "SELECT s FROM steps WHERE t > 20"),
                    (Kind::Text, "SELECT model FROM episodes WHERE model IS NOT NULL"),
                ][self.draw.below(4)];
                format!("({} {not}IN ({query}))", self.value(kind, depth))
            }
            9 => {
                let pattern = self.draw.of(&["a%", "%a%", "_", "", "%", "A_%", "a\\%", "%.%", "[a]", "^a$", "a%b"]);
                format!("({} {not}LIKE '{pattern}')", self.value(Kind::Text, depth))
            }
            10 => {
                let query = self.draw.of(&[
                    "SELECT avg(TSA) FROM episodes",
                    "SELECT max(j) FROM steps",
                    "SELECT j FROM steps WHERE FALSE",
                ]);
                format!("({} {} ({query}))", self.value(Kind::Int, depth), self.draw.of(&["<", ">=", "="]))
            }
            11 => format!(
                "({not}EXISTS (SELECT 1 FROM {}))",
                self.draw.of(&["episodes WHERE seed > 1", "steps WHERE b IS NULL"])
            ),
            _ => {
                let op = self.draw.of(&["=", "<>", "<", "<=", ">", ">="]);
                let other = match kind {
                    Kind::Int | Kind::Float => [Kind::Int, Kind::Float, Kind::Decimal][self.draw.below(3)],
                    kind => kind,
                };
                format!(
                    "({} {op} {})",
                    self.value(kind, depth),
                    self.value(other, depth.min(if other == Kind::Decimal { 0 } else { depth }))
                )
            }
        }
    }

    fn scalar_of(&mut self, kind: Kind, depth: usize) -> String {
        let scalars: Vec<&Signature> =
            FUNCTIONS.iter().filter(|one| one.role == Role::Scalar && gives(one, kind)).collect();
        let signature = scalars[self.draw.below(scalars.len())];
        self.call(signature, kind, depth)
    }

    /// A call of a function, with arguments of this kind where any kind will do.
    pub fn call(&mut self, signature: &Signature, kind: Kind, depth: usize) -> String {
        let mut args = Vec::new();
        let number =
            if kind == Kind::Float || (kind != Kind::Int && self.draw.one_in(2)) { Kind::Float } else { Kind::Int };
        for arg in signature.args {
            args.push(match arg {
                Arg::Number => self.value(number, depth),
                Arg::Text => self.value(Kind::Text, depth),
                Arg::Any => self.value(kind, depth),
                Arg::Literal => self.draw.of(&["'a'", "'b'", "'%'", "'é'"]).to_owned(),
                Arg::Digits => self.draw.between(0, 4).to_string(),
                Arg::Position => self.draw.between(1, 3).to_string(),
            });
        }
        if signature.repeats && self.draw.one_in(2) {
            args.push(self.value(kind, depth));
        }
        format!("{}({})", signature.name, args.join(", "))
    }

    fn aggregate(&mut self, depth: usize) -> String {
        let filter =
            if self.draw.one_in(5) { format!(" FILTER (WHERE {})", self.value(Kind::Bool, 1)) } else { String::new() };
        let kind = KINDS[self.draw.below(4)];
        let call = match self.draw.below(8) {
            0 => "count(*)".to_owned(),
            1 => format!("count(DISTINCT {})", self.value(kind, depth)),
            _ => {
                let all: Vec<&Signature> =
                    FUNCTIONS.iter().filter(|one| matches!(one.role, Role::Aggregate | Role::Running)).collect();
                let signature = all[self.draw.below(all.len())];
                self.call(signature, kind, depth)
            }
        };
        format!("{call}{filter}")
    }

    /// Keys of ORDER BY that leave no ties: all columns.
    fn order(&mut self, columns: usize) -> String {
        let key = |draw: &mut Draw, at: usize| {
            format!("{at}{}{}", draw.of(&["", " ASC", " DESC"]), draw.of(&["", " NULLS FIRST", " NULLS LAST"]))
        };
        let keys: Vec<String> = (1..=columns).map(|at| key(&mut self.draw, at)).collect();
        let limit = if self.draw.one_in(3) {
            format!(" LIMIT {} OFFSET {}", self.draw.below(8), self.draw.below(4))
        } else {
            String::new()
        };
        format!(" ORDER BY {}{limit}", keys.join(", "))
    }

    fn condition_of(&mut self, word: &str) -> String {
        if self.draw.one_in(2) { format!(" {word} {}", self.value(Kind::Bool, 2)) } else { String::new() }
    }

    pub fn statement(&mut self) -> Statement {
        let from = self.from();
        self.columns = from.columns;
        let (sql, columns) = match self.draw.below(10) {
            0..=2 => self.rows(&from.text),
            3..=5 => self.groups(&from.text),
            6 => self.sets(&from.text),
            7 => self.windows(&from.text),
            8 => self.union(&from.text),
            _ => {
                let (inner, columns) = self.groups(&from.text);
                let names = self.draw.of(&["*", "w.*"]);
                (format!("WITH w AS ({inner}) SELECT {names} FROM w"), columns)
            }
        };
        self.finished(&sql, columns)
    }

    fn finished(&mut self, sql: &str, columns: usize) -> Statement {
        let ordered = self.draw.one_in(2);
        let order = if ordered { self.order(columns) } else { String::new() };
        Statement { sql: format!("{sql}{order}"), ordered }
    }

    fn rows(&mut self, from: &str) -> (String, usize) {
        let distinct = self.draw.of(&["", "", "DISTINCT "]);
        let items: Vec<String> = (0..=self.draw.below(3)).map(|at| format!("{} AS c{at}", self.any(3))).collect();
        (format!("SELECT {distinct}{} FROM {from}{}", items.join(", "), self.condition_of("WHERE")), items.len())
    }

    fn groups(&mut self, from: &str) -> (String, usize) {
        let keys: Vec<String> =
            (0..self.draw.below(3)).map(|_| self.any(usize::from(self.draw.0.is_multiple_of(3)))).collect();
        // A literal in GROUP BY is the number of a column.
        let keys: Vec<String> =
            keys.into_iter().filter(|key| self.columns.iter().any(|(name, _)| key.contains(name.as_str()))).collect();
        let mut items: Vec<String> = keys.iter().enumerate().map(|(at, key)| format!("{key} AS k{at}")).collect();
        for at in 0..=self.draw.below(3) {
            items.push(format!("{} AS a{at}", self.aggregate(2)));
        }
        let having = if self.draw.one_in(4) {
            format!(" HAVING {} > {}", self.aggregate_number(), self.draw.between(-2, 3))
        } else {
            String::new()
        };
        let by = if keys.is_empty() { String::new() } else { format!(" GROUP BY {}", keys.join(", ")) };
        (format!("SELECT {} FROM {from}{}{by}{having}", items.join(", "), self.condition_of("WHERE")), items.len())
    }

    fn aggregate_number(&mut self) -> String {
        match self.draw.below(3) {
            0 => "count(*)".to_owned(),
            1 => format!("avg({})", self.value(Kind::Int, 1)),
            _ => format!("(sum({}) + 1)", self.short(1)),
        }
    }

    fn sets(&mut self, from: &str) -> (String, usize) {
        let [a, b] = [0, 1].map(|_| self.columns[self.draw.below(self.columns.len())].0.clone());
        let by = match self.draw.below(4) {
            0 => format!("ROLLUP ({a}, {b})"),
            1 => format!("CUBE ({a}, {b})"),
            2 => format!("GROUPING SETS (({a}), ({b}), ())"),
            _ => format!("{a}, {b}"),
        };
        let value = self.aggregate(1);
        (format!("SELECT {a} AS k0, {b} AS k1, {value} AS v, count(*) AS n FROM {from} GROUP BY {by}"), 4)
    }

    fn windows(&mut self, from: &str) -> (String, usize) {
        let all: Vec<&Signature> = FUNCTIONS.iter().filter(|one| one.role != Role::Scalar).collect();
        let signature = all[self.draw.below(all.len())];
        let items = [self.any(1), self.window(signature), self.any(0)];
        (
            format!(
                "SELECT {} AS c0, {} AS c1, {} AS c2 FROM {from}{}",
                items[0],
                items[1],
                items[2],
                self.condition_of("WHERE")
            ),
            3,
        )
    }

    /// A function over a window; ranks and shifts over an order without ties.
    pub fn window(&mut self, signature: &Signature) -> String {
        let kind = KINDS[self.draw.below(if signature.role == Role::Running { 2 } else { 4 })];
        let call = self.call(signature, kind, 1);
        let part = if self.draw.one_in(3) { String::new() } else { format!("PARTITION BY {}", self.partition()) };
        let is_rank = signature.name.ends_with("rank");
        let order = match signature.role {
            Role::Window if is_rank => {
                format!(" ORDER BY {}{}", self.partition(), self.draw.of(&["", " DESC", " NULLS FIRST"]))
            }
            Role::Window => {
                let keys: Vec<String> = self.columns.iter().map(|(name, _)| name.clone()).collect();
                format!(" ORDER BY {}", keys.join(", "))
            }
            Role::Running if self.draw.one_in(2) => {
                format!(" ORDER BY {}{}", self.partition(), self.draw.of(&["", " DESC", " NULLS FIRST"]))
            }
            _ => String::new(),
        };
        format!("{call} OVER ({part}{order})")
    }

    fn partition(&mut self) -> String {
        self.columns[self.draw.below(self.columns.len())].0.clone()
    }

    fn union(&mut self, from: &str) -> (String, usize) {
        let kinds = [KINDS[self.draw.below(4)], KINDS[self.draw.below(4)]];
        let mut side = |names: [&str; 2]| {
            let [a, b] = [self.value(kinds[0], 2), self.value(kinds[1], 1)];
            format!("SELECT {a} AS {}, {b} AS {} FROM {from}{}", names[0], names[1], self.condition_of("WHERE"))
        };
        let sides = [side(["c0", "c1"]), side(["d0", "d1"])];
        (sides.join(self.draw.of(&[" UNION ", " UNION ALL "])), 2)
    }

    /// A statement that calls a function in each of its roles.
    pub fn statement_with(&mut self, signature: &Signature) -> Statement {
        self.columns = Self::named("", &STEPS);
        let kind = KINDS[self.draw.below(4)];
        let sql = match (signature.role, self.draw.below(2)) {
            (Role::Scalar, _) => format!("SELECT t, {} AS c FROM steps", self.call(signature, kind, 1)),
            (Role::Aggregate | Role::Running, 0) => {
                format!("SELECT j, {} AS c FROM steps GROUP BY j", self.call(signature, kind, 1))
            }
            _ => format!("SELECT t, {} AS c FROM steps", self.window(signature)),
        };
        self.finished(&sql, 2)
    }

    /// One statement for each cast.
    pub fn casts() -> Vec<String> {
        let column = |kind: Kind| match kind {
            Kind::Decimal => "2.5",
            Kind::Real => "CAST(1 AS REAL)",
            kind => STEPS.iter().rev().find(|(_, found)| *found == kind).map_or("NULL", |(name, _)| *name),
        };
        let of = |(kind, targets): &(Kind, &[&str])| {
            targets
                .iter()
                .map(|target| format!("SELECT t, CAST({} AS {target}) AS c FROM steps ORDER BY t", column(*kind)))
                .collect::<Vec<_>>()
        };
        CASTS.iter().filter(|(kind, _)| *kind != Kind::Real).flat_map(of).collect()
    }
}

fn gives(signature: &Signature, kind: Kind) -> bool {
    let any = signature.args.first() == Some(&Arg::Any);
    match kind {
        Kind::Int => any || matches!(signature.name, "length"),
        Kind::Float => any || matches!(signature.args.first(), Some(Arg::Number)),
        Kind::Text => {
            any || matches!(signature.name, "lower" | "upper" | "trim" | "ltrim" | "rtrim" | "replace" | "substring")
        }
        _ => any || matches!(signature.name, "contains" | "starts_with" | "ends_with"),
    }
}
