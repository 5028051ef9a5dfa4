use std::collections::BTreeMap;

use super::super::world::World;
use super::Visibility;
use mirrorstats_experiment::spec::{Answer, Fact, UNKNOWN};
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::schema::colors::Color;

impl World {
    /// The true answers by key, without those undefined in this condition.
    pub fn truths(&self, condition: &str, visibility: &Visibility) -> BTreeMap<String, Answered> {
        let truth = |answer: &Answer| match answer.truth {
            Some(fact) => self.fact(answer, fact, visibility),
            None => answer.read(answer.constant.as_ref().or_else(|| answer.conditions.get(condition))?),
        };
        let answers = &self.scene().experiment.answers;
        answers.iter().filter_map(|answer| Some((answer.key.clone(), truth(answer)?))).collect()
    }

    fn fact(&self, answer: &Answer, fact: Fact, visibility: &Visibility) -> Option<Answered> {
        let text = |text: Option<&str>| {
            let text = text.or_else(|| answer.unknown.then_some(UNKNOWN));
            text.map(|text| Answered::Text(text.to_owned()))
        };
        // Rounds to whole millimetres, so that the number has a short text.
        let number = |value: f64| Some(Answered::Number((value * 1000.0).round() / 1000.0));
        let pose = self.pose();
        match fact {
            Fact::BodyColor => text(Some(self.scene().body_color.name())),
            Fact::MarkColor => text(self.scene().own_mark_at(self.t()).map(Color::name)),
            Fact::MirrorPlace => text(self.mirror_place().and_then(|at| answer.options.get(at)).map(String::as_str)),
            Fact::MirrorVisible => text(Some(if self.is_mirror_visible(visibility) { "yes" } else { "no" })),
            Fact::Others => u32::try_from(self.scene().others.len()).ok().map(f64::from).map(Answered::Number),
            Fact::PoseX => number(pose.x),
            Fact::PoseY => number(pose.y),
            Fact::PoseYaw => number(pose.heading.degrees()),
        }
    }

    /// The number of bodies left of the own one in the first mirror; `None` if it does not show the own one to the eye.
    fn mirror_place(&self) -> Option<usize> {
        let pane = self.scene().panes.first().filter(|pane| pane.double.is_none() && pane.is_shown_at(self.t()))?;
        let eye = self.pose().ahead(self.config().eye.forward).spot();
        let across = |spot: [f64; 2]| pane.place.across(spot, eye, self.config());
        let all: Vec<f64> = self.figures_in(0).iter().map(|figure| across(figure.pose.spot())).collect();
        let own = *all.first()?;
        Some(all.iter().filter(|other| **other > own).count())
    }
}
