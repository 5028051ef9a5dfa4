//! Missing values, with the reason: no episodes, or an undefined metric.

use crate::Scene;
use crate::kit::{Member, Point, Sheet, Swatch, leading, lettering, marker};
use crate::matrix::{MetricId, Reading, Value};

const MARKER_ROOM: f64 = 10.0;
const RUN_GAP: f64 = 8.0;

/// The models that a panel cannot show: words and markers in lines, positioned from the top left corner.
#[derive(Clone, Debug)]
pub(crate) struct Strip<'a> {
    words: Vec<(Point, String)>,
    markers: Vec<(Point, Absent<'a>)>,
    /// The height of the lines, px; 0 if no model is absent.
    pub height: f64,
}

/// A model and its missing value.
type Absent<'a> = (Member<'a>, Reading<'a>);

impl<'a> Strip<'a> {
    /// The strips of all experiments, and the height of the highest.
    pub(crate) fn of_experiments(scene: Scene<'a>, metrics: &[MetricId<'a>], width: f64) -> (Vec<Self>, f64) {
        let strips = scene.matrix.experiments.iter().map(|e| Self::new(scene, e, metrics, width));
        let strips: Vec<Self> = strips.collect();
        let height = strips.iter().map(|strip| strip.height).fold(0.0, f64::max);
        (strips, height)
    }

    /// The models without a mean of one of `metrics` in `experiment`, in lines of `width` px.
    pub(crate) fn new(scene: Scene<'a>, experiment: &'a str, metrics: &[MetricId<'a>], width: f64) -> Self {
        let mut strip = Self { words: Vec::new(), markers: Vec::new(), height: 0.0 };
        let line = leading(lettering::tick());
        let (mut x, mut y) = (0.0, line / 2.0);
        for (word, absent) in runs(scene, experiment, metrics) {
            let word_width = lettering::tick().width(&word) + 3.0;
            if x > 0.0 && x + word_width + MARKER_ROOM > width {
                (x, y) = (0.0, y + line);
            }
            strip.words.push(((x, y), word));
            x += word_width;
            for absent in absent {
                if x + MARKER_ROOM > width {
                    (x, y) = (0.0, y + line);
                }
                strip.markers.push(((x + MARKER_ROOM / 2.0, y), absent));
                x += MARKER_ROOM;
            }
            x += RUN_GAP;
            strip.height = y + line / 2.0;
        }
        strip
    }

    pub(crate) fn draw(&self, sheet: &mut Sheet, corner: Point) {
        for ((x, y), word) in &self.words {
            sheet.text((corner.0 + x, corner.1 + y), word, lettering::tick());
        }
        for ((x, y), (member, reading)) in &self.markers {
            let place = (corner.0 + x, corner.1 + y);
            sheet.mark(&reading.mark(), |sheet| marker::draw(sheet, place, 2.8, member.style));
        }
    }
}

/// The signs of undefined and of empty cells in a heat map.
pub(crate) const TILES: [(Swatch, &str); 2] = [(Swatch::Undefined, "undefined"), (Swatch::Empty, "no episodes")];

/// Those of the signs, of undefined and of empty cells, that `readings` need.
pub(crate) fn signs<'a>(
    readings: impl Iterator<Item = Reading<'a>>,
    [undefined, empty]: [(Swatch, &str); 2],
) -> Vec<(Swatch, String)> {
    let (mut has_undefined, mut has_empty) = (false, false);
    for reading in readings {
        has_undefined |= matches!(reading.value, Value::Undefined(_));
        has_empty |= reading.value == Value::Empty;
    }
    let seen = [has_undefined.then_some(undefined), has_empty.then_some(empty)].into_iter().flatten();
    seen.map(|(swatch, text)| (swatch, text.to_owned())).collect()
}

pub(crate) fn strip_signs(strips: &[Strip<'_>]) -> Option<(Swatch, String)> {
    let has_any = strips.iter().any(|strip| strip.height > 0.0);
    has_any.then(|| (Swatch::None, "--: undefined".to_owned()))
}

fn runs<'a>(scene: Scene<'a>, experiment: &'a str, metrics: &[MetricId<'a>]) -> Vec<(String, Vec<Absent<'a>>)> {
    let absent = |metric: MetricId<'a>, is_absent: fn(Value) -> bool| -> Vec<Absent<'a>> {
        let read = |member: &Member<'a>| (*member, scene.matrix.reading(experiment, member.model, metric));
        scene.roster.0.iter().map(read).filter(|(_, reading)| is_absent(reading.value)).collect()
    };
    let is_empty = |value| value == Value::Empty;
    let is_undefined = |value| matches!(value, Value::Undefined(_));
    let without_episodes = metrics.first().map(|&metric| ("no episodes:".to_owned(), absent(metric, is_empty)));
    let without_value = metrics.iter().map(|&metric| (format!("{} --", metric.name), absent(metric, is_undefined)));
    without_episodes.into_iter().chain(without_value).filter(|(_, absent)| !absent.is_empty()).collect()
}
