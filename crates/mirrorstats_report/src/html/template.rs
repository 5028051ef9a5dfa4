//! Combines templates, style and script of the page.
//!
//! Rule: a template escapes all its input; the few texts that are already markup are marked in `page`, one by one. The
//! script's hash is in the page's own policy, so no other script runs.

use minijinja::value::Value;
use minijinja::{Environment, Error, UndefinedBehavior, context};

use mirrorstats_exact::hash::integrity_of_bytes;

const PAGE: &str = "page.html";

const TEMPLATES: [(&str, &str); 9] = [
    (PAGE, include_str!("../../../../assets/templates/page.html")),
    ("header.html", include_str!("../../../../assets/templates/header.html")),
    ("tables.html", include_str!("../../../../assets/templates/tables.html")),
    ("figures.html", include_str!("../../../../assets/templates/figures.html")),
    ("pair.html", include_str!("../../../../assets/templates/pair.html")),
    ("statistics.html", include_str!("../../../../assets/templates/statistics.html")),
    ("lists.html", include_str!("../../../../assets/templates/lists.html")),
    ("definitions.html", include_str!("../../../../assets/templates/definitions.html")),
    ("provenance.html", include_str!("../../../../assets/templates/provenance.html")),
];

pub(super) const STYLE: &str = concat!(
    include_str!("../../../../assets/templates/style/page.css"),
    include_str!("../../../../assets/templates/style/tables.css"),
    include_str!("../../../../assets/templates/style/figures.css"),
    include_str!("../../../../assets/templates/style/panel.css"),
    include_str!("../../../../assets/templates/style/print.css"),
);

const SCRIPT: &str = concat!(
    "(() => {\n\"use strict\";\n",
    include_str!("../../../../assets/templates/script/page.js"),
    include_str!("../../../../assets/templates/script/address.js"),
    include_str!("../../../../assets/templates/script/roving.js"),
    include_str!("../../../../assets/templates/script/tip.js"),
    include_str!("../../../../assets/templates/script/sort.js"),
    include_str!("../../../../assets/templates/script/filter.js"),
    include_str!("../../../../assets/templates/script/grid.js"),
    include_str!("../../../../assets/templates/script/episodes.js"),
    include_str!("../../../../assets/templates/script/figures.js"),
    include_str!("../../../../assets/templates/script/pair.js"),
    include_str!("../../../../assets/templates/script/start.js"),
    "})();\n",
);

pub(super) fn render(content: Value) -> Result<String, Error> {
    environment()?.get_template(PAGE)?.render(context! {
        style => markup(STYLE),
        script => markup(SCRIPT),
        script_hash => integrity_of_bytes(SCRIPT.as_bytes()),
        ..content
    })
}

pub(super) fn section(name: &str, content: &Value) -> Result<String, Error> {
    environment()?.get_template(&format!("{name}.html"))?.render(content)
}

fn environment() -> Result<Environment<'static>, Error> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    for (name, source) in TEMPLATES {
        environment.add_template(name, source)?;
    }
    Ok(environment)
}

pub(super) fn markup(text: &str) -> Value {
    Value::from_safe_string(text.to_owned())
}
