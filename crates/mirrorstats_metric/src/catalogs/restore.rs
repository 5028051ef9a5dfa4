//! Restores definitions from the catalog in scores and manifests.
//!
//! Rule: the restored definitions are exactly the original ones, or restoring fails: the content hash decides. Columns
//! that a file declared are not in the catalog; the columns of the traces replace them.

use serde_json::{Map, Value, json};

use crate::catalogs::catalog::Catalog;
use crate::columns::{Columns, Level};
use crate::definitions::Definitions;
use crate::file::{ColumnEntry, FileError};

#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    #[error("the definitions `{name}` that the scores carry cannot be evaluated here")]
    Faults { name: String, source: FileError },
    #[error(
        "the definitions `{name}` are not as they were carried: expected the hash {expected}, found {found}; score the traces again"
    )]
    Changed { name: String, expected: String, found: String },
}

impl Definitions {
    /// The definitions behind a catalog, checked against these columns, with the experiments that the traces had
    /// declared.
    pub fn of_catalog(catalog: &Catalog, columns: &Columns) -> Result<Self, RestoreError> {
        let name = catalog.name.clone();
        let mut definitions = Self::from_toml(&name, &as_file(catalog), columns)
            .map_err(|source| RestoreError::Faults { name: name.clone(), source })?;
        if definitions.catalog.hash == catalog.hash {
            definitions.catalog.declare(catalog.declared());
            return Ok(definitions);
        }
        let found = definitions.catalog.hash;
        Err(RestoreError::Changed { name, expected: catalog.hash.clone(), found })
    }

    /// The definitions as one file, with what they include and the columns that they declare, for a trace that carries
    /// them. [`Definitions::from_toml`] reads it.
    pub fn as_one_file(&self) -> String {
        let column = |(name, entry): (&str, &ColumnEntry)| {
            let is_constant = entry.column.level == Level::Episode;
            let shape = json!({ "type": entry.column.ty, "constant": is_constant, "values": entry.values,
                "unit": entry.unit, "decimals": entry.decimals, "help": entry.help });
            (name.to_owned(), shape)
        };
        let columns: Map<String, Value> = self.declared_columns().map(column).collect();
        let mut root = file_of(&self.catalog);
        if !columns.is_empty() {
            root["column"] = columns.into();
            drop_nulls(&mut root);
        }
        text(&root)
    }
}

fn text(root: &Value) -> String {
    toml::to_string(root).expect("a catalog without nulls holds texts, integers, lists and maps with text keys")
}

fn as_file(catalog: &Catalog) -> String {
    text(&file_of(catalog))
}

fn file_of(catalog: &Catalog) -> Value {
    let mut root = serde_json::json!(catalog.without_declared());
    drop_keys(&mut root, &["name", "hash"]);
    for metric in entries(&mut root, "metric") {
        drop_keys(metric, &["kind", "decimals"]);
    }
    for experiment in entries(&mut root, "experiment") {
        for level in entries(experiment, "chance").filter(|level| level.is_null()) {
            *level = Value::from("none");
        }
    }
    drop_nulls(&mut root);
    root
}

fn entries<'v>(value: &'v mut Value, key: &str) -> impl Iterator<Item = &'v mut Value> {
    value.get_mut(key).and_then(Value::as_object_mut).into_iter().flat_map(Map::values_mut)
}

fn drop_keys(value: &mut Value, keys: &[&str]) {
    if let Some(map) = value.as_object_mut() {
        map.retain(|key, _| !keys.contains(&key.as_str()));
    }
}

fn drop_nulls(value: &mut Value) {
    if let Some(map) = value.as_object_mut() {
        map.retain(|_, value| !value.is_null());
        map.values_mut().for_each(drop_nulls);
    }
}

#[cfg(test)]
mod tests {
    use super::RestoreError;
    use crate::catalogs::catalog::Experiment;
    use crate::columns::Columns;
    use crate::definitions::Definitions;
    use crate::file::built_in_names;
    use crate::tests::schema_columns;

    fn columns() -> Columns {
        schema_columns()
    }

    #[test]
    fn the_built_in_definitions_come_back_as_they_were() {
        for name in built_in_names() {
            let definitions = Definitions::load(name, &columns()).unwrap();
            // In another domain the traces give the columns.
            if definitions.catalog.domain.is_some() {
                assert!(Definitions::of_catalog(&definitions.catalog, &columns()).is_err(), "{name}");
                continue;
            }
            let back = Definitions::of_catalog(&definitions.catalog, &columns()).unwrap();
            assert_eq!(back.catalog, definitions.catalog);
            assert_eq!(back.plan.outputs.len(), definitions.plan.outputs.len());
        }
    }

    #[test]
    fn every_entry_of_a_file_comes_back() {
        let text = "[let]\nfar = \"first(t > 3)\"\n[experiment.X]\ntitle = \"a \\\"b\\\"\"\norder = 7\n\
                    chance = { A = \"none\" }\nreference = { A = [\"1/3\"] }\n\
                    [experiment.Y]\ncontrol = { of = \"X\", on = [\"A\"] }\n\
                    [metric.A]\nvalue = \"far is null\"\nwhen = \"length() > 1\"\nchance = \"1/2\"\nse = \"population\"\n\
                    measures = \"rate\"\n[metric.B]\nvalue = \"A\"\nwhen = \"length() > 2\"\ncompletes = \"A\"\n\
                    [metric.C]\nvalue = \"length()\"\nrange = { least = 1, most = 9 }\nfinished = \"B\"\n";
        let definitions = Definitions::from_toml("mine", text, &columns()).unwrap();
        assert_eq!(Definitions::of_catalog(&definitions.catalog, &columns()).unwrap().catalog, definitions.catalog);
    }

    #[test]
    fn restored_definitions_leave_out_experiments_of_the_traces() {
        let paper = Definitions::load("paper", &columns()).unwrap().catalog;
        let mut catalog = paper.clone();
        let titled =
            |title: &str, order| Experiment { title: title.to_owned(), order, ..paper.experiment["E5"].clone() };
        catalog.declare([("E5".to_owned(), titled("Other", 9)), ("E0".to_owned(), titled("Before", 0))]);
        assert_eq!(catalog.experiment.keys().collect::<Vec<_>>(), ["E0", "E1", "E2", "E3", "E4", "E5"]);
        assert_eq!(catalog.experiment["E5"], paper.experiment["E5"]);
        let back = Definitions::of_catalog(&catalog, &columns()).unwrap().catalog;
        assert_eq!((&back, &back.hash), (&catalog, &paper.hash));
    }

    #[test]
    fn a_catalog_that_was_edited_is_refused() {
        let mut catalog = Definitions::load("paper", &columns()).unwrap().catalog;
        catalog.metric["MCR"].value = "any(visible)".to_owned();
        let error = Definitions::of_catalog(&catalog, &columns()).unwrap_err();
        assert!(matches!(&error, RestoreError::Changed { name, .. } if name == "paper"), "{error}");
    }
}
