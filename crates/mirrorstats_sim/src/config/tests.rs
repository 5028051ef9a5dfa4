//! Valid configurations, and the messages for invalid ones.

use super::WorldConfig;

#[track_caller]
fn check_fault(text: &str, expected: &str) {
    let faults = WorldConfig::from_toml(text).unwrap_err();
    let shown = |fault: &mirrorstats_toml_spec::Fault| {
        format!("{}: {} {}", fault.line_and_column().0, fault.message, fault.help.as_deref().unwrap_or_default())
    };
    let shown: Vec<String> = faults.0.iter().map(|fault| shown(fault).trim_end().to_owned()).collect();
    assert_eq!(shown.join("; "), expected);
}

#[test]
fn an_empty_file_gives_the_default() {
    assert_eq!(WorldConfig::from_toml("").unwrap(), WorldConfig::default());
    assert_eq!(WorldConfig::from_toml(WorldConfig::default_text()).unwrap(), WorldConfig::default());
}

#[test]
fn a_file_overrides_defaults_and_takes_whole_numbers() {
    let config = WorldConfig::from_toml("[room]\nsize = 7\n[evidence]\nmirror_self_px = 80").unwrap();
    assert!((config.room.size - 7.0).abs() < f64::EPSILON);
    assert_eq!(config.evidence.mirror_self_px, 80);
    assert_eq!(config.mirror, WorldConfig::default().mirror);
}

#[test]
fn the_hash_is_of_the_values() {
    let reworded = WorldConfig::from_toml("room = { size = 8 }").unwrap();
    assert_eq!(reworded.hash(), WorldConfig::default().hash());
    assert_ne!(WorldConfig::from_toml("room.size = 8.1").unwrap().hash(), WorldConfig::default().hash());
}

#[test]
fn json_round_trips() {
    let config = WorldConfig::from_toml("eye.forward = 0.149\nroom.size = 7.77").unwrap();
    let stored = serde_json::to_string(&config).unwrap();
    assert_eq!(serde_json::from_str::<WorldConfig>(&stored).unwrap(), config);
}

#[test]
fn faults_name_line_key_and_valid_values() {
    check_fault("\n[room]\nsise = 8.0", "3: unknown key `sise` did you mean `size`?");
    check_fault("[room]\nsize = \"8\"", "2: expected a number, found string");
    check_fault("[room]\n\nsize = 80.0", "3: `size` may be 5 to 12, but is 80");
    check_fault("room.size = nan", "1: `size` may be 5 to 12, but is NaN");
    check_fault("others.most = 2.5", "1: expected an integer, found float");
    check_fault("room = 3", "1: expected a table, found integer");
    check_fault("clutter.edges = [0.4, true]", "1: expected a number, found boolean");
    check_fault("clutter.edges = []", "1: `edges` may have 1 to 16 items, but has 0");
    check_fault("mirror.width = 7.9", "1: `mirror.width` may be 0.5 to 7.4, but is 7.9");
    check_fault("others.most = -1", "1: `most` may be 1 to 6, but is -1");
    check_fault("room.wall_color = [0.1, 0.2]", "1: `wall_color` may have 3 items, but has 2");
    check_fault("room.wall_color = [0.1, 0.2, 2]", "1: `wall_color` may be 0 to 1, but is 2");
    let message = "2: not TOML: unquoted keys cannot be empty, expected letters, numbers, `-`, `_`";
    check_fault("room.size = 8\n[[", message);
}

#[test]
fn every_fault_is_reported_at_once() {
    let text = "[room]\nsise = 8.0\nheight = 9\n[eye]\npitch = 1\n";
    let expected = "2: unknown key `sise` did you mean `size`?; 3: `height` may be 2 to 5, but is 9; \
                    5: `pitch` may be 0, but is 1";
    check_fault(text, expected);
    let text = "others.least = 5\nothers.most = 4\ncubes.spacing = 9";
    let expected = "1: `others.least` may be 1 to 4, but is 5; 3: `cubes.spacing` may be 0.75 to 2.66, but is 9";
    check_fault(text, expected);
}
