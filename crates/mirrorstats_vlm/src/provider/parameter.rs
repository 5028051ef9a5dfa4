//! The parameter that a provider rejects, and the corresponding line for a models file.

use std::num::NonZeroU32;

use serde_json::{Value, json};

use crate::models::{Contract, Model, merge};

pub(crate) struct Mend {
    words: &'static [&'static str],
    pub(crate) key: &'static str,
    parameter: &'static str,
    pub(crate) line: &'static str,
    pub(crate) leave_out: fn(&mut Model),
}

const SHORT: Option<NonZeroU32> = NonZeroU32::new(2_048);

/// The order matters: messages about efforts and schemas may mention others.
static MENDS: [Mend; 5] = [
    // OpenRouter with `require_parameters`, HTTP 404: "No endpoints found that can handle the requested parameters."
    // <https://openrouter.ai/docs/features/provider-routing>
    Mend {
        words: &["handle the requested parameters"],
        key: "extra_body.provider",
        parameter: "one that no provider of the model takes",
        line: "extra_body = { provider = { require_parameters = false } }",
        leave_out: |model| {
            let provider = model.extra_body.entry("provider").or_insert(Value::Null);
            merge(provider, &json!({ "require_parameters": false }));
        },
    },
    // OpenAI, `param`: "reasoning_effort"; Anthropic: "output_config.effort: ..."; Gemini: "thinking_level" or "Thinking budget".
    Mend {
        words: &[
            "reasoning_effort",
            "config.effort",
            "thinking_level",
            "thinkinglevel",
            "thinking level",
            "thinking budget",
        ],
        key: "reasoning_effort",
        parameter: "reasoning_effort",
        line: "reasoning_effort = \"low\"    # or another one that the message names",
        leave_out: |model| model.reasoning_effort = None,
    },
    // OpenAI: "Invalid parameter: 'response_format' of type 'json_schema' is not supported with this model".
    Mend {
        words: &[
            "response_format",
            "json_schema",
            "response_json_schema",
            "responsejsonschema",
            "output_config.format",
        ],
        key: "contract",
        parameter: "the schema of the reply",
        line: "contract = \"prompt\"",
        leave_out: |model| model.contract = Contract::Prompt,
    },
    // OpenAI: "max_tokens is too large: ..."; Anthropic: "max_tokens: 200000 > 64000, which is the maximum allowed ...".
    Mend {
        words: &["max_completion_tokens", "max_tokens", "max_output_tokens", "maxoutputtokens"],
        key: "max_output_tokens",
        parameter: "max_output_tokens",
        line: "max_output_tokens = 2048    # or another number that the message allows",
        leave_out: |model| model.max_output_tokens = SHORT,
    },
    // OpenAI: "Unsupported value: 'temperature' does not support 0.2 with this model. Only the default (1) value is
    // supported."; Anthropic: "`temperature` is deprecated for this model."
    Mend {
        words: &["temperature"],
        key: "temperature",
        parameter: "temperature",
        line: "temperature = \"default\"",
        leave_out: |model| model.temperature = None,
    },
];

pub(crate) fn refused(error: &str) -> Option<&'static Mend> {
    let said = error.to_lowercase().replace("\": \"", "\":\"");
    // The parameter in `param` is the rejected one, whatever else the message mentions.
    let named = |mend: &&Mend| mend.words.iter().any(|word| said.contains(&format!("\"param\":\"{word}\"")));
    let named_in = |mend: &&Mend| mend.words.iter().any(|word| said.contains(word));
    MENDS.iter().find(named).or_else(|| MENDS.iter().find(named_in))
}

pub(crate) fn help(error: &str, model: &str) -> String {
    refused(error).map_or_else(String::new, |Mend { parameter, line, .. }| {
        format!("\n  help: the parameter is {parameter}; in the entry [model.\"{model}\"] of a file for --models:\n    {line}")
    })
}
