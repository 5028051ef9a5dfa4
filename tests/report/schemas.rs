//! The JSON Schemas of the files that styles, errata, comparisons and manifests are: generated, and current.

use std::fs;

use mirrorstats::report::bundle::Manifest;
use mirrorstats::report::comparison::Comparison;
use mirrorstats::report::errata::Errata;
use mirrorstats::report::style::Sheet;
use schemars::{Schema, schema_for};

/// With `MIRRORSTATS_WRITE_SCHEMAS` set, the file is written first.
fn check(name: &str, schema: &Schema) {
    let path = format!("{}/schemas/{name}.schema.json", env!("CARGO_MANIFEST_DIR"));
    let generated = serde_json::to_string_pretty(schema).unwrap() + "\n";
    if std::env::var_os("MIRRORSTATS_WRITE_SCHEMAS").is_some() {
        fs::write(&path, &generated).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == generated, "{path} is not current: run this test with MIRRORSTATS_WRITE_SCHEMAS=1");
}

#[test]
fn the_schemas_are_those_of_the_types() {
    check("style", &schema_for!(Sheet));
    check("errata", &schema_for!(Errata));
    check("comparison", &schema_for!(Comparison));
    check("manifest", &schema_for!(Manifest));
}
