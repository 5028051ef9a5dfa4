use crate::episodes::episode::{Action, Episode};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Moment {
    FirstSight,
    FirstClaim,
    Decision,
}

impl Moment {
    pub const fn title(self) -> &'static str {
        match self {
            Self::FirstSight => "first sight",
            Self::FirstClaim => "first claim",
            Self::Decision => "decision",
        }
    }
}

/// The moments of an episode with their t, in order; moments that do not occur are left out.
pub fn moments(episode: &Episode) -> Vec<(i32, Moment)> {
    let first = |holds: &dyn Fn(usize) -> bool| (0..episode.steps.len()).find(|at| holds(*at));
    let claims = |at: usize| episode.steps[at].self_color.as_deref().is_some_and(|color| color != "unknown");
    let found = [
        (first(&|at| episode.steps[at].mirror_visible), Moment::FirstSight),
        (first(&claims), Moment::FirstClaim),
        (first(&|at| episode.steps[at].action == Some(Action::Done)), Moment::Decision),
    ];
    let mut moments: Vec<_> =
        found.into_iter().filter_map(|(at, moment)| Some((i32::try_from(at? + 1).ok()?, moment))).collect();
    moments.sort_unstable();
    moments
}

/// Up to `count` key steps: the first, the last, the moments, and others spread evenly between them.
pub fn chosen(episode: &Episode, count: usize) -> Vec<i32> {
    let last = i32::try_from(episode.steps.len()).unwrap_or(i32::MAX);
    let mut chosen: Vec<i32> = moments(episode).into_iter().map(|(t, _)| t).collect();
    chosen.extend([last, 1]);
    let mut kept = Vec::new();
    for t in chosen {
        if !kept.contains(&t) && kept.len() < count.max(1) {
            kept.push(t);
        }
    }
    kept.sort_unstable();
    // Splits the widest gap in the middle, repeatedly.
    while kept.len() < count {
        let gap = kept.windows(2).max_by_key(|pair| (pair[1] - pair[0], -pair[0]));
        match gap {
            Some(&[from, to]) if to - from > 1 => kept.push(from + (to - from) / 2),
            _ => break,
        }
        kept.sort_unstable();
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::{Moment, chosen, moments};
    use crate::episodes::episode::{Action, Episode, Step};

    fn episode(length: usize, sight: usize, claim: usize) -> Episode {
        let mut steps = vec![Step { self_color: Some("unknown".into()), ..Step::default() }; length];
        steps[sight - 1].mirror_visible = true;
        steps[claim - 1].self_color = Some("red".into());
        steps[length - 1].action = Some(Action::Done);
        let text = String::new;
        Episode {
            episode_id: text(),
            model: text(),
            experiment: text(),
            seed: 1,
            run: 1,
            body_color: text(),
            steps,
            ..Episode::default()
        }
    }

    #[test]
    fn moments_are_listed_in_order() {
        let found = moments(&episode(30, 12, 7));
        assert_eq!(found, [(7, Moment::FirstClaim), (12, Moment::FirstSight), (30, Moment::Decision)]);
    }

    #[test]
    fn moments_come_first_and_gaps_are_filled() {
        assert_eq!(chosen(&episode(30, 12, 7), 5), [1, 7, 12, 21, 30]);
        assert_eq!(chosen(&episode(30, 12, 7), 3), [7, 12, 30]);
        assert_eq!(chosen(&episode(1, 1, 1), 6), [1]);
        assert_eq!(chosen(&episode(3, 1, 2), 9), [1, 2, 3]);
    }
}
