//! The JSON messages of a log: episodes and rows, as a trace holds them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::trace::episode::{Action, Episode, Extra, Step};

/// A message of the topic `/episode`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "lowercase", deny_unknown_fields)]
pub enum EpisodeMessage {
    /// An episode begins.
    Begin(Head),
    /// It has ended, by `done` or with its last step.
    End {
        /// Its id.
        episode_id: String,
        /// Its steps.
        steps: usize,
    },
}

/// The constants of an episode; the columns of the same names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[expect(missing_docs, reason = "each field is the column of its name")]
pub struct Head {
    pub episode_id: String,
    pub model: String,
    pub experiment: String,
    pub seed: i32,
    pub run: i32,
    pub body_color: String,
    pub stated_color: Option<String>,
    pub distractors: Option<i8>,
}

impl Head {
    /// The constants of an episode.
    pub fn of(episode: &Episode) -> Self {
        Self {
            episode_id: episode.episode_id.clone(),
            model: episode.model.clone(),
            experiment: episode.experiment.clone(),
            seed: episode.seed,
            run: episode.run,
            body_color: episode.body_color.clone(),
            stated_color: episode.stated_color.clone(),
            distractors: episode.distractors,
        }
    }

    /// An episode of these constants and these steps.
    pub fn with_steps(self, steps: Vec<Step>) -> Episode {
        Episode {
            episode_id: self.episode_id,
            model: self.model,
            experiment: self.experiment,
            seed: self.seed,
            run: self.run,
            body_color: self.body_color,
            stated_color: self.stated_color,
            distractors: self.distractors,
            steps,
        }
    }
}

/// A message of the topic `/decision`: a row of the trace. A column without a value is left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "each field is the column of its name")]
pub struct Decision {
    pub t: i32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub action: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub self_color: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub selected_cube: Option<String>,
    pub mirror_visible: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mirror_self_px: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mirror_other_px: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mirror_px: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direct_other_px: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_x: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_y: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_yaw: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bumped: Option<bool>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cube_distance: Option<f32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_status: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply_repair: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view_description: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reasoning: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub summary: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub identification: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reply: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_ms: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prompt_tokens: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion_tokens: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost_usd: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_time: Option<i64>,
}

/// An action that is none of the five.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("step {t}: expected one of the five actions, found `{found}`")]
pub struct NoAction {
    t: i32,
    found: String,
}

impl Decision {
    /// The row of a step.
    pub fn of(t: i32, step: &Step) -> Self {
        let extra = step.extra.clone();
        Self {
            t,
            action: step.action.map(|action| action.name().to_owned()),
            self_color: step.self_color.clone(),
            selected_cube: step.selected_cube.clone(),
            mirror_visible: step.mirror_visible,
            mirror_self_px: extra.mirror_self_px,
            mirror_other_px: extra.mirror_other_px,
            mirror_px: extra.mirror_px,
            direct_other_px: extra.direct_other_px,
            pose_x: extra.pose_x,
            pose_y: extra.pose_y,
            pose_yaw: extra.pose_yaw,
            bumped: extra.bumped,
            cube_distance: extra.cube_distance,
            reply_status: extra.reply_status,
            reply_repair: extra.reply_repair,
            view_description: extra.view_description,
            reasoning: extra.reasoning,
            summary: extra.summary,
            identification: extra.identification,
            reply: extra.reply,
            latency_ms: extra.latency_ms,
            prompt_tokens: extra.prompt_tokens,
            completion_tokens: extra.completion_tokens,
            cost_usd: extra.cost_usd,
            frame_time: extra.frame_time,
        }
    }

    /// The step of a row.
    ///
    /// # Errors
    /// For an action that is none.
    pub fn into_step(self) -> Result<Step, NoAction> {
        let action = match &self.action {
            None => None,
            Some(name) => {
                let known = Action::ALL.into_iter().find(|action| action.name() == name);
                Some(known.ok_or_else(|| NoAction { t: self.t, found: name.clone() })?)
            }
        };
        Ok(Step {
            action,
            self_color: self.self_color,
            selected_cube: self.selected_cube,
            mirror_visible: self.mirror_visible,
            extra: Extra {
                mirror_self_px: self.mirror_self_px,
                mirror_other_px: self.mirror_other_px,
                mirror_px: self.mirror_px,
                direct_other_px: self.direct_other_px,
                pose_x: self.pose_x,
                pose_y: self.pose_y,
                pose_yaw: self.pose_yaw,
                bumped: self.bumped,
                cube_distance: self.cube_distance,
                reply_status: self.reply_status,
                reply_repair: self.reply_repair,
                view_description: self.view_description,
                reasoning: self.reasoning,
                summary: self.summary,
                identification: self.identification,
                reply: self.reply,
                latency_ms: self.latency_ms,
                prompt_tokens: self.prompt_tokens,
                completion_tokens: self.completion_tokens,
                cost_usd: self.cost_usd,
                frame_time: self.frame_time,
            },
        })
    }
}
