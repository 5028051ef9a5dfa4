//! The JSON messages of a log: episodes and rows, with the columns of a trace as keys.

use schemars::{JsonSchema, Schema};
use serde::de::Error as _;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use mirrorstats_trace::episodes::answers::{Answered, PREFIXES, is_answer};
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};

/// A message of the topic `/episode`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "lowercase", deny_unknown_fields)]
pub enum EpisodeMessage {
    /// An episode begins.
    Begin(Box<Episode>),
    /// It has ended, by `done` or with its last step.
    End {
        /// Its id.
        episode_id: String,
        /// Its steps.
        steps: usize,
        /// Its fingerprint, which is unknown before the first answer; the column of that name.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        fingerprint: Option<String>,
        /// The hash of its rows; the column of that name.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        episode_hash: Option<String>,
    },
}

/// A message of the topic `/decision`: a row of the trace. A column without a value is left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(transform = with_answers_alone)]
pub struct Decision {
    pub t: i32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub self_color: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selected_cube: Option<String>,
    pub mirror_visible: bool,
    #[serde(flatten)]
    pub extra: Extra,
    /// The columns of an experiment's own answers; read, other keys too.
    #[serde(flatten)]
    #[schemars(skip)]
    others: Map<String, Value>,
}

/// Restricts other keys of a row to answers in the schema, which the type cannot express.
fn with_answers_alone(schema: &mut Schema) {
    let required = schema.remove("required");
    let answers = PREFIXES.map(|prefix| (format!("^{prefix}"), json!({ "type": ["string", "number"] })));
    schema.insert("patternProperties".to_owned(), Map::from_iter(answers).into());
    schema.insert("additionalProperties".to_owned(), false.into());
    schema.insert("required".to_owned(), required.unwrap_or_default());
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("step {t}: expected an action such as `move_forward`, found `{found}`")]
pub struct NoAction {
    t: i32,
    found: String,
}

impl Decision {
    pub fn from_step(t: i32, step: &Step) -> Self {
        let Step { action, self_color, selected_cube, mirror_visible, extra } = step.clone();
        let action = action.map(|action| action.name().to_owned());
        let others = extra.answers.iter().map(|(name, answered)| (name.clone(), json!(answered))).collect();
        Self { t, action, self_color, selected_cube, mirror_visible, extra, others }
    }

    pub fn parse(json: &[u8]) -> serde_json::Result<Self> {
        let mut row: Self = serde_json::from_slice(json)?;
        for (name, value) in &row.others {
            let unknown = || serde_json::Error::custom(format_args!("unknown field `{name}`"));
            let answered = Some(value).filter(|_| is_answer(name)).ok_or_else(unknown)?;
            row.extra.answers.insert(name.clone(), Answered::deserialize(answered)?);
        }
        Ok(row)
    }

    pub fn into_step(self) -> Result<Step, NoAction> {
        let Self { t, action, self_color, selected_cube, mirror_visible, extra, .. } = self;
        let named = |name: String| Action::named(&name).ok_or(NoAction { t, found: name });
        let action = action.map(named).transpose()?;
        Ok(Step { action, self_color, selected_cube, mirror_visible, extra })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::{Decision, Episode, Step};
    use mirrorstats_trace::episodes::episode::Extra;
    use mirrorstats_trace::schema::COLUMNS;

    proptest! {
        #[test]
        fn numbers_round_trip_exactly(cost in 0.0..10.0_f64, x in -5.0..5.0_f32) {
            let extra = Extra { cost_usd: Some(cost), pose_x: Some(x), ..Extra::default() };
            let row = Decision::from_step(1, &Step { extra, ..Step::default() });
            prop_assert_eq!(Decision::parse(json!(row).to_string().as_bytes()).unwrap(), row.clone());
            prop_assert_eq!(Decision::parse(&serde_json::to_vec(&row).unwrap()).unwrap(), row);
        }
    }

    #[test]
    fn messages_have_the_columns_of_the_table_as_keys() {
        let keys = |schema: schemars::Schema| -> Vec<String> {
            json!(schema)["properties"].as_object().unwrap().keys().cloned().collect()
        };
        let columns = |constant| COLUMNS.iter().filter(move |c| c.constant == constant).map(|c| c.name.to_owned());
        assert_eq!(keys(schemars::schema_for!(Episode)), columns(true).collect::<Vec<_>>());
        assert_eq!(keys(schemars::schema_for!(Decision)), columns(false).collect::<Vec<_>>());
    }

    #[test]
    fn a_key_that_is_no_column_is_refused() {
        let mut row = json!(Decision::from_step(1, &Step::default()));
        assert!(Decision::parse(row.to_string().as_bytes()).is_ok());
        row["mirror_pixels"] = json!(1);
        let error = Decision::parse(row.to_string().as_bytes()).unwrap_err();
        assert_eq!(error.to_string(), "unknown field `mirror_pixels`");
    }
}
