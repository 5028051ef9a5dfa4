//! The parameter that a provider rejects, and the corresponding line for a models file.

struct Mend {
    words: &'static [&'static str],
    parameter: &'static str,
    line: &'static str,
}

/// The order matters: messages about efforts and schemas may mention others.
static MENDS: [Mend; 5] = [
    // OpenRouter with `require_parameters`, HTTP 404: "No endpoints found that can handle the requested parameters."
    // <https://openrouter.ai/docs/features/provider-routing>
    Mend {
        words: &["handle the requested parameters"],
        parameter: "one that no provider of the model takes",
        line: "extra_body = { provider = { require_parameters = false } }",
    },
    // OpenAI, `param`: "reasoning_effort"; Anthropic: "output_config.effort: ..."; Gemini: "thinking_level" or "Thinking budget".
    Mend {
        words: &[
            "reasoning_effort",
            "config.effort",
            "thinking_level",
            "thinkinglevel",
            "thinking level",
            "thinking.type",
            "thinking budget",
        ],
        parameter: "reasoning_effort",
        line: "reasoning_effort = \"low\"    # or another one that the message names",
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
        parameter: "the schema of the reply",
        line: "contract = \"prompt\"",
    },
    // OpenAI: "max_tokens is too large: ..."; Anthropic: "max_tokens: 200000 > 64000, which is the maximum allowed ...".
    Mend {
        words: &["max_completion_tokens", "max_tokens", "max_output_tokens", "maxoutputtokens"],
        parameter: "max_output_tokens",
        line: "max_output_tokens = 2048    # or another number that the message allows",
    },
    // OpenAI: "Unsupported value: 'temperature' does not support 0.2 with this model. Only the default (1) value is
    // supported."; Anthropic: "`temperature` is deprecated for this model."
    Mend { words: &["temperature"], parameter: "temperature", line: "temperature = \"default\"" },
];

fn refused(error: &str) -> Option<&'static Mend> {
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
