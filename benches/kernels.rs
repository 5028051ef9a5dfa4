//! The kernels alone, on one batch in memory: `cargo bench --bench kernels`.
//!
//! The batch has about twice the steps that a scan delivers at a time. Most definitions here are mainly one kernel.

use std::hint::black_box;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, DictionaryArray, Int64Array, RecordBatch};
use arrow::datatypes::Int32Type;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::kernels::evaluate::Batch;
use mirrorstats_score::kernels::segments::Segments;
use mirrorstats_score::physical::PhysicalPlan;
use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::table::Header;
use mirrorstats_score::vocabulary::schema_columns;
use mirrorstats_trace::scan::Texts;

const STEPS: usize = 64 * 1024;
const LENGTH: usize = 70;

/// Definitions of one kernel each, except the last ones.
const EXPRESSIONS: [(&str, &str); 8] = [
    ("text equals constant, first", "first(action = 'done')"),
    ("text equals text, any", "any(self_color = body_color)"),
    ("truth, count", "count(mirror_visible)"),
    ("window, any", "any(mirror_visible and t < 40)"),
    ("lookup", "at(self_color, 7) = 'red'"),
    ("numbers, max", "max(mirror_self_px)"),
    ("numbers, sum of a case", "sum(case when mirror_visible then mirror_self_px else 0 end)"),
    ("pattern", "count(regexp_like(self_color, '^b'))"),
];

/// Columns of steps and episodes, and the start of each episode.
struct Sample {
    offsets: Vec<usize>,
    steps: RecordBatch,
    texts: Vec<Texts>,
    episodes: RecordBatch,
}

impl Sample {
    fn new() -> Self {
        let offsets: Vec<usize> = (0..STEPS).step_by(LENGTH).chain([STEPS]).collect();
        let episodes = offsets.len() - 1;
        let texts = |count: usize, of: &dyn Fn(usize) -> Option<String>| {
            let texts: Vec<Option<String>> = (0..count).map(of).collect();
            Arc::new(texts.iter().map(Option::as_deref).collect::<DictionaryArray<Int32Type>>()) as ArrayRef
        };
        let one = |of: &[&str], at: usize| Some(of[at % of.len()].to_owned());
        let numbers = |count: usize, of: &dyn Fn(usize) -> i64| Arc::new((0..count).map(of).collect::<Int64Array>());
        let colors = ["unknown", "red", "blue", "green"];
        let bytes = |name: &str, known: &[&str], of: &dyn Fn(usize) -> usize| Texts {
            name: name.to_owned(),
            keys: (0..STEPS).map(|at| u8::try_from(of(at) % known.len()).ok()).collect(),
            texts: known.iter().map(|text| Some(*text)).collect(),
        };
        let byte_texts = vec![
            bytes("action", &["move_forward", "turn_left", "done"], &mixed),
            bytes("self_color", &colors, &|at| at / 9),
            bytes("selected_cube", &["none", "red", "blue"], &|at| at / 11),
        ];
        let steps = RecordBatch::try_from_iter_with_nullable([
            (
                "mirror_visible",
                Arc::new((0..STEPS).map(|at| Some(at / 5 % 3 == 0)).collect::<BooleanArray>()) as _,
                false,
            ),
            ("mirror_self_px", numbers(STEPS, &|at| i64::try_from(mixed(at) % 900).unwrap()) as _, true),
        ]);
        let constants = RecordBatch::try_from_iter_with_nullable([
            ("episode_id", texts(episodes, &|at| Some(format!("episode-{:06}", mixed(at)))), false),
            ("model", texts(episodes, &|at| one(&["one", "other"], at)), false),
            ("experiment", texts(episodes, &|at| one(&["E1", "E2", "E5"], at)), false),
            ("seed", numbers(episodes, &|at| i64::try_from(at % 3).unwrap()) as _, false),
            ("run", numbers(episodes, &|at| i64::try_from(at % 7).unwrap()) as _, false),
            ("body_color", texts(episodes, &|at| one(&colors[1..], at)), false),
        ]);
        Self { offsets, steps: steps.unwrap(), texts: byte_texts, episodes: constants.unwrap() }
    }

    fn batch(&self) -> Batch<'_> {
        Batch {
            segments: Segments::new(&self.offsets),
            steps: &self.steps,
            texts: &self.texts,
            episodes: &self.episodes,
        }
    }
}

/// Pseudo-random numbers.
fn mixed(at: usize) -> usize {
    at.wrapping_mul(0x9E37_79B1) >> 7 & 0xF_FFFF
}

fn definitions(expression: &str) -> Definitions {
    let toml = format!("[metric.M]\nvalue = \"{expression}\"\n");
    Definitions::from_toml("bench", &toml, &schema_columns()).unwrap()
}

fn kernels(criterion: &mut Criterion) {
    let sample = Sample::new();
    let mut group = criterion.benchmark_group("kernels");
    group.throughput(Throughput::Elements(STEPS as u64));
    let mut bench = |name: &str, definitions: &Definitions| {
        let plan = PhysicalPlan::of(&[&definitions.plan]);
        let score = || plan.evaluate(black_box(&sample.batch())).unwrap().scores(&plan.scores[0]).unwrap();
        group.bench_function(name, |bencher| bencher.iter(score));
    };
    for (name, expression) in EXPRESSIONS {
        bench(name, &definitions(expression));
    }
    bench("the paper's ten metrics", &Definitions::load("paper", &schema_columns()).unwrap());
    group.finish();
}

fn table(criterion: &mut Criterion) {
    let sample = Sample::new();
    let definitions = Definitions::load("paper", &schema_columns()).unwrap();
    let plan = PhysicalPlan::of(&[&definitions.plan]);
    let scores = plan.evaluate(&sample.batch()).unwrap().scores(&plan.scores[0]).unwrap();
    let metrics = definitions.plan.outputs.iter().map(|output| output.name.clone()).collect();
    let header = Header { catalog: definitions.catalog.clone(), labels: Vec::new(), metrics };
    let mut group = criterion.benchmark_group("table");
    group.throughput(Throughput::Elements(sample.episodes.num_rows() as u64));
    group.bench_function("gathered and ordered", |bencher| {
        bencher.iter(|| {
            let mut builder = TableBuilder::new(header.clone());
            builder.extend(black_box(&sample.episodes), &scores.metrics);
            builder.finish()
        });
    });
    group.finish();
}

fn quick() -> Criterion {
    Criterion::default().sample_size(20).without_plots()
}

criterion_group! { name = all; config = quick(); targets = kernels, table }
criterion_main!(all);
