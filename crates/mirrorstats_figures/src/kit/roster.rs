//! The models of a report, in the order of every figure, each with the same style in all figures.

use super::palette::{ModelStyle, PALETTE};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Member<'a> {
    pub model: &'a str,
    pub style: &'static ModelStyle,
}

#[derive(Clone, Debug)]
pub(crate) struct Roster<'a>(pub Vec<Member<'a>>);

impl<'a> Roster<'a> {
    /// `models` with their styles: those of `order` first, in that order, then pinned ones, then by name.
    ///
    /// The style of a pinned model never changes. The others get, by name, the styles after the pinned ones, then
    /// unused pinned styles; styles repeat from the 21st model on.
    pub(crate) fn new(models: &[&'a str], order: &[String]) -> Self {
        let (pinned, mut models) = (&PALETTE.pinned, models.to_vec());
        models.sort_unstable();
        let is_free = |style: &usize| !models.contains(&pinned[*style].as_str());
        let mut free = (pinned.len()..PALETTE.style.len()).chain((0..pinned.len()).filter(is_free)).cycle();
        let member = |model: &&'a str| {
            let style = pinned.iter().position(|known| known == model).or_else(|| free.next()).unwrap_or(0);
            Member { model, style: &PALETTE.style[style] }
        };
        let mut members: Vec<Member<'a>> = models.iter().map(member).collect();
        members.sort_by_key(|member| (place(order, member.model), place(pinned, member.model)));
        Self(members)
    }

    pub(crate) fn names(&self) -> Vec<&'a str> {
        self.0.iter().map(|member| member.model).collect()
    }
}

fn place(names: &[String], name: &str) -> usize {
    names.iter().position(|known| known == name).unwrap_or(names.len())
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::Roster;
    use crate::kit::palette::PALETTE;

    #[test]
    fn a_pinned_model_keeps_its_style_beside_any_others() {
        let style = |models: &[&str]| {
            let roster = Roster::new(models, &[]);
            roster.0.iter().find(|member| member.model == "GPT 5.1").map(|m| (m.style.color, m.style.marker))
        };
        assert_eq!(style(&["GPT 5.1"]), style(&["A", "GPT 5.1", "Gemma4 26B", "Z"]));
    }

    #[test]
    fn twenty_models_have_twenty_styles_with_or_without_pinned_ones() {
        for pinned in [0, 3, 8] {
            let strangers: Vec<String> = (pinned..20).map(|i| format!("model {i:02}")).collect();
            let known = PALETTE.pinned.iter().take(pinned);
            let models: Vec<&str> = strangers.iter().chain(known).map(String::as_str).collect();
            let roster = Roster::new(&models, &[]);
            let styles: HashSet<_> = roster.0.iter().map(|m| (m.style.marker, m.style.hollow)).collect();
            assert_eq!(styles.len(), 20);
        }
    }

    #[test]
    fn the_order_asked_for_comes_first() {
        let order = ["Z".to_owned(), "Gemini 2.5 Pro".to_owned()];
        let roster = Roster::new(&["B", "GPT 5.1", "A", "Gemini 2.5 Pro", "Z"], &order);
        assert_eq!(roster.names(), ["Z", "Gemini 2.5 Pro", "GPT 5.1", "A", "B"]);
    }
}
