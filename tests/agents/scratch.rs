use crate::recorded::{Plan, record};
use mirrorstats::agent::scripted::Scripted;
use mirrorstats::sim::Experiment;
use mirrorstats::sim::config::WorldConfig;
use mirrorstats::sim::eye::Eye;
use std::time::Instant;

#[test]
#[ignore]
fn scratch() {
    let config = WorldConfig::default();
    let mut eye = Eye::new(&config).unwrap();
    let var = |name: &str, default: &str| std::env::var(name).unwrap_or(default.to_owned());
    let agent = Scripted::named(&var("AGENT", "oracle")).unwrap();
    let out = var("OUT", "");
    for name in var("EXP", "E1").split(',') {
        let experiment = Experiment::parse(name).unwrap();
        for id in var("RUNS", "1.1,1.2").split(',') {
            let (seed, run) = id.split_once('.').unwrap();
            let plan = Plan { agent, experiment, seed: seed.parse().unwrap(), run: run.parse().unwrap() };
            let start = Instant::now();
            let mut lines = Vec::new();
            let episode = record(plan, &config, &mut eye, |t, world, frame, reply| {
                let pose = world.pose();
                lines.push(format!(
                    "{t:3} ({:.2},{:.2}) {:3} {:?} {:?} {:?} | {} | {}",
                    pose.x,
                    pose.y,
                    pose.heading.degrees(),
                    reply.action.map(|a| a.name()).unwrap_or("-"),
                    reply.self_color.as_deref().unwrap_or(""),
                    reply.selected_cube.as_deref().unwrap_or(""),
                    reply.words.view_description.as_deref().unwrap_or(""),
                    reply.words.reasoning.as_deref().unwrap_or("")
                ));
                if !out.is_empty() {
                    let file = std::fs::File::create(format!("{out}/{}-{t:03}.png", plan.id())).unwrap();
                    let mut encoder = png::Encoder::new(file, frame.width as u32, frame.height as u32);
                    encoder.set_color(png::ColorType::Rgb);
                    encoder.write_header().unwrap().write_image_data(&frame.rgb).unwrap();
                }
            });
            let last = episode.steps.last().unwrap();
            let own = &episode.body_color;
            let first_px = episode.steps.iter().position(|s| s.mirror_visible);
            let first_claim = episode.steps.iter().position(|s| s.self_color.as_deref() != Some("unknown"));
            println!(
                "{} own {own} stated {:?} others {:?} T {} done {:?} cube {:?} claim {:?} dist {:?} mirror@{first_px:?} claim@{first_claim:?} {:?}",
                plan.id(),
                episode.stated_color,
                episode.distractors,
                episode.steps.len(),
                last.action == Some(mirrorstats::trace::episode::Action::Done),
                last.selected_cube,
                last.self_color,
                last.extra.cube_distance,
                start.elapsed()
            );
            let good = if experiment == Experiment::E5 { &last.self_color } else { &last.selected_cube };
            if good.as_deref() != Some(own.as_str()) || var("VERBOSE", "") == "1" {
                let px: Vec<i32> = episode.steps.iter().map(|s| s.extra.mirror_self_px.unwrap()).collect();
                for (line, px) in lines.iter().zip(px) {
                    println!("   {px:5} {line}");
                }
            }
        }
    }
}
