//! Figures at the library boundary: the tests read their bytes back.

mod cast;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use cast::Cast;
use mirrorstats_analysis::statistics::Contrast;
use mirrorstats_exact::number;
use mirrorstats_figures::{FigureError, FigureFormat, FigureName, FigureWidth, Input, draw};
use mirrorstats_statistics::intervals::interval::wilson;
use resvg::usvg::roxmltree::{Document, Node};
use resvg::usvg::{self, Rect, fontdb};

fn svg(name: FigureName, cast: &Cast) -> String {
    draw(name, &cast.input()).unwrap_or_else(|error| panic!("{name}: {error}")).inline_svg()
}

/// Every text as drawn, with its bounding box.
fn texts(svg: &str) -> (usvg::Size, Vec<(String, Rect)>) {
    let mut fonts = fontdb::Database::new();
    fonts.load_fonts_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/fonts"));
    let options = usvg::Options { fontdb: Arc::new(fonts), ..usvg::Options::default() };
    let tree = usvg::Tree::from_str(svg, &options).unwrap();
    let mut found = Vec::new();
    collect(tree.root(), &mut found);
    (tree.size(), found)
}

fn collect(group: &usvg::Group, found: &mut Vec<(String, Rect)>) {
    for node in group.children() {
        match node {
            usvg::Node::Group(group) => collect(group, found),
            usvg::Node::Text(text) => {
                let words: String = text.chunks().iter().map(usvg::TextChunk::text).collect();
                let ink = text.flattened().bounding_box().transform(text.abs_transform()).unwrap();
                found.push((words, ink));
            }
            usvg::Node::Path(_) | usvg::Node::Image(_) => {}
        }
    }
}

fn overlap(a: Rect, b: Rect) -> bool {
    // Texts may overlap by less than a reader sees.
    const HAIR: f32 = 0.25;
    a.left() + HAIR < b.right()
        && b.left() + HAIR < a.right()
        && a.top() + HAIR < b.bottom()
        && b.top() + HAIR < a.bottom()
}

fn check_layout(label: &str, cast: &Cast) {
    for name in FigureName::ALL {
        check_texts(&format!("{name} {label}"), &svg(name, cast));
    }
}

fn check_texts(label: &str, svg: &str) {
    let (size, texts) = texts(svg);
    assert!(texts.len() > 3, "{label}");
    for (at, (words, ink)) in texts.iter().enumerate() {
        let is_inside =
            ink.left() >= 0.0 && ink.top() >= 0.0 && ink.right() <= size.width() && ink.bottom() <= size.height();
        assert!(is_inside, "{label}: `{words}` leaves the frame: {ink:?} of {size:?}");
        for (others, other) in &texts[at + 1..] {
            assert!(!overlap(*ink, *other), "{label}: `{words}` over `{others}`: {ink:?} {other:?}");
        }
    }
}

#[test]
fn no_text_leaves_the_frame_or_overlaps_another() {
    for count in [1, 2, 8, 20] {
        for length in [4, 17, 40] {
            check_layout(&format!("{count} x {length}"), &cast::made_up(&cast::names(count, length)));
        }
    }
    let paper = cast::paper();
    check_layout("paper", &paper);
    check_layout("one experiment missing", &paper.without(|e, _| e == "E3"));
    for kept in ["E1", "E5"] {
        let two = paper.without(|e, m| e != kept && (e != "E2" || m != "GPT 5.1"));
        check_layout("two experiments, one nearly empty", &two);
    }
    check_layout("a cell missing", &paper.without(|e, m| e == "E4" && m == "GPT 5.1"));
}

/// The smallest text size of a picture, in pt.
fn smallest(svg: &str) -> f64 {
    let size = |svg: &str, name: &str| -> f64 {
        let from = svg.find(&format!(" {name}=\"")).unwrap() + name.len() + 3;
        svg[from..].split('"').next().unwrap().parse().unwrap()
    };
    let document = Document::parse(svg).unwrap();
    let drawn: f64 = document.root_element().attribute("viewBox").unwrap().split(' ').nth(2).unwrap().parse().unwrap();
    let sizes = document.descendants().filter_map(|node| node.attribute("font-size"));
    let smallest = sizes.map(|size| size.trim_end_matches("px").parse::<f64>().unwrap()).fold(f64::MAX, f64::min);
    smallest * size(svg, "width") / drawn * 0.75
}

#[test]
fn text_is_legible_and_in_the_frame_at_every_width() {
    let casts = [("paper", cast::paper()), ("9 x 40", cast::made_up(&cast::names(9, 40)))];
    for (width, px) in [("8cm", 302.36), ("120mm", 453.54), ("9in", 864.0)] {
        for (label, cast) in &casts {
            for name in FigureName::ALL {
                let input = Input { width: Some(width.parse().unwrap()), ..cast.input() };
                let label = format!("{name} {label} {width}");
                let svg = draw(name, &input).unwrap_or_else(|error| panic!("{label}: {error}")).inline_svg();
                check_texts(&label, &svg);
                assert!(svg.contains(&format!("width=\"{px:.2}\"")), "{label}: {}", &svg[..200]);
                assert!(smallest(&svg) >= 5.98, "{label}: {} pt", smallest(&svg));
            }
        }
    }
}

#[test]
fn an_invalid_or_small_width_is_refused_with_the_least_one() {
    for wrong in ["8", "8.5 inches", "0cm", "-9cm", "7.9cm", "2m", "nancm", "51cm"] {
        let fault = wrong.parse::<FigureWidth>().unwrap_err().to_string();
        assert_eq!(
            fault,
            format!("expected a width from 8cm to 50cm such as 8.5cm, 85mm, 3.3in, 240pt or 640px, found `{wrong}`")
        );
    }
    let cast = cast::paper();
    let mut sheets = Input::of_cells(&cast.cells).sheets.clone();
    let all = cast.cells.metrics.iter().cycle().take(14).cloned().collect();
    sheets.get_mut("heatmap").unwrap().metrics = Some(all);
    let input = Input { sheets: &sheets, width: "8cm".parse().ok(), ..cast.input() };
    let told = draw(FigureName::Heatmap, &input).unwrap_err().to_string();
    let least = told.strip_prefix("figure `heatmap` needs ").unwrap().split(" for").next().unwrap();
    let input = Input { width: least.parse().ok(), ..input };
    assert!(draw(FigureName::Heatmap, &input).is_ok(), "{told}");
}

#[test]
fn wide_letters_do_not_leave_the_frame_either() {
    let wide = |i: usize| format!("{}{i:02}{}", "W".repeat(19), "M".repeat(19));
    check_layout("wide", &cast::made_up(&(0..20).map(wide).collect::<Vec<_>>()));
}

/// A figure's marks that represent cells: experiment, model, metric, value, n.
fn marks(svg: &str) -> Vec<BTreeMap<String, String>> {
    let document = Document::parse(svg).unwrap();
    let is_mark = |node: &Node<'_, '_>| node.attribute("class") == Some("mark");
    let data = |node: Node<'_, '_>| -> BTreeMap<String, String> {
        let attributes = node.attributes().filter(|a| a.name().starts_with("data-"));
        attributes.map(|a| (a.name()["data-".len()..].to_owned(), a.value().to_owned())).collect()
    };
    document.descendants().filter(is_mark).map(data).filter(|mark| mark.contains_key("value")).collect()
}

/// The cells: (experiment, model, metric) to n and the full mean, which is empty if undefined.
fn expected(cast: &Cast) -> BTreeMap<(String, String, String), (String, String)> {
    let cells = &cast.cells;
    let of_group = |group: &mirrorstats_score::cells::Group| {
        let key = [0, 1].map(|at| group.key[at].to_string());
        let values = cells.metrics.iter().zip(group.moments.clone());
        let values = values.map(move |(metric, moments)| {
            let mean = moments.mean().map(number::full_precision).unwrap_or_default();
            ((key[0].clone(), key[1].clone(), metric.clone()), (mean, moments.n.to_string()))
        });
        values.collect::<Vec<_>>()
    };
    cells.groups.iter().flat_map(of_group).collect()
}

#[test]
fn the_numbers_in_figures_are_those_of_the_cells() {
    let cast = cast::paper();
    let expected = expected(&cast);
    let profile = ["TSA", "TTD", "MCR", "MTATO", "CAAL", "CR"];
    let shown: [(FigureName, &[&str]); 5] = [
        (FigureName::Spider, &profile),
        (FigureName::Heatmap, &profile),
        (FigureName::Scatter, &["TSA"]),
        (FigureName::Intervals, &["TSA"]),
        (FigureName::Slopes, &["TSA"]),
    ];
    for (name, metrics) in shown {
        let mut seen = BTreeSet::new();
        for mark in marks(&svg(name, &cast)) {
            let key = (mark["experiment"].clone(), mark["model"].clone(), mark["metric"].clone());
            assert_eq!(expected[&key], (mark["value"].clone(), mark["n"].clone()), "{name} {key:?}");
            seen.insert(key);
        }
        let wanted = expected.keys().filter(|key| metrics.contains(&key.2.as_str()));
        assert_eq!(seen, wanted.cloned().collect(), "{name}");
    }
}

#[test]
fn the_completion_gap_is_the_difference_of_two_cells() {
    let cast = cast::paper();
    let expected = expected(&cast);
    let marks = marks(&svg(FigureName::CompletionGap, &cast));
    assert_eq!(marks.len(), 40);
    for mark in marks {
        let mean = |metric: &str| {
            let key = (mark["experiment"].clone(), mark["model"].clone(), metric.to_owned());
            expected[&key].0.parse::<f64>().ok()
        };
        let gap = mean("TSA-C").zip(mean("TSA")).map(|(finished, all)| finished - all);
        assert_eq!(mark["value"].parse().ok(), gap, "{mark:?}");
    }
}

#[test]
fn intervals_are_wilson_intervals() {
    let cast = cast::paper();
    let marks = marks(&svg(FigureName::Intervals, &cast));
    assert_eq!(marks.len(), 40);
    for mark in marks {
        let n: u64 = mark["n"].parse().unwrap();
        let of = |k: &u64| wilson(*k, n, 0.95).unwrap();
        let (low, high): (f64, f64) = (mark["low"].parse().unwrap(), mark["high"].parse().unwrap());
        let k = (0..=n).find(|k| (of(k).low, of(k).high) == (low, high)).expect("the interval of some count");
        let (above, below) = (k.to_string(), n.to_string());
        let mean = above.parse::<f64>().unwrap() / below.parse::<f64>().unwrap();
        assert_eq!(mark["value"], number::full_precision(mean));
    }
}

#[test]
fn outcomes_are_read_back_as_given() {
    let cast = cast::paper();
    let marks = marks(&svg(FigureName::E5Outcomes, &cast));
    for (model, counts) in &cast.outcomes.rows {
        let count = |name: &str| -> u64 {
            let is_it = |mark: &&BTreeMap<_, _>| mark["model"] == *model && mark["metric"] == name;
            marks.iter().find(is_it).unwrap()["value"].parse().unwrap()
        };
        assert_eq!([count("correct"), count("wrong"), count("uncommitted")], *counts);
    }
    assert_eq!(marks.len(), 3 * cast.outcomes.rows.len());
}

#[test]
fn a_decision_curve_counts_decided_episodes() {
    let cast = cast::paper();
    let marks = marks(&svg(FigureName::DecisionCurve, &cast));
    assert_eq!(marks.len(), 40);
    for mark in marks {
        let group =
            cast.cells.groups.iter().find(|group| {
                group.key[0].to_string() == mark["experiment"] && group.key[1].to_string() == mark["model"]
            });
        let finished = group.unwrap().moments[6].n;
        assert_eq!((&mark["decided"], mark["n"].as_str()), (&finished.to_string(), "21"));
        if finished == 21 {
            assert_eq!(mark["value"], "1");
        }
        if finished == 0 {
            assert_eq!((mark["value"].as_str(), mark["median"].as_str()), ("0", ""));
        }
    }
}

#[test]
fn a_forest_has_the_differences_and_verdicts_of_the_statistics() {
    let cast = cast::paper();
    let found = &cast.statistics;
    let marks = marks(&svg(FigureName::Forest, &cast));
    assert_eq!(marks.len(), 28 * 6 + 8 * 3);
    let mut shown = 0;
    for mark in &marks {
        let (first, second) = (mark["model"].as_str(), mark["against"].as_str());
        let is_pair = |a: &str, b: &str| (a, b) == (first, second) || (b, a) == (first, second);
        let (is_turned, difference, interval, is_shown) = if mark["experiment"] == "over all" {
            let row = found.overall.iter().find(|row| is_pair(&row.first, &row.second)).unwrap();
            (row.first != first, row.difference, row.interval, row.separated)
        } else if second.is_empty() {
            let named = |it: &&Contrast| format!("{} − {}", it.baseline, it.against) == mark["experiment"];
            let it = found.conditions.iter().filter(named).find(|it| it.model == first).unwrap();
            (false, it.comparison.difference, it.comparison.interval, it.comparison.separated)
        } else {
            let family = found.models.iter().find(|family| family.experiment == mark["experiment"]).unwrap();
            let test = family.tests.iter().find(|test| is_pair(&test.first, &test.second)).unwrap();
            let it = &test.comparison;
            (test.first != first, it.difference, it.interval, it.separated)
        };
        let turned = |value: f64| if is_turned { 0.0 - value } else { value };
        let ends = interval.map(|it| if is_turned { [it.high, it.low] } else { [it.low, it.high] });
        let [value, low, high] = ["value", "low", "high"].map(|name| mark[name].parse().ok());
        assert_eq!(value, difference.map(turned), "{mark:?}");
        assert_eq!([low, high], [0, 1].map(|end| ends.map(|ends| turned(ends[end]))), "{mark:?}");
        assert_eq!(mark["verdict"] == "shown", is_shown, "{mark:?}");
        shown += usize::from(is_shown);
    }
    assert!(shown > 0 && shown < marks.len(), "{shown}");
}

#[test]
fn many_models_are_each_compared_with_the_best_one() {
    let cast = cast::made_up(&cast::names(20, 17));
    let firsts: BTreeSet<String> = marks(&svg(FigureName::Forest, &cast))
        .into_iter()
        .filter(|mark| !mark["against"].is_empty())
        .map(|mark| mark["model"].clone())
        .collect();
    assert_eq!(firsts.len(), 1);
}

#[test]
fn every_episode_has_its_row_in_the_raster() {
    let cast = cast::paper();
    let svg = svg(FigureName::Gaze, &cast);
    let document = Document::parse(&svg).unwrap();
    let rows = document.descendants().filter(|node| node.has_attribute("data-episode"));
    let shown: BTreeSet<_> = rows
        .map(|row| {
            ["episode", "length", "decision"]
                .map(|name| row.attribute(format!("data-{name}").as_str()).unwrap().to_owned())
        })
        .collect();
    let given = cast.timelines.iter().map(|t| {
        [t.key.episode_id.clone(), t.length.to_string(), t.decision.map(|step| step.to_string()).unwrap_or_default()]
    });
    assert_eq!(shown, given.collect());
}

#[test]
fn undefined_and_empty_cells_are_shown_as_such() {
    let cast = cast::paper().without(|e, m| e == "E4" && m == "GPT 5.1");
    let svg = svg(FigureName::Heatmap, &cast);
    let document = Document::parse(&svg).unwrap();
    let find = |experiment: &str, model: &str, metric: &str| {
        let is_it = |node: &Node<'_, '_>| {
            node.attribute("data-experiment") == Some(experiment)
                && node.attribute("data-model") == Some(model)
                && node.attribute("data-metric") == Some(metric)
        };
        document.descendants().find(is_it).unwrap()
    };
    let words = |node: Node<'_, '_>| -> String {
        node.children().filter(|child| child.has_tag_name("text")).filter_map(|child| child.text()).collect()
    };
    let empty = find("E4", "GPT 5.1", "TSA");
    assert_eq!((empty.attribute("data-value"), words(empty).as_str()), (Some(""), ""));
    assert!(empty.children().any(|child| child.text().is_some_and(|text| text.contains("no episodes"))));
    let undefined = cast.cells.groups.iter().find(|group| group.moments[3].n == 0).expect("a model without success");
    let undefined = find(&undefined.key[0].to_string(), &undefined.key[1].to_string(), "MTATO");
    assert_eq!((undefined.attribute("data-value"), words(undefined).as_str()), (Some(""), "--"));
}

#[test]
fn experiments_with_a_chance_level_have_a_chance_marker() {
    let svg = svg(FigureName::Spider, &cast::paper());
    let document = Document::parse(&svg).unwrap();
    let marked: Vec<_> = document
        .descendants()
        .filter(|n| n.has_attribute("data-chance"))
        .filter_map(|n| n.attribute("data-experiment"))
        .collect();
    assert_eq!(marked, ["E1", "E2", "E3", "E4"]);
}

#[test]
fn a_model_keeps_its_colour_in_every_figure() {
    let cast = cast::made_up(&cast::names(20, 17));
    let mut colors: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for name in [FigureName::Spider, FigureName::Scatter, FigureName::Intervals, FigureName::Slopes] {
        let svg = svg(name, &cast);
        let document = Document::parse(&svg).unwrap();
        for mark in document.descendants().filter(|node| node.has_attribute("data-model")) {
            let is_shape = |child: &Node<'_, '_>| child.has_attribute("fill") && !child.has_tag_name("text");
            let shape = mark.children().rfind(is_shape);
            let Some(shape) = shape else { continue };
            let paint = if shape.attribute("fill") == Some("#ffffff") { "stroke" } else { "fill" };
            let color = shape.attribute(paint).unwrap_or_default().to_owned();
            colors.entry(mark.attribute("data-model").unwrap().to_owned()).or_default().insert(color);
        }
    }
    assert_eq!(colors.len(), 20);
    assert!(colors.values().all(|found| found.len() == 1), "{colors:?}");
}

#[test]
fn names_from_traces_inject_nothing() {
    let hostile = [
        "</text></svg><script>alert(1)</script>",
        "\" onload=\"alert(1)",
        "' onclick='alert(1)",
        "]]><!--",
        "&lt;b&gt;&#x3c;",
        "bell\u{7}null\u{0}escape\u{1b}",
        "模型甲",
        "模型乙",
        "🪞",
        "a\nb\tc",
    ];
    let names: Vec<String> = hostile.map(str::to_owned).into();
    let cast = cast::made_up(&names);
    check_layout("hostile", &cast);
    for name in FigureName::ALL {
        let svg = draw(name, &cast.input()).unwrap().svg();
        let document = Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        let elements: BTreeSet<_> =
            document.descendants().filter(Node::is_element).map(|n| n.tag_name().name()).collect();
        let known = ["svg", "title", "desc", "style", "g", "rect", "path", "circle", "text"];
        assert!(elements.iter().all(|element| known.contains(element)), "{name}: {elements:?}");
        let has_handler = document.descendants().flat_map(|n| n.attributes()).any(|a| a.name().starts_with("on"));
        assert!(!has_handler, "{name}");
        let models: BTreeSet<_> = document.descendants().filter_map(|n| n.attribute("data-model")).collect();
        for model in &hostile[..5] {
            assert!(models.contains(model), "{name}: {model}");
        }
    }
}

#[test]
fn every_format_has_the_same_bytes_on_every_run() {
    let cast = cast::paper();
    for name in FigureName::ALL {
        let [first, second] = [(); 2].map(|()| draw(name, &cast.input()).unwrap());
        assert_eq!(first.svg(), second.svg(), "{name}");
        for format in [FigureFormat::Png, FigureFormat::Pdf] {
            assert!(format.encode(&first).unwrap() == format.encode(&second).unwrap(), "{name}: {format:?}");
        }
    }
}

#[test]
fn a_pdf_has_no_date_and_a_figure_no_path() {
    let figure = draw(FigureName::Intervals, &cast::paper().input()).unwrap();
    let pdf = FigureFormat::Pdf.encode(&figure).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    for forbidden in ["CreationDate", "ModDate"] {
        assert!(!pdf.windows(forbidden.len()).any(|window| window == forbidden.as_bytes()), "{forbidden}");
    }
    assert!(!figure.svg().contains(env!("CARGO_MANIFEST_DIR")));
}

#[test]
fn the_order_of_groups_does_not_matter() {
    let cast = cast::paper();
    let mut shuffled = cast.clone();
    shuffled.cells.groups.reverse();
    shuffled.timelines.reverse();
    for name in FigureName::ALL {
        assert_eq!(svg(name, &cast), svg(name, &shuffled), "{name}");
    }
}

#[test]
fn figures_that_cannot_be_drawn_have_a_reason() {
    let check = |found: Result<_, FigureError>, expected: &str| {
        assert_eq!(found.map(|_: mirrorstats_figures::Figure| ()).unwrap_err().to_string(), expected);
    };
    let cast = cast::paper();
    let bare = Input::of_cells(&cast.cells);
    check(
        draw(FigureName::Gaze, &bare),
        "figure `gaze` needs the steps of each episode; draw it from traces that have such episodes, not from scores alone",
    );
    let mut by_seed = cast.cells.clone();
    by_seed.by.push("seed".to_owned());
    check(
        draw(FigureName::Heatmap, &Input::of_cells(&by_seed)),
        "figures need cells by experiment and model, found cells by `experiment,model,seed`; leave out `--by`",
    );
    let mut poor = cast.cells.clone();
    poor.metrics = vec!["TSA".to_owned()];
    check(
        draw(FigureName::CompletionGap, &Input::of_cells(&poor)),
        "figure `completion-gap` shows a rate that `completes` another one, found TSA; name them under \
         `[figure.completion-gap]` in the style, or declare them in the definitions",
    );
    let alone = cast.without(|e, m| e != "E5" || m != "GPT 5.1");
    check(
        draw(FigureName::Forest, &alone.input()),
        "figure `forest` needs two models or two experiments with `TSA`, found GPT 5.1 and E5",
    );
    let single = cast.without(|e, _| e != "E5");
    check(
        draw(FigureName::Slopes, &single.input()),
        "figure `slopes` needs two experiments or more, found E5; add traces of another one",
    );
    let unknown = "spyder".parse::<FigureName>().unwrap_err().to_string();
    assert!(unknown.ends_with("found `spyder`; did you mean `spider`?"), "{unknown}");
}
