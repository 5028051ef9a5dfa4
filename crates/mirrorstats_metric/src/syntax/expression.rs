//! Parses one expression, with error messages in the terms of definitions.

use sqlparser::ast;
use sqlparser::keywords::Keyword;
use sqlparser::tokenizer::{Token, TokenWithSpan};

use super::Expr;
use super::grammar::{Grammar, SyntaxFault, byte_of, bytes_of, with_stack};
use super::reader::Reader;
use crate::functions;

pub(super) const EXPRESSION: Grammar = Grammar {
    noun: "expression",
    one: "an expression",
    longest: 16 * 1024,
    most_tokens: 4000,
    help: Some("name its parts in [let]"),
};

/// The functions that SQL reads as keywords where a name is possible.
const QUANTIFIER_NAMES: [&str; 3] = ["any", "all", "some"];

pub fn parse(text: &str) -> Result<Expr, Vec<SyntaxFault>> {
    with_stack(text, || {
        let parsed = parse_sql(text).map_err(|fault| vec![fault])?;
        Reader::new(text).expression(&parsed)
    })
}

fn parse_sql(text: &str) -> Result<ast::Expr, SyntaxFault> {
    let mut parser = EXPRESSION.parser(text, function_names_only)?;
    let parsed = parser.parse_expr().map_err(|error| EXPRESSION.fault(text, &error))?;
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

/// The parser reads `case` and `not` as names if it cannot read what follows; this explains the problem.
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
    let span = bytes_of(text, before.span);
    Some(SyntaxFault { message: message.to_owned(), span, help: Some(help.to_owned()) })
}

fn function_of(token: &TokenWithSpan) -> Option<&'static str> {
    match &token.token {
        Token::Word(word) if word.quote_style.is_none() => {
            functions::find(&word.value.to_lowercase()).map(|entry| entry.usage)
        }
        _ => None,
    }
}

/// Turns `any(`, `all(` and `some(` into plain names, so that they are functions everywhere.
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
