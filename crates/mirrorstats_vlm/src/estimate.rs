//! The estimate of requests before any is sent: tokens from the length of their words and the size of their frame.
//!
//! Rule: requests are estimated, and replies bounded. Words count as four characters per token, as providers advise for
//! English; a frame counts as its wire format's provider documents. An unknown price gives no cost, rather than a cost
//! of zero.

use crate::models::Choice;
use crate::wire_format::WireFormat;
use mirrorstats_agents::prompt::Prompt;
use mirrorstats_agents::{Observation, Past, Task, reply};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::frame::Frame;

/// Characters per token of English words.
const CHARACTERS: u64 = 4;
/// A thought of typical length, as repeated in the next step's prompt.
const THOUGHT: &str = "I see a wall and part of a mirror to the right. I turn right to face the mirror and look for my \
                       own body in it, so that I can find out which colour I am before I go to a cube.";

pub fn prompt_tokens(choice: &Choice, experiment: &Experiment, view: [u32; 2]) -> Result<u64, minijinja::Error> {
    let words = Prompt::for_experiment(experiment)?.render(&task(experiment), &observation())?;
    let schema = reply::structure(experiment);
    let characters = choice.body(&words, &schema, "").to_string().chars().count() as u64;
    Ok(characters.div_ceil(CHARACTERS) + frame_tokens(choice.backend.wire_format, view))
}

pub(crate) fn frame_tokens(wire_format: WireFormat, [width, height]: [u32; 2]) -> u64 {
    let (width, height) = (u64::from(width), u64::from(height));
    match wire_format {
        // 85, plus 170 per tile of 512 x 512 after the shorter side is scaled down to at most 768.
        WireFormat::OpenaiChat => {
            let side = |pixels: u64| (pixels * 768).div_ceil(width.min(height).max(768)).div_ceil(512);
            85 + 170 * side(width) * side(height)
        }
        // 258 up to 384 x 384, otherwise 258 per tile: crops of two thirds of the shorter side, 256 to 768 pixels.
        WireFormat::Gemini if width.max(height) <= 384 => 258,
        WireFormat::Gemini => {
            let tile = (width.min(height) * 2 / 3).clamp(256, 768);
            258 * width.div_ceil(tile) * height.div_ceil(tile)
        }
        // One token per 750 pixels; other models' servers differ, and few take more.
        WireFormat::AnthropicMessages | WireFormat::OpenaiCompatible => (width * height).div_ceil(750),
    }
}

fn task(experiment: &Experiment) -> Task {
    let stated_color = Some("yellow".to_owned());
    Task { experiment: experiment.clone(), stated_color, step_budget: 100, seed: 0 }
}

fn observation() -> Observation {
    let past = Past { action: Some(Action::MoveForward), bumped: false, thought: Some(THOUGHT.to_owned()) };
    Observation {
        t: 50,
        remaining: 51,
        x: -1.25,
        y: -1.25,
        yaw: 330.0,
        bumped: true,
        history: Some((Some(Action::MoveForward), Some(THOUGHT.to_owned()))),
        past: std::sync::Arc::new(vec![past; 50]),
        frame: std::sync::Arc::new(Frame::new(0, 0, Vec::new())),
        fov_y: 110.0,
    }
}

#[cfg(test)]
mod tests {
    use super::{Experiment, WireFormat, frame_tokens, prompt_tokens};
    use crate::models::{Contract, Models};

    #[test]
    fn a_frame_counts_as_its_provider_says() {
        let of = |wire_format, view| frame_tokens(wire_format, view);
        assert_eq!(of(WireFormat::OpenaiChat, [640, 480]), 85 + 2 * 170);
        assert_eq!(of(WireFormat::OpenaiChat, [512, 512]), 85 + 170);
        assert_eq!(of(WireFormat::OpenaiChat, [1536, 1536]), 85 + 4 * 170);
        assert_eq!(of(WireFormat::Gemini, [384, 384]), 258);
        assert_eq!(of(WireFormat::Gemini, [640, 480]), 258 * 4);
        assert_eq!(of(WireFormat::AnthropicMessages, [640, 480]), 410);
    }

    #[test]
    fn words_frame_and_schema_are_counted() {
        let models = Models::load(None).unwrap();
        let mut choice = models.choose("Claude Sonnet 4.6", None).unwrap();
        let tokens = |choice: &_, experiment, view| prompt_tokens(choice, experiment, view).unwrap();
        let with_schema = tokens(&choice, &Experiment::E1, [640, 480]);
        // The prompt has about 2200 characters.
        assert!((800..2_000).contains(&with_schema), "{with_schema}");
        assert!(tokens(&choice, &Experiment::E1, [64, 48]) < with_schema - 400);
        choice.model.contract = Contract::Prompt;
        assert!(tokens(&choice, &Experiment::E1, [640, 480]) < with_schema - 100);
    }
}
