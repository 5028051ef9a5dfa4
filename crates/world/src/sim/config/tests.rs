//! What a configuration may say, and the words where it may not.

use super::WorldConfig;

#[track_caller]
fn check_fault(text: &str, expected: &str) {
    assert_eq!(WorldConfig::from_toml(text).unwrap_err().to_string(), expected);
}

#[test]
fn the_default_is_what_an_empty_file_gives() {
    assert_eq!(WorldConfig::from_toml("").unwrap(), WorldConfig::default());
    assert_eq!(WorldConfig::from_toml(WorldConfig::default_text()).unwrap(), WorldConfig::default());
}

#[test]
fn a_file_says_what_differs_and_whole_numbers_are_numbers() {
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
fn what_is_stored_as_json_comes_back() {
    let config = WorldConfig::from_toml("eye.forward = 0.149\nroom.size = 7.77").unwrap();
    let stored = serde_json::to_string(&config).unwrap();
    assert_eq!(serde_json::from_str::<WorldConfig>(&stored).unwrap(), config);
}

#[test]
fn faults_name_line_key_and_what_may_be() {
    check_fault("\n[room]\nsise = 8.0", "line 3: no key `room.sise`: did you mean `size`?");
    check_fault("[room]\nsize = \"8\"", "line 2: `room.size` is a number, but found \"8\"");
    check_fault("[room]\n\nsize = 80.0", "line 3: `room.size` may be 5 to 12, but is 80");
    check_fault("room.size = nan", "line 1: `room.size` may be 5 to 12, but is NaN");
    check_fault("others.most = 2.5", "line 1: `others.most` is a whole number, but found 2.5");
    check_fault("room = 3", "line 1: `room` is a table, but found 3");
    check_fault("clutter.edges = [0.4, true]", "line 1: `clutter.edges` is a list of numbers");
    check_fault("clutter.edges = []", "line 1: `clutter.edges` may be 1 to 16, but is 0");
    check_fault("mirror.width = 7.9", "line 1: `mirror.width` may be 0.5 to 7.4, but is 7.9");
    check_fault("others.most = -1", "line 1: `others.most` counts something, but is -1");
    check_fault("room.wall_color = [0.1, 0.2]", "line 1: `room.wall_color` is red, green and blue, but has 2 parts");
}

#[test]
fn a_file_that_is_no_toml_is_told_with_its_line() {
    let fault = WorldConfig::from_toml("room.size = 8\n[[").unwrap_err();
    assert_eq!(fault.line, Some(2), "{fault}");
}
