//! The comparison of two models: the numbers of the statistics, in either order of choice.

use mirrorstats_analysis::statistics::{PairTest, Statistics};

use crate::html::browser::Browser;
use crate::html::scored::{PAPER_PAGE, Report};

/// Chooses a model as a reader does.
fn choose(browser: &mut Browser, selector: &str, model: &str) {
    browser.value(&format!(
        "(() => {{ const s = document.querySelector('{selector}'); \
         s.value = [...s.options].find((o) => o.text === '{model}').value; s.dispatchEvent(new Event('change')); }})()"
    ));
}

/// The cells of a row.
fn row(browser: &mut Browser, experiment: &str, metric: &str) -> Vec<String> {
    browser.texts(&format!(
        "[...[...document.querySelectorAll('#pair tbody tr')].find((r) => r.dataset.experiment === '{experiment}' && \
         r.cells[1].textContent === '{metric}').cells].map((c) => c.textContent)"
    ))
}

fn test<'s>(statistics: &'s Statistics, experiment: &str, metric: &str, models: [&str; 2]) -> &'s PairTest {
    let family = statistics.models.iter().find(|family| family.experiment == experiment && family.metric == metric);
    let is_wanted = |test: &&PairTest| models.contains(&&*test.first) && models.contains(&&*test.second);
    family.unwrap().tests.iter().find(is_wanted).unwrap()
}

#[test]
fn the_tests_of_two_chosen_models_match_the_statistics() {
    let report = Report::paper();
    let statistics = report.statistics.as_ref().unwrap();
    let mut browser = Browser::open(&PAPER_PAGE);
    for models in [["GPT 5.1", "Claude Sonnet 4.6"], ["Claude Sonnet 4.6", "GPT 5.1"], ["Gemma4 26B", "Gemini 2.5 Pro"]]
    {
        choose(&mut browser, "#pair-first", models[0]);
        choose(&mut browser, "#pair-second", models[1]);
        for (experiment, metric) in [("E1", "TSA"), ("E2", "CAAL"), ("E5", "TSA"), ("E4", "CR")] {
            let test = test(statistics, experiment, metric, models);
            let found = &test.comparison;
            let sign = if test.first == models[0] { 1.0 } else { -1.0 };
            let cells = row(&mut browser, experiment, metric);
            let number = |text: &str| text.parse::<f64>().unwrap();
            assert!((number(&cells[6]) - sign * found.difference.unwrap()).abs() < 5.1e-4, "{cells:?}");
            let (k, l) = (found.successes.unwrap(), found.n);
            let mut sides = [format!("{}/{}", k[0], l[0]), format!("{}/{}", k[1], l[1])];
            if test.first != models[0] {
                sides.reverse();
            }
            assert_eq!(cells[3..5], sides, "{models:?} {experiment} {metric}");
            let bounds: Vec<f64> = cells[7].trim_matches(['[', ']']).split(", ").map(number).collect();
            assert!(bounds[0] <= number(&cells[6]) && number(&cells[6]) <= bounds[1], "{cells:?}");
            let verdict =
                if found.separated { format!("{} is better", test.first) } else { "not told apart".to_owned() };
            assert_eq!(cells[10], verdict);
        }
    }
    assert!(browser.text("location.search").contains("a=Gemma4+26B&b=Gemini+2.5+Pro"));
    choose(&mut browser, "#pair-second", "Gemma4 26B");
    let chosen = "[...document.querySelectorAll('#pair select')].map((s) => s.selectedOptions[0].text)";
    let chosen = browser.texts(chosen);
    assert!(chosen[0] != chosen[1] && chosen[1] == "Gemma4 26B", "{chosen:?}");
    browser.close();
}

#[test]
fn a_link_has_the_two_models_and_filters_leave_their_experiments() {
    let mut browser = Browser::open_at(&PAPER_PAGE, "?a=Qwen+3.6+Plus&b=GPT+5.1&experiment=E3");
    let heads = "[...document.querySelectorAll('#pair thead [data-side]')].map((h) => h.textContent)";
    assert_eq!(browser.texts(heads), ["Qwen 3.6 Plus", "GPT 5.1"]);
    let shown = "[...new Set([...document.querySelectorAll('#pair tbody tr')].filter((r) => r.checkVisibility()) \
        .map((r) => r.dataset.experiment))]";
    assert_eq!(browser.texts(shown), ["E3", ""], "and what is said over all experiments");
    browser.close();
}

#[test]
fn without_a_second_model_there_is_nothing_to_compare() {
    let mut browser = Browser::open(&Report::bare().render().unwrap());
    assert!(browser.holds("document.getElementById('pair') === null"));
    browser.close();
}
