//! Names in limited room: shortened in the middle if necessary, and never to the same text twice.

use std::collections::BTreeSet;

use super::lettering::{Lettering, drawable};

const ELLIPSIS: &str = "…";
/// The most letters of a name that are used: half from its beginning, half from its end.
const MOST_LETTERS: usize = 160;

/// The shown form of each name within `room` px; distinct names have distinct forms.
///
/// All names that are too long are cut at the same distance from their end, near the middle if that makes them
/// distinct, so that the differing part remains. If no distance does, because names differ in too many places or only
/// in undrawable characters, a number follows.
pub(crate) fn fitted(names: &[&str], room: f64, lettering: Lettering) -> Vec<String> {
    let whole: Vec<String> = names.iter().map(|name| ends(&drawable(name))).collect();
    let tails = tails(&whole, room, lettering);
    let shown = |tail: usize| -> Vec<String> { whole.iter().map(|name| elided(name, tail, room, lettering)).collect() };
    let all_differ = |labels: &Vec<String>| labels.iter().collect::<BTreeSet<_>>().len() == labels.len();
    let middle = tails.first().copied().unwrap_or(0);
    tails.iter().map(|&tail| shown(tail)).find(all_differ).unwrap_or_else(|| numbered(shown(middle), room, lettering))
}

pub(crate) fn cut(text: &str, room: f64, lettering: Lettering) -> String {
    let text = drawable(text);
    if lettering.width(&text) <= room {
        return text;
    }
    match within(text.chars(), room - lettering.width(ELLIPSIS), lettering) {
        0 => String::new(),
        kept => format!("{}{ELLIPSIS}", text.chars().take(kept).collect::<String>().trim_end()),
    }
}

fn within(letters: impl Iterator<Item = char>, room: f64, lettering: Lettering) -> usize {
    let mut taken = 0.0;
    let fits = |letter: &char| {
        taken += lettering.width(letter.encode_utf8(&mut [0; 4]));
        taken <= room
    };
    letters.take_while(fits).count()
}

/// `text` in lines of at most `room` px, broken at spaces; a longer word is cut.
pub fn wrapped(text: &str, room: f64, lettering: Lettering) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in drawable(text).split(' ') {
        let word = cut(word, room, lettering);
        match lines.last_mut() {
            Some(line) if lettering.width(&format!("{line} {word}")) <= room => {
                line.push(' ');
                line.push_str(&word);
            }
            _ => lines.push(word),
        }
    }
    lines
}

fn tails(names: &[String], room: f64, lettering: Lettering) -> Vec<usize> {
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    let fits = |tail: &usize| names.iter().all(|name| lettering.width(&elided(name, *tail, room, lettering)) <= room);
    let half = (0..=longest).rev().find(fits).unwrap_or(0) / 2;
    let outward = (0..=longest).flat_map(|away| [half.checked_add(away), half.checked_sub(away)]);
    outward.flatten().filter(fits).collect()
}

/// `name` if it fits, else the beginning that fits, an ellipsis and its last `tail` letters.
fn elided(name: &str, tail: usize, room: f64, lettering: Lettering) -> String {
    if lettering.width(name) <= room {
        return name.to_owned();
    }
    let letters: Vec<char> = name.chars().collect();
    let end: String = letters[letters.len().saturating_sub(tail)..].iter().collect();
    let taken = lettering.width(&format!("{ELLIPSIS}{}", end.trim_start()));
    let most = letters.len().saturating_sub(tail + 1);
    let head = within(letters[..most].iter().copied(), room - taken, lettering);
    let head: String = letters[..head].iter().collect();
    format!("{}{ELLIPSIS}{}", head.trim_end(), end.trim_start())
}

fn ends(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= MOST_LETTERS {
        return name.to_owned();
    }
    let (head, tail) = (&letters[..MOST_LETTERS / 2], &letters[letters.len() - MOST_LETTERS / 2..]);
    head.iter().chain(tail).collect()
}

fn numbered(labels: Vec<String>, room: f64, lettering: Lettering) -> Vec<String> {
    let mut shown: Vec<String> = Vec::with_capacity(labels.len());
    for label in labels {
        let with_number = |number: usize| {
            let suffix = format!(" ({number})");
            format!("{}{suffix}", cut(&label, room - lettering.width(&suffix), lettering))
        };
        // One more number than labels: at least one is free.
        let numbers = (2..shown.len() + 3).map(with_number);
        let free = std::iter::once(label.clone()).chain(numbers).find(|text| !shown.contains(text));
        shown.push(free.unwrap_or_else(|| label.clone()));
    }
    shown
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::{cut, fitted, wrapped};
    use crate::kit::{Lettering, Rgb};

    const LETTERING: Lettering = Lettering::new(10.0, Rgb(0, 0, 0));

    fn check(names: &[String], room: f64) {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let shown = fitted(&names, room, LETTERING);
        let distinct: HashSet<_> = shown.iter().collect();
        assert_eq!(distinct.len(), names.len(), "{shown:?}");
        for label in &shown {
            assert!(LETTERING.width(label) <= room, "{label}");
        }
    }

    #[test]
    fn names_that_fit_are_left_alone() {
        assert_eq!(fitted(&["GPT 5.1", "Gemini 2.5 Pro"], 100.0, LETTERING), ["GPT 5.1", "Gemini 2.5 Pro"]);
    }

    #[test]
    fn shortened_names_fit_and_stay_distinct() {
        let middle = |i: usize| format!("vendor/model-{i:02}-instruct-of-forty-letters");
        check(&(0..20).map(middle).collect::<Vec<_>>(), 90.0);
        let end = |i: usize| format!("a-name-that-is-the-same-but-at-the-end-{i}");
        check(&(0..20).map(end).collect::<Vec<_>>(), 60.0);
        let unseen = |i: u32| char::from_u32(0x4e00 + i).unwrap().to_string().repeat(40);
        check(&(0..20).map(unseen).collect::<Vec<_>>(), 80.0);
    }

    #[test]
    fn huge_names_are_shortened() {
        let endless = |i: usize| format!("{}{i}{}", "x".repeat(50_000), "y".repeat(50_000));
        check(&(0..20).map(endless).collect::<Vec<_>>(), 120.0);
        assert!(cut(&endless(1), 120.0, LETTERING).chars().count() < 60);
    }

    #[test]
    fn shortened_names_keep_their_differences() {
        let names = ["vendor/model-of-many-sizes-07b-instruct", "vendor/model-of-many-sizes-70b-instruct"];
        let shown = fitted(&names, 120.0, LETTERING);
        assert!(shown[0].contains("07b") && shown[1].contains("70b"), "{shown:?}");
    }

    #[test]
    fn text_is_cut_and_wrapped_within_its_room() {
        let text = "Self-identification without perceptual evidence";
        assert!(LETTERING.width(&cut(text, 80.0, LETTERING)) <= 80.0);
        let lines = wrapped(text, 80.0, LETTERING);
        assert_eq!(lines.join(" "), text);
        assert!(lines.iter().all(|line| LETTERING.width(line) <= 80.0));
    }
}
