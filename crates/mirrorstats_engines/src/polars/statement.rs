//! A query as typed: one SELECT over the known tables, which reads nothing else.
//!
//! Parses the text and finds its tables before a trace is read. Statements that change something and functions that
//! read files (`read_parquet('...')`) are refused here.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use sqlparser::ast::{
    Ident, ObjectName, Query, Select, SetExpr, Spanned as _, Statement, TableAlias, TableFactor, Visit as _, Visitor,
};
use sqlparser::tokenizer::Span;

use super::refused::Text;
use mirrorstats_exact::suggest::did_you_mean;
use mirrorstats_metric::syntax::grammar::{Grammar, SyntaxFault, shortened, with_stack};
use mirrorstats_toml_spec::{Fault, Faults, Source};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Table {
    Steps,
    Episodes,
    /// One row per group and metric: exact moments, and statistics derived from them.
    Cells,
}

mirrorstats_exact::names!(Table { Steps: "steps", Episodes: "episodes", Cells: "cells" });

#[derive(Clone, Debug)]
pub struct Checked {
    pub(super) asked: Asked,
    pub tables: BTreeSet<Table>,
    pub(super) source: Arc<Source>,
}

#[derive(Clone, Debug)]
pub(super) enum Asked {
    Rows(Box<Query>),
    Tables,
    Columns(Table),
}

impl Checked {
    /// The query as typed if it has one line; else as parsed, without comments.
    pub fn on_one_line(&self) -> String {
        let typed = self.source.text.trim().trim_end_matches([';', ' ']);
        match &self.asked {
            Asked::Rows(query) if typed.contains(['\n', '\r']) => query.to_string(),
            _ => typed.to_owned(),
        }
    }
}

const QUERY: Grammar = Grammar { noun: "query", one: "a query", longest: 64 * 1024, most_tokens: 8000, help: None };

const CHANGES_NOTHING: &str = "a query is a SELECT: it reads, and changes nothing";

pub fn check(text: &str) -> Result<Checked, Faults> {
    with_stack(text, || checked(text))
}

fn checked(text: &str) -> Result<Checked, Faults> {
    let source = Arc::new(Source { name: "query".to_owned(), text: text.to_owned() });
    let at = |fault: SyntaxFault| Text(&source).fault_at(fault.span, fault.message).help_if(fault.help);
    let statement = parse(text).map_err(|fault| Faults(vec![at(fault)]))?;
    let mut reader = Reader { text: Text(&source), ctes: BTreeSet::new(), tables: BTreeSet::new(), faults: Vec::new() };
    let _ = statement.visit(&mut reader);
    let (tables, faults) = (reader.tables, reader.faults);
    if !faults.is_empty() {
        return Err(Faults(faults));
    }
    let asked = match statement {
        Statement::Query(query) => Asked::Rows(query),
        Statement::ExplainTable { .. } => tables.first().map_or(Asked::Tables, |table| Asked::Columns(*table)),
        _ => Asked::Tables,
    };
    Ok(Checked { asked, tables, source })
}

fn parse(text: &str) -> Result<Statement, SyntaxFault> {
    let parsed = QUERY.parser(text, |tokens| tokens)?.parse_statements();
    let statements = parsed.map_err(|error| QUERY.fault(text, &error))?;
    let (message, help) = match <[Statement; 1]>::try_from(statements) {
        Ok([statement @ (Statement::Query(_) | Statement::ShowTables { .. } | Statement::ExplainTable { .. })]) => {
            return Ok(statement);
        }
        Ok(_) => (CHANGES_NOTHING.to_owned(), Some("write SELECT ... FROM steps, episodes or cells")),
        Err(none) if none.is_empty() => {
            ("expected a query, found none".to_owned(), Some("write SELECT ... FROM steps"))
        }
        Err(several) => (format!("expected one statement, found {}", several.len()), None),
    };
    Err(SyntaxFault { message, span: 0..text.len(), help: help.map(str::to_owned) })
}

/// Walks a statement and refuses anything that reads beyond the tables or changes something.
struct Reader<'s> {
    text: Text<'s>,
    /// The names that the query gives to its own tables, each known before the tables that it may name.
    ctes: BTreeSet<String>,
    tables: BTreeSet<Table>,
    faults: Vec<Fault>,
}

impl Reader<'_> {
    fn refuse(&mut self, span: Span, message: impl Into<String>, help: Option<String>) {
        self.faults.push(self.text.fault(span, message).help_if(help));
    }

    /// A name that a query defines must not hide a table.
    fn check_name(&mut self, name: &Ident) {
        if Table::named(&name.value).is_some() {
            let message = format!("`{}` is a table and cannot be the name of another", name.value);
            self.refuse(name.span, message, Some("choose another name".to_owned()));
        }
    }

    fn table(&mut self, name: &ObjectName, alias: Option<&TableAlias>) {
        let word = if let [part] = name.0.as_slice() { part.as_ident() } else { None };
        let word = word.map(|ident| ident.value.as_str());
        if let Some(table) = word.and_then(Table::named) {
            self.tables.insert(table);
            if let Some(alias) = alias.filter(|alias| Some(alias.name.value.as_str()) != word) {
                self.check_name(&alias.name);
            }
        } else if !word.is_some_and(|word| self.ctes.contains(word)) {
            let near = word.and_then(|word| did_you_mean(word, Table::ALL.map(Table::name)));
            let help = near.unwrap_or_else(|| "tables are steps, episodes, cells".to_owned());
            self.refuse(name.span(), format!("unknown table `{name}`"), Some(help));
        }
    }
}

impl Visitor for Reader<'_> {
    type Break = ();

    fn pre_visit_query(&mut self, query: &Query) -> ControlFlow<()> {
        for cte in query.with.iter().flat_map(|with| &with.cte_tables) {
            self.check_name(&cte.alias.name);
            self.ctes.insert(cte.alias.name.value.clone());
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
        ControlFlow::Continue(())
    }

    fn pre_visit_statement(&mut self, statement: &Statement) -> ControlFlow<()> {
        if let Statement::ExplainTable { table_name, .. } = statement {
            self.table(table_name, None);
        } else if !matches!(statement, Statement::Query(_) | Statement::ShowTables { .. }) {
            self.refuse(statement.span(), CHANGES_NOTHING, None);
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
    }
}
