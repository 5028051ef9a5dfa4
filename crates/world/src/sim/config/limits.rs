//! What each value of a configuration may be, alone and beside the others.

use super::WorldConfig;

/// A key, its value, and the least and the most that it may be.
type Limit = (&'static str, f64, f64, f64);

/// The first value that is out of its range or does not fit another, and the words for it.
pub(super) fn first_fault(config: &WorldConfig) -> Option<(&'static str, String)> {
    ranges(config).into_iter().chain(relations(config)).find_map(|(key, value, least, most)| {
        // Written so that what is no number is a fault too.
        let holds = value >= least && value <= most;
        (!holds).then(|| (key, format!("`{key}` may be {least} to {most}, but is {value}")))
    })
}

fn ranges(config: &WorldConfig) -> Vec<Limit> {
    let WorldConfig { room, mirror, body, eye, lights, cubes, others, clutter, placement, evidence, episode } = config;
    let mut limits = vec![
        ("room.size", room.size, 5.0, 12.0),
        ("room.height", room.height, 2.0, 5.0),
        ("room.tile_size", room.tile_size, 0.1, 2.0),
        ("mirror.width", mirror.width, 0.5, 10.0),
        ("mirror.height", mirror.height, 0.5, 5.0),
        ("mirror.gap", mirror.gap, 0.005, 0.1),
        ("body.radius", body.radius, 0.39, 0.6),
        ("body.step_length", body.step_length, 0.1, 1.0),
        ("body.leg_swing", body.leg_swing, 0.0, 15.0),
        ("body.arm_swing", body.arm_swing, 0.0, 20.0),
        ("eye.forward", eye.forward, 0.12, 0.25),
        ("eye.height", eye.height, 1.4, 1.58),
        ("eye.fovy", eye.fovy, 30.0, 115.0),
        ("eye.pitch", eye.pitch, 0.0, 0.0),
        ("eye.width", f64::from(eye.width), 16.0, 1920.0),
        ("eye.height_px", f64::from(eye.height_px), 12.0, 1440.0),
        ("eye.samples", f64::from(eye.samples), 0.0, 16.0),
        ("eye.slices", f64::from(eye.slices), 6.0, 64.0),
        ("eye.stacks", f64::from(eye.stacks), 4.0, 64.0),
        ("eye.quads", f64::from(eye.quads), 1.0, 16.0),
        ("lights.head_ambient", lights.head_ambient, 0.0, 1.0),
        ("lights.head_diffuse", lights.head_diffuse, 0.0, 1.0),
        ("lights.lamp_diffuse", lights.lamp_diffuse, 0.0, 1.0),
        ("lights.lamp_slope", lights.lamp_slope, 0.0, 85.0),
        ("lights.floor_diffuse", lights.floor_diffuse, 0.0, 1.0),
        ("cubes.edge", cubes.edge, 0.2, 1.0),
        ("others.least", f64::from(others.least), 1.0, 6.0),
        ("others.most", f64::from(others.most), 1.0, 6.0),
        ("others.step_length", others.step_length, 0.05, 0.6),
        ("others.twin_percent", f64::from(others.twin_percent), 0.0, 100.0),
        ("others.patience", f64::from(others.patience), 0.0, 100.0),
        ("clutter.least", f64::from(clutter.least), 0.0, 12.0),
        ("clutter.most", f64::from(clutter.most), 0.0, 12.0),
        ("clutter.before_mirror_percent", f64::from(clutter.before_mirror_percent), 0.0, 100.0),
        ("clutter.stack_percent", f64::from(clutter.stack_percent), 0.0, 100.0),
        ("clutter.hides_percent", f64::from(clutter.hides_percent), 0.0, 100.0),
        ("placement.wall_margin", placement.wall_margin, 0.05, 1.0),
        ("placement.clearance", placement.clearance, 0.05, 1.0),
        ("evidence.mirror_self_px", f64::from(evidence.mirror_self_px), 1.0, 1e6),
        ("episode.steps", f64::from(episode.steps), 1.0, 100_000.0),
    ];
    let colors = [
        ("room.floor_color", room.floor_color),
        ("room.tile_color", room.tile_color),
        ("room.wall_color", room.wall_color),
        ("room.side_wall_color", room.side_wall_color),
        ("room.ceiling_color", room.ceiling_color),
    ];
    limits.extend(colors.iter().flat_map(|(key, parts)| parts.iter().map(|part| (*key, *part, 0.0, 1.0))));
    limits.extend(clutter.edges.iter().map(|edge| ("clutter.edges", *edge, 0.2, 1.0)));
    limits
}

fn relations(config: &WorldConfig) -> Vec<Limit> {
    let WorldConfig { room, mirror, cubes, others, clutter, placement, .. } = config;
    let above = room.height - mirror.height / 2.0;
    vec![
        ("mirror.width", mirror.width, 0.5, room.size - 2.0 * placement.wall_margin),
        ("mirror.center_height", mirror.center_height, mirror.height / 2.0, above),
        ("others.least", f64::from(others.least), 1.0, f64::from(others.most)),
        ("clutter.least", f64::from(clutter.least), 0.0, f64::from(clutter.most)),
        ("clutter.edges", count(&clutter.edges), 1.0, 16.0),
        ("cubes.spacing", cubes.spacing, 1.5 * cubes.edge, (room.size / 3.0 * 100.0).floor() / 100.0),
        ("cubes.mirror_distance", cubes.mirror_distance, cubes.edge / 2.0 + placement.wall_margin, room.size / 2.0),
        ("clutter.mirror_distance", clutter.mirror_distance, 1.0, room.size / 2.0),
    ]
}

fn count(values: &[f64]) -> f64 {
    u32::try_from(values.len()).map_or(f64::INFINITY, f64::from)
}
