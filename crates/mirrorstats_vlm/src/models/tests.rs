use super::{Models, Prices, WireFormat};

#[test]
fn a_cost_needs_both_prices() {
    let [none, input, output] = [(None, None), (Some(2.0), None), (None, Some(3.0))].map(|(input, output)| Prices {
        input,
        output,
        ..Prices::default()
    });
    assert_eq!([none, input, output].map(|prices| prices.cost_of(1, 1)), [None; 3]);
    assert_eq!([none, input, output].map(Prices::unknown), [vec!["input", "output"], vec!["output"], vec!["input"]]);
    assert_eq!([none, input].map(|prices| prices.cost_of_requests(500_000)), [None, Some(1.0)]);
    let both = Prices { input: Some(2.0), output: Some(3.0), ..Prices::default() };
    assert_eq!((both.cost_of(500_000, 1_000_000), both.unknown()), (Some(4.0), vec![]));
}

#[test]
fn cached_tokens_have_a_price_of_their_own() {
    let body = serde_json::json!({ "choices": [], "usage": {
        "prompt_tokens": 500_000, "completion_tokens": 1_000_000, "prompt_tokens_details": { "cached_tokens": 400_000 },
    } });
    let answer = WireFormat::OpenaiChat.answer(&body).unwrap();
    let prices = Prices { input: Some(2.0), cached_input: Some(0.5), output: Some(3.0) };
    assert!((prices.cost_usd(&answer).unwrap() - 3.4).abs() < 1e-9);
    assert_eq!(Prices { cached_input: None, ..prices }.cost_usd(&answer), Some(4.0));
    assert_eq!(Prices { input: None, ..prices }.cost_usd(&answer), None);
}

#[test]
fn temperature_and_extra_body_are_per_model() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    let own = |keys: &str| {
        std::fs::write(&file, format!("[model.own]\nbackend = \"openrouter\"\nid = \"x\"\n{keys}\n")).unwrap();
        Models::load(Some(&file)).map(|models| models.choose("own", None).unwrap()).map_err(|fault| fault.to_string())
    };
    let temperature = |keys: &str| own(keys).map(|choice| choice.model.temperature);
    assert_eq!([temperature(""), temperature("temperature = 1")], [Ok(Some(0.2)), Ok(Some(1.0))]);
    assert_eq!(temperature("temperature = \"default\""), Ok(None));
    for wrong in ["-0.1", "\"low\"", "nan", "true"] {
        let fault = temperature(&format!("temperature = {wrong}")).unwrap_err();
        assert!(
            fault.contains(["`temperature` may be 0 or more", "a number"][usize::from(wrong.contains(['l', 'u']))]),
            "{fault}"
        );
    }
    let extra = |keys: &str| own(keys).map(|choice| serde_json::Value::from(choice.extra_body()));
    let merged = serde_json::json!({ "top_k": 1, "provider": { "only": ["a"], "require_parameters": true } });
    assert_eq!(extra("extra_body = { top_k = 1, provider = { only = [\"a\"] } }"), Ok(merged));
    let without = serde_json::json!({ "provider": { "require_parameters": false } });
    assert_eq!(extra("extra_body = { provider = { require_parameters = false } }"), Ok(without));
    let fault = extra("extra_body = { messages = [] }").unwrap_err();
    assert!(fault.contains("`extra_body` has `messages`, which is part of the protocol"), "{fault}");
}

#[test]
fn an_unknown_id_goes_to_the_provider_of_its_form() {
    let models = Models::load(None).unwrap();
    for (id, backend) in
        [("gpt-9-x", "openai"), ("claude-x-1", "anthropic"), ("gemini-9", "google"), ("a/b:free", "openrouter")]
    {
        let choice = models.choose(id, None).unwrap();
        assert_eq!((choice.model.backend.as_str(), choice.is_known), (backend, false), "{id}");
    }
    assert!(models.choose("gpt-5.1", None).unwrap().is_known);
    for name in ["GPT 9", "gpt", "own-1", "Claude Sonnet"] {
        assert!(models.choose(name, None).is_err(), "{name}");
    }
}

#[test]
fn an_invalid_price_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    for price in ["-1.0", "nan", "inf"] {
        let model = format!("[model.own]\nbackend = \"google\"\nid = \"x\"\nprices = {{ input = {price} }}\n");
        std::fs::write(&file, model).unwrap();
        let fault = Models::load(Some(&file)).unwrap_err().to_string();
        assert!(fault.contains("`input` may be 0 or more"), "{fault}");
    }
}

#[test]
fn reasoning_raises_the_default_token_limit_of_a_model() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    let most = |keys: &str| {
        std::fs::write(&file, format!("[model.own]\nbackend = \"google\"\nid = \"x\"\n{keys}\n")).unwrap();
        Ok(Models::load(Some(&file)).map_err(|fault| fault.to_string())?.model["own"].max_output_tokens())
    };
    assert_eq!(most(""), Ok(2_048));
    assert_eq!(most("reasoning_effort = \"none\""), Ok(2_048));
    assert_eq!(most("max_output_tokens = 300\nreasoning_effort = \"high\""), Ok(300));
    let with_reasoning: Result<u32, String> = most("reasoning_effort = \"low\"");
    assert!(with_reasoning.unwrap() > 2_048);
    assert!(most("max_output_tokens = 0").unwrap_err().contains("own.toml"));
    let fault = most("reasoning_effort = \"hard\"").unwrap_err();
    assert!(fault.contains("`hard`") && fault.contains("minimal"), "{fault}");
    // Of the paper's models, those that reason by default.
    let models = Models::load(None).unwrap().model;
    let [reasons, replies] = ["Gemini 2.5 Pro", "Ministral 3 14B"].map(|name| models[name].max_output_tokens());
    assert!(reasons > 2_048 && replies == 2_048);
}

#[test]
fn a_key_in_place_of_its_variable_is_refused_and_not_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    for text in [
        "[backend.own]\nwire_format = \"gemini\"\nkey = \"sk-secret-1\"\n",
        "backend.own = { key = 'sk-secret,1', dialct = \"gemini\" }\n",
        "[backend.own]\nwire_format = \"gemini\"\n\"key\" = sk-secret-1\n",
    ] {
        std::fs::write(&file, text).unwrap();
        let fault = Models::load(Some(&file)).unwrap_err().to_string();
        assert!(fault.contains("own.toml:") && !fault.contains("secret"), "{fault}");
        assert!(fault.contains("environment variable") || text.contains("= sk"), "{fault}");
    }
}
