//! Missing values, with the reason: no episodes, or an undefined metric.

use super::kit::{Member, Point, Roster, Sheet, Swatch, leading, lettering, marker};
use super::matrix::{Matrix, MetricId, Reading};

const MARKER_ROOM: f64 = 10.0;
const RUN_GAP: f64 = 8.0;

/// The models that a panel cannot show: words and markers in lines, positioned from the top left corner.
#[derive(Clone, Debug)]
pub(crate) struct Strip<'a> {
    experiment: &'a str,
    words: Vec<(Point, String)>,
    markers: Vec<(Point, Absent<'a>)>,
    /// The height of the lines, px; 0 if no model is absent.
    pub height: f64,
}

#[derive(Clone, Copy, Debug)]
struct Absent<'a> {
    member: Member<'a>,
    metric: &'a str,
    reading: Reading,
}

impl<'a> Strip<'a> {
    /// The models of `roster` without a mean of one of `metrics` in `experiment`, in lines of `width` px.
    pub(crate) fn new(
        matrix: &Matrix<'_>,
        roster: &Roster<'a>,
        experiment: &'a str,
        metrics: &[MetricId<'a>],
        width: f64,
    ) -> Self {
        let mut strip = Self { experiment, words: Vec::new(), markers: Vec::new(), height: 0.0 };
        let mut place = (0.0, leading(lettering::tick()) / 2.0);
        for (word, absent) in runs(matrix, roster, experiment, metrics) {
            strip.run(&mut place, width, word, absent);
        }
        if !strip.words.is_empty() {
            strip.height = place.1 + leading(lettering::tick()) / 2.0;
        }
        strip
    }

    pub(crate) fn draw(&self, sheet: &mut Sheet, corner: Point) {
        for ((x, y), word) in &self.words {
            sheet.text((corner.0 + x, corner.1 + y), word, lettering::tick());
        }
        for ((x, y), absent) in &self.markers {
            let mark = absent.reading.mark(self.experiment, absent.member.model, absent.metric);
            sheet.mark(&mark, |sheet| marker::draw(sheet, (corner.0 + x, corner.1 + y), 2.8, absent.member.style));
        }
    }

    fn run(&mut self, place: &mut Point, width: f64, word: String, absent: Vec<Absent<'a>>) {
        let line = leading(lettering::tick());
        let word_width = lettering::tick().width(&word) + 3.0;
        let fresh = place.0 == 0.0;
        if !fresh && place.0 + word_width + MARKER_ROOM > width {
            *place = (0.0, place.1 + line);
        }
        self.words.push((*place, word));
        place.0 += word_width;
        for absent in absent {
            if place.0 + MARKER_ROOM > width {
                *place = (0.0, place.1 + line);
            }
            self.markers.push(((place.0 + MARKER_ROOM / 2.0, place.1), absent));
            place.0 += MARKER_ROOM;
        }
        place.0 += RUN_GAP;
    }
}

pub(crate) fn signs(readings: impl Iterator<Item = Reading>) -> Vec<(Swatch, String)> {
    let mut signs = [(Swatch::Undefined, "undefined", false), (Swatch::Empty, "no episodes", false)];
    for reading in readings {
        signs[0].2 |= matches!(reading, Reading::Undefined(_));
        signs[1].2 |= matches!(reading, Reading::Empty);
    }
    let seen = signs.into_iter().filter(|(.., is_seen)| *is_seen);
    seen.map(|(swatch, text, _)| (swatch, text.to_owned())).collect()
}

pub(crate) fn strip_signs(strips: &[Strip<'_>]) -> Option<(Swatch, String)> {
    let has_any = strips.iter().any(|strip| strip.height > 0.0);
    has_any.then(|| (Swatch::None, "--: undefined".to_owned()))
}

fn runs<'a>(
    matrix: &Matrix<'_>,
    roster: &Roster<'a>,
    experiment: &str,
    metrics: &[MetricId<'a>],
) -> Vec<(String, Vec<Absent<'a>>)> {
    let absent = |metric: MetricId<'a>, is_absent: fn(Reading) -> bool| -> Vec<Absent<'a>> {
        let read = |member: &Member<'a>| Absent {
            member: *member,
            metric: metric.name,
            reading: matrix.reading(experiment, member.model, metric),
        };
        roster.0.iter().map(read).filter(|absent| is_absent(absent.reading)).collect()
    };
    let is_empty = |reading| matches!(reading, Reading::Empty);
    let is_undefined = |reading| matches!(reading, Reading::Undefined(_));
    let without_episodes = metrics.first().map(|&metric| ("no episodes:".to_owned(), absent(metric, is_empty)));
    let without_value = metrics.iter().map(|&metric| (format!("{} --", metric.name), absent(metric, is_undefined)));
    without_episodes.into_iter().chain(without_value).filter(|(_, absent)| !absent.is_empty()).collect()
}
