//! Compares the answering model with the requested one, by their ids.
//!
//! The same model has several ids. OpenAI answers for an alias with its dated snapshot (`gpt-5.1-2025-11-13`), and so
//! does Anthropic (`claude-sonnet-4-6-20260101`). Google adds `models/` and numbers versions (`gemini-2.5-flash-001`,
//! `gemini-2.5-pro-preview-06-05`). OpenRouter adds a vendor and a variant (`:nitro`), and may reorder words
//! (`anthropic/claude-4.6-sonnet-20260217`). Another version (`gpt-5.1` for `gpt-5`) or size is another model.

use glob::{MatchOptions, Pattern};

/// The backend for the user's own servers.
pub const OWN_SERVER: &str = "compatible";

/// Returns true if `returned` is `asked`, its snapshot or its alias, or matches one of these patterns; `*` is any text.
pub fn answers_for(asked: &str, returned: &str, patterns: &[String]) -> bool {
    let options = MatchOptions { case_sensitive: false, ..MatchOptions::new() };
    let fits = |text: &String| Pattern::new(text).is_ok_and(|pattern| pattern.matches_with(returned, options));
    if patterns.iter().any(|text| text.eq_ignore_ascii_case(returned) || fits(text)) {
        return true;
    }
    let (mut asked, mut extra) = (words(asked), Vec::new());
    for word in words(returned) {
        match asked.iter().position(|own| *own == word) {
            Some(at) => drop(asked.remove(at)),
            None => extra.push(word),
        }
    }
    // With two dates, one of them is wrong.
    is_snapshot(&extra) && is_snapshot(&asked) && (extra.is_empty() || asked.is_empty())
}

fn words(id: &str) -> Vec<String> {
    let id = id.rsplit('/').next().unwrap_or(id).to_lowercase();
    let id = id.split(':').next().unwrap_or_default();
    id.split(['-', '.', '@', '_']).filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

fn is_snapshot(words: &[String]) -> bool {
    let is_number = |word: &&String| word.len() > 1 && word.bytes().all(|byte| byte.is_ascii_digit());
    let digits: usize = words.iter().filter(is_number).map(String::len).sum();
    let is_known = |word: &String| is_number(&word) || ["preview", "exp", "latest"].contains(&word.as_str());
    words.iter().all(is_known) && (digits == 0 || digits > 2)
}

#[cfg(test)]
mod tests {
    use super::answers_for;

    #[test]
    fn snapshots_and_routes_of_a_model_are_the_model() {
        for (asked, returned) in [
            ("gpt-5.1", "gpt-5.1"),
            ("gpt-5.1", "gpt-5.1-2025-11-13"),
            ("gpt-5.1-2025-11-13", "gpt-5.1"),
            ("claude-sonnet-4-6", "claude-sonnet-4-6-20260101"),
            ("claude-sonnet-4-6", "claude-sonnet-4-6@20260101"),
            ("gemini-2.5-pro", "models/gemini-2.5-pro"),
            ("gemini-2.5-pro", "gemini-2.5-pro-preview-06-05"),
            ("gemini-2.5-flash", "gemini-2.5-flash-001"),
            ("anthropic/claude-sonnet-4.6", "anthropic/claude-4.6-sonnet-20260217"),
            ("anthropic/claude-sonnet-4.6", "claude-sonnet-4-6"),
            ("google/gemma-4-26b-a4b-it:nitro", "google/gemma-4-26b-a4b-it-20260403"),
            ("mistralai/ministral-14b-2512:nitro", "mistralai/ministral-14b-2512"),
            ("qwen/qwen3.6-plus", "qwen/qwen3.6-plus-04-02"),
        ] {
            assert!(answers_for(asked, returned, &[]), "{returned} for {asked}");
        }
    }

    #[test]
    fn versions_sizes_and_other_snapshots_are_other_models() {
        for (asked, returned) in [
            ("gemini-2.5-pro", "gemini-3.8-flash"),
            ("gemini-2.5-flash", "gemini-2.5-flash-lite"),
            ("gemini-2.5-pro", "gemini-2.5-flash"),
            ("gpt-5", "gpt-5.1"),
            ("gpt-5.1", "gpt-5.1-mini"),
            ("gpt-5.1", "gpt-5"),
            ("claude-sonnet-4", "claude-sonnet-4-5-20250929"),
            ("google/gemma-4-26b-a4b-it:nitro", "google/gemma-4-31b-it"),
            ("gpt-4o-2024-05-13", "gpt-4o-2024-08-06"),
            ("a", ""),
        ] {
            assert!(!answers_for(asked, returned, &[]), "{returned} for {asked}");
        }
    }

    #[test]
    fn a_pattern_accepts_matching_names_only() {
        let patterns = ["Gemini-3.*".to_owned(), "own[1]".to_owned()];
        assert!(answers_for("a", "gemini-3.8-flash", &patterns) && answers_for("a", "own[1]", &patterns));
        assert!(!answers_for("a", "gemini-4", &patterns));
    }
}
