//! Episodes that Python plays step by step.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::json::LineDelimitedWriter;
use mirrorstats::cli::commands::record::RecordArgs;
use mirrorstats::cli::{self, Failure, Options};
use mirrorstats_agents::harness::{Asked, Said};
use mirrorstats_agents::reply::Ending;
use mirrorstats_agents::{Ended, Usage, prompt, reply};
use mirrorstats_experiment::spec::{AnswerType, UNKNOWN};
use mirrorstats_experiment::{Spec, built_in_names};
use mirrorstats_record::environment::{EnvironmentError, Turned};
use mirrorstats_study::gate::leading_metric;
use mirrorstats_trace::frame::Frame;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::{Map, Value, json};

use crate::error;

/// An experiment, step by step. Each message is a JSON object; a frame is height times width times three bytes.
#[pyclass(unsendable, module = "mirrorstats._native")]
pub struct Environment {
    inner: mirrorstats_record::environment::Environment,
    /// The last frame.
    frame: Option<Arc<Frame>>,
}

type Message<'py> = (String, Option<Bound<'py, PyBytes>>);

#[pymethods]
impl Environment {
    #[new]
    fn new(options: &str, is_privileged: bool, casts: bool, is_temporary: bool) -> PyResult<Self> {
        let options: Options = serde_json::from_str(options).map_err(error::of_argument)?;
        let args: RecordArgs = cli::options_of("record", &options).map_err(|fault| wrong(&fault))?;
        let inner = args.environment(is_privileged, casts).map_err(|fault| failed(&fault))?;
        Ok(Self { inner: if is_temporary { inner.temporary() } else { inner }, frame: None })
    }

    /// What does not change between episodes: sizes, replies, and the world as far as a player may know it.
    fn description(&self) -> String {
        let (experiment, config) = (self.inner.experiment(), self.inner.config());
        let steps = experiment.hand.map_or(config.episode.steps, |hand| hand.most + hand.extra_steps);
        let choices = choices(experiment);
        let free_texts: Vec<&str> = experiment.keys().into_iter().filter(|key| choices.get(key).is_none()).collect();
        let described = json!({
            "experiment": experiment.name(),
            "title": experiment.title,
            "width": config.eye.width,
            "height": config.eye.height_px,
            "steps": steps,
            "choices": choices,
            "free_texts": free_texts,
            "world": {
                "fov_y": config.eye.fovy,
                "eye_height": config.eye.height,
                "step_length": config.body.step_length,
                "turn": 30,
                "room_size": config.room.size,
                "palette": experiment.layout.palette.iter().map(|color| color.name()).collect::<Vec<_>>(),
            },
        });
        described.to_string()
    }

    fn reset<'py>(&mut self, py: Python<'py>, seed: i32, run: i32) -> PyResult<Message<'py>> {
        let asked = self.inner.begin(seed, run).map_err(of_environment)?;
        self.message(py, &asked)
    }

    #[pyo3(signature = (text, latency_ms=None, tokens=(None, None), ending="whole"))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        text: String,
        latency_ms: Option<i32>,
        tokens: (Option<i32>, Option<i32>),
        ending: &str,
    ) -> PyResult<Message<'py>> {
        let ending = match ending {
            "truncated" => Ending::Truncated,
            "refused" => Ending::Refused,
            _ => Ending::Whole,
        };
        let usage = Usage { latency_ms, prompt_tokens: tokens.0, completion_tokens: tokens.1, cost_usd: None };
        match self.inner.reply(Said { text, ending, usage }).map_err(of_environment)? {
            Turned::Asked(asked) => self.message(py, &asked),
            Turned::Ended { id, part, ended } => {
                let (metric, metrics) = scores(&part)?;
                self.inner.release(&id, &part).map_err(of_environment)?;
                let done = ended == Some(Ended::Done);
                let message = json!({ "episode_id": id, "done": done, "metric": metric, "metrics": metrics });
                Ok((message.to_string(), None))
            }
        }
    }

    /// The last frame as PNG.
    fn png<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let frame = self.frame.as_ref().ok_or_else(|| of_environment(EnvironmentError::NoEpisode))?;
        Ok(PyBytes::new(py, frame.to_png().map_err(error::of_input)?))
    }

    /// Ends the episode under way as lost, and assembles the trace and the log; gives their paths.
    fn close(&mut self) -> PyResult<[PathBuf; 2]> {
        self.inner.close().map_err(of_environment)
    }
}

impl Environment {
    fn message<'py>(&mut self, py: Python<'py>, asked: &Asked) -> PyResult<Message<'py>> {
        let observation = &asked.observation;
        let words = asked.prompt().map_err(error::of_input)?;
        let action = observation.history.as_ref().and_then(|(action, _)| *action);
        let truth = self.inner.truth().map(|truth| {
            json!({
                "body_color": truth.body_color.name(),
                "mirror_visible": truth.is_mirror_visible,
                "visibility": truth.visibility,
            })
        });
        let message = json!({
            "t": observation.t,
            "steps_left": observation.remaining,
            "position": [observation.x, observation.y],
            "heading": observation.yaw,
            "bumped": observation.bumped,
            "previous_action": action.map(prompt::letter),
            "system": words.system,
            "user": words.user,
            "truth": truth,
        });
        self.frame = Some(Arc::clone(&observation.frame));
        Ok((message.to_string(), Some(PyBytes::new(py, &observation.frame.rgb))))
    }
}

impl Drop for Environment {
    fn drop(&mut self) {
        // Assembles the traces of an environment that was not closed. A drop cannot report an error.
        let _ = self.inner.close();
    }
}

/// The built-in experiments.
#[pyfunction]
pub fn experiments() -> Vec<&'static str> {
    built_in_names()
}

/// The values that each key of a reply may have: texts, or null for a number; keys of free text are left out.
fn choices(experiment: &Spec) -> Value {
    let palette = || experiment.layout.palette.iter().map(|color| color.name());
    let schema = reply::schema("", experiment);
    let closed = |key: &str| schema["properties"][key]["enum"].as_array().cloned().map(Value::Array);
    let mut all = Map::new();
    for key in &experiment.reply {
        all.extend(closed(key.name()).map(|texts| (key.name().to_owned(), texts)));
    }
    if experiment.asks_for_identification() {
        all.insert("identification".to_owned(), palette().chain([UNKNOWN]).collect());
    }
    for answer in &experiment.answers {
        let colors = || palette().chain(answer.unknown.then_some(UNKNOWN)).collect();
        let texts = closed(&answer.key).or_else(|| (answer.kind == AnswerType::Color).then(colors));
        all.insert(answer.key.clone(), texts.unwrap_or_default());
    }
    Value::Object(all)
}

/// The first metric with a better direction, and the value of each metric for the only episode of a trace; null where a
/// metric is undefined.
fn scores(part: &Path) -> PyResult<(String, Map<String, Value>)> {
    let study = mirrorstats::Study::open([part]).map_err(error::of_study)?;
    let metric = leading_metric(&study).map_err(error::of_study)?;
    let scored = study.score().map_err(error::of_study)?.episodes;
    let mut line = Vec::new();
    let table = mirrorstats::episode_batch(&scored).map_err(error::of_input)?;
    LineDelimitedWriter::new(&mut line).write(&table).map_err(error::of_input)?;
    let mut row: Map<String, Value> = serde_json::from_slice(&line).map_err(error::of_input)?;
    let value = |name: &String| (name.clone(), row.remove(name).unwrap_or_default());
    Ok((metric, scored.catalog.metric.keys().map(value).collect()))
}

fn wrong(failure: &Failure) -> PyErr {
    error::of_failure(failure, "ArgumentError")
}

fn failed(failure: &Failure) -> PyErr {
    error::of_failure(failure, "RecordError")
}

fn of_environment(fault: EnvironmentError) -> PyErr {
    failed(&Failure::input(fault))
}
