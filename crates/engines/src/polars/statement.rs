//! A query as typed: one SELECT over the known tables, which reads nothing else.
//!
//! Polars SQL has functions that read files (`read_parquet('...')`) and statements that change tables. So a query is
//! parsed and checked here first; Polars gets the checked statement, printed again.

use std::collections::BTreeSet;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use sqlparser::ast::{
    Ident, ObjectName, Query, Select, SetExpr, Spanned as _, Statement, TableAlias, TableFactor, Visit as _, Visitor,
};
use sqlparser::tokenizer::Span;

use super::rewrite::{bare_column, rewrite};
use exact::suggest::nearest;
pub use metric::syntax::grammar::{Grammar, SyntaxFault, bytes_of, shortened, with_stack};
use toml_spec::{Fault, Faults, Place, Source};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Table {
    Steps,
    Episodes,
    /// One row per group and metric: exact moments, and statistics derived from them.
    Cells,
}

exact::names!(Table { Steps: "steps", Episodes: "episodes", Cells: "cells" });

#[derive(Clone, Debug)]
pub struct Checked {
    pub(super) asked: Asked,
    pub tables: BTreeSet<Table>,
    source: Arc<Source>,
}

#[derive(Clone, Debug)]
pub(super) enum Asked {
    Rows(Box<Statement>),
    Tables,
    Columns(Table),
}

const QUERY: Grammar = Grammar { noun: "query", one: "a query", longest: 64 * 1024, most_tokens: 8000, help: None };

pub fn check(text: &str) -> Result<Checked, Faults> {
    with_stack(text, || checked(text))
}

fn checked(text: &str) -> Result<Checked, Faults> {
    let source = Arc::new(Source { name: "query".to_owned(), text: text.to_owned() });
    let at = |span, message: String| Fault::new(Place { source: Arc::clone(&source), span }, message);
    let parsed = parse(text);
    let mut statement = parsed.map_err(|fault| Faults(vec![at(fault.span, fault.message).help_if(fault.help)]))?;
    let mut reader = Reader { source: &source, ctes: BTreeSet::new(), tables: BTreeSet::new(), faults: Vec::new() };
    let _ = statement.visit(&mut Names(&mut reader.ctes));
    let _ = statement.visit(&mut reader);
    let (tables, faults) = (reader.tables, reader.faults);
    if !faults.is_empty() {
        return Err(Faults(faults));
    }
    let asked = match statement {
        Statement::ShowTables { .. } => Asked::Tables,
        Statement::ExplainTable { .. } => tables.first().map_or(Asked::Tables, |table| Asked::Columns(*table)),
        _ => {
            rewrite(&mut statement).map_err(|words| Faults(vec![at(0..text.len(), words)]))?;
            Asked::Rows(Box::new(statement))
        }
    };
    Ok(Checked { asked, tables, source })
}

impl Checked {
    pub(super) fn whole(&self, message: String) -> Faults {
        let place = Place { source: Arc::clone(&self.source), span: 0..self.source.text.len() };
        Faults(vec![Fault::new(place, message).help(OTHERWISE)])
    }

    /// The column whose name contains an unknown name, because it is not quoted.
    fn unquoted<'c>(&self, start: usize, columns: &'c [String]) -> Option<(Range<usize>, &'c String)> {
        let text = &self.source.text;
        let is_word = |name: &str| name.chars().all(|c| c.is_alphanumeric() || c == '_');
        columns.iter().filter(|column| !is_word(column)).find_map(|column| {
            let spans = text.match_indices(column.as_str()).map(|(at, _)| at..at + column.len());
            let span = spans.into_iter().find(|span| span.contains(&start) && !text[..span.start].ends_with('"'))?;
            Some((span, column))
        })
    }

    /// Polars' message, located at the unknown name in the query. `columns` are those of the tables.
    pub fn fault(&self, words: &str, columns: &[String]) -> Faults {
        let unknown =
            ["column '", "column \"", "column named '", "column: ", "Column '"].into_iter().find_map(|before| {
                let rest = words.split_once(before)?.1;
                let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                (!name.is_empty() && !columns.contains(&name)).then_some(name)
            });
        let Some(name) = unknown else {
            return self.whole(format!("Polars cannot do this: {}", plain(words)));
        };
        let start = word_at(&self.source.text, &name);
        if let Some((span, quoted)) = self.unquoted(start, columns) {
            let place = Place { source: Arc::clone(&self.source), span };
            let help = format!("write \"{quoted}\" in double quotes: its name is more than letters, digits and `_`");
            return Faults(vec![Fault::new(place, format!("unknown column `{name}`")).help(help)]);
        }
        let place = Place { source: Arc::clone(&self.source), span: start..start + name.len() };
        let near = nearest(&name, columns.iter().map(String::as_str)).map(|near| format!("did you mean `{near}`?"));
        let known = || format!("columns are {}", columns.join(", "));
        Faults(vec![Fault::new(place, format!("unknown column `{name}`")).help(near.unwrap_or_else(known))])
    }
}

const OTHERWISE: &str = "ask with a JOIN or a table of WITH; or ask DuckDB, of the file that `mirrorstats score TRACES -o \
                         scores.parquet` writes, or in Python of `study.episodes`";

fn plain(words: &str) -> &str {
    let end = words.find(['{', '[']).filter(|_| words.contains("Ident {") || words.contains("Query {"));
    words[..end.unwrap_or(words.len())].trim_end()
}

/// The position of a whole word in a text; the start of the text if it is absent.
fn word_at(text: &str, word: &str) -> usize {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let alone = |at: &usize| !text[..*at].ends_with(part) && !text[at + word.len()..].starts_with(part);
    text.match_indices(word).map(|(at, _)| at).find(alone).unwrap_or(0)
}

fn parse(text: &str) -> Result<Statement, SyntaxFault> {
    let parsed = QUERY.parser(text, |tokens| tokens)?.parse_statements();
    let mut statements = parsed.map_err(|error| QUERY.fault(text, &error))?;
    let (message, help) = match (statements.pop(), statements.len()) {
        (
            Some(statement @ (Statement::Query(_) | Statement::ShowTables { .. } | Statement::ExplainTable { .. })),
            0,
        ) => {
            return Ok(statement);
        }
        (Some(_), 0) => {
            let help = "write SELECT ... FROM steps, episodes or cells";
            ("a query is a SELECT: it reads, and changes nothing".to_owned(), Some(help))
        }
        (Some(_), more) => (format!("expected one statement, found {}", more + 1), None),
        (None, _) => ("expected a query, found none".to_owned(), Some("write SELECT ... FROM steps")),
    };
    Err(SyntaxFault { message, span: 0..text.len(), help: help.map(str::to_owned) })
}

/// Collects the names that a query gives to its own tables.
struct Names<'n>(&'n mut BTreeSet<String>);

impl Visitor for Names<'_> {
    type Break = ();

    fn pre_visit_query(&mut self, query: &Query) -> ControlFlow<()> {
        let ctes = query.with.iter().flat_map(|with| &with.cte_tables);
        self.0.extend(ctes.map(|cte| cte.alias.name.value.clone()));
        ControlFlow::Continue(())
    }
}

/// Walks a statement and refuses anything that reads beyond the tables or changes something.
struct Reader<'s> {
    source: &'s Arc<Source>,
    ctes: BTreeSet<String>,
    tables: BTreeSet<Table>,
    faults: Vec<Fault>,
}

impl Reader<'_> {
    fn refuse(&mut self, span: Span, message: impl Into<String>, help: Option<String>) {
        let fault =
            Fault::new(Place { source: Arc::clone(self.source), span: bytes_of(&self.source.text, span) }, message);
        self.faults.push(fault.help_if(help));
    }

    /// A name that a query defines must not hide a table.
    fn check_name(&mut self, name: &Ident) {
        if Table::named(&name.value).is_some() {
            let message = format!("`{}` is a table and cannot be the name of another", name.value);
            self.refuse(name.span, message, Some("choose another name".to_owned()));
        }
    }

    fn table(&mut self, name: &ObjectName, alias: Option<&TableAlias>) {
        let parts = &name.0;
        let word = parts.first().and_then(|part| part.as_ident()).map(|ident| ident.value.clone()).unwrap_or_default();
        if parts.len() == 1 && self.ctes.contains(&word) {
            return;
        }
        if let Some(table) = Table::named(&word).filter(|_| parts.len() == 1) {
            self.tables.insert(table);
            if let Some(alias) = alias.filter(|alias| alias.name.value != word) {
                self.check_name(&alias.name);
            }
        } else {
            let near = nearest(&word, Table::ALL.map(Table::name)).filter(|_| parts.len() == 1);
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => "tables are steps, episodes, cells".to_owned(),
            };
            self.refuse(name.span(), format!("unknown table `{name}`"), Some(help));
        }
    }
}

impl Visitor for Reader<'_> {
    type Break = ();

    fn pre_visit_query(&mut self, query: &Query) -> ControlFlow<()> {
        for cte in query.with.iter().flat_map(|with| &with.cte_tables) {
            self.check_name(&cte.alias.name);
        }
        let plain = query.locks.is_empty()
            && query.for_clause.is_none()
            && query.settings.is_none()
            && query.format_clause.is_none()
            && query.pipe_operators.is_empty();
        if !plain {
            self.refuse(query.span(), "a query ends with ORDER BY and LIMIT: no FOR, SETTINGS, FORMAT or |>", None);
        }
        if let SetExpr::Table(_) = query.body.as_ref() {
            self.refuse(query.span(), "`TABLE name` is not supported", Some("write SELECT * FROM name".to_owned()));
        }
        ControlFlow::Continue(())
    }

    fn pre_visit_select(&mut self, select: &Select) -> ControlFlow<()> {
        if select.into.is_some() {
            self.refuse(select.span(), "SELECT INTO makes a table; a query reads alone", None);
        }
        if let Some(column) = bare_column(select) {
            let help = match column.value.as_str() {
                "*" => "name the columns in its place, here and in a GROUP BY".to_owned(),
                _ => format!("add GROUP BY {column}, or write max({column})"),
            };
            let message = format!("the column `{}` is used beside an aggregate without GROUP BY", column.value);
            self.refuse(column.span, message, Some(help));
        }
        ControlFlow::Continue(())
    }

    fn pre_visit_statement(&mut self, statement: &Statement) -> ControlFlow<()> {
        if let Statement::ExplainTable { table_name, .. } = statement {
            self.table(table_name, None);
        } else if !matches!(statement, Statement::Query(_) | Statement::ShowTables { .. }) {
            self.refuse(statement.span(), "a query is a SELECT: it reads, and changes nothing", None);
        }
        ControlFlow::Continue(())
    }

    fn pre_visit_table_factor(&mut self, factor: &TableFactor) -> ControlFlow<()> {
        match factor {
            TableFactor::Table { name, alias, args: None, .. } => self.table(name, alias.as_ref()),
            TableFactor::Derived { alias, .. } | TableFactor::NestedJoin { alias, .. } => {
                if let Some(alias) = alias {
                    self.check_name(&alias.name);
                }
            }
            other => {
                let message = format!("`{}` is no table", shortened(&other.to_string()));
                let help =
                    "a query reads the traces that are named on the command line: tables are steps, episodes, cells";
                self.refuse(other.span(), message, Some(help.to_owned()));
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_of_a_query_are_known() {
        let tables = |text: &str| check(text).unwrap().tables.into_iter().collect::<Vec<_>>();
        assert_eq!(tables("select 1"), []);
        assert_eq!(tables("select * from steps s join episodes using (episode_id)"), [Table::Steps, Table::Episodes]);
        assert_eq!(
            tables("with a as (select * from cells) select * from a where n in (select t from steps)"),
            [Table::Steps, Table::Cells]
        );
    }

    #[test]
    fn queries_read_only_their_tables_and_change_nothing() {
        for text in [
            "",
            ";",
            "select * from read_parquet('/etc/passwd')",
            "select * from read_csv('x') c",
            "select (select max(a) from read_json('x')) from steps",
            "with a as (select * from read_csv('x')) select * from a",
            "select * from table(read_csv('x'))",
            "select * from 'x.parquet'",
            "select * from \"x.parquet\"",
            "select * from steps where t in (select a from other)",
            "select * from main.steps",
            "select * into x from steps",
            "create table a as select * from steps",
            "drop table steps",
            "delete from steps",
            "truncate table steps",
            "explain select * from steps",
            "show columns from steps",
            "show variables",
            "set a = 1",
            "attach 'x' as y",
            "select 1; select 2",
            "with steps as (select 1 as t) select * from steps",
            "select * from (select 1 as t) as episodes",
            "select * from cells steps",
            "table steps",
            "insert into steps values (1)",
        ] {
            assert!(check(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_fault_is_shown_at_its_place() {
        let told = check("select *\nfrom stepps").unwrap_err().to_string();
        assert!(told.contains("unknown table `stepps`") && told.contains("did you mean `steps`?"), "{told}");
        let told = check("select a, from steps where").unwrap_err().to_string();
        assert!(told.contains("not a query"), "{told}");
        let query = check("select tt, t from steps").unwrap();
        let told = query.fault("unable to find column \"tt\"; valid columns: [\"t\"]", &["t".to_owned()]).to_string();
        assert!(told.contains("unknown column `tt`") && told.contains("query:1:8"), "{told}");
    }
}
