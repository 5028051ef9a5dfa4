//! The extended definitions, which need optional columns, worked out by hand.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;

use crate::harness::traces;
use crate::run;

/// A step: action, mirror in view, reasoning, own and others' pixels in the mirror.
type Row<'a> = (Action, bool, Option<&'a str>, Option<i32>, Option<i32>);

fn episode(id: &str, rows: &[Row]) -> Episode {
    let step = |&(action, mirror_visible, reasoning, own, other): &Row| Step {
        action: Some(action),
        mirror_visible,
        extra: Extra {
            reasoning: reasoning.map(str::to_owned),
            mirror_self_px: own,
            mirror_other_px: other,
            ..Extra::default()
        },
        ..Step::default()
    };
    traces::episode(id, rows.iter().map(step).collect())
}

#[test]
fn the_drafted_diagnostics_are_as_worked_out_by_hand() {
    let (go, done) = (Action::MoveForward, Action::Done);
    let folder = tempfile::tempdir().unwrap();
    let episodes = [
        // Two of three reasonings speak of oneself, one hedges; 30 of 40 pixels; from t = 2 to 4.
        episode(
            "a",
            &[
                (go, false, Some("I look around"), Some(0), Some(0)),
                (go, true, Some("Perhaps a mirror"), Some(10), Some(10)),
                (go, false, None, None, None),
                (done, true, Some("that is MY colour"), Some(20), Some(0)),
            ],
        ),
        // Whole words only: no `I` in `Is it`, no `me` in `mesh`, no `might` in `mighty`.
        episode(
            "b",
            &[
                (go, false, Some("Is it a mesh?"), Some(0), Some(0)),
                (done, false, Some("a mighty cube"), Some(0), Some(0)),
            ],
        ),
        // No reasoning and no known pixels: undefined, not zero.
        episode("c", &[(go, true, None, None, None), (go, true, None, None, None)]),
        // The mirror is first seen at the decision, so not before it.
        episode("d", &[(go, false, Some(""), Some(0), Some(0)), (done, true, Some("i think"), Some(1), Some(2))]),
        // A pixel count without its counterpart is unknown, in their sum and alone.
        episode("e", &[(go, true, Some("not sure"), Some(5), None), (done, false, Some("Me"), Some(1), Some(1))]),
    ];
    write_episodes(&folder.path().join("a.parquet"), None, &episodes).unwrap();
    let scores =
        run(folder.path(), &["score", "a.parquet", "--definitions", "extended", "--metrics", "SRR,EUL,SRL,STD"]).done();
    let expected = "\
episode_id,model,experiment,seed,run,SRR,EUL,SRL,STD
a,m,E1,1,1,666,333,750,2
b,m,E1,1,1,0,0,,
c,m,E1,1,1,,,,
d,m,E1,1,1,500,500,333,
e,m,E1,1,1,500,500,3000,1
";
    assert_eq!(scores, expected);
}

#[test]
fn a_file_without_the_column_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let with = episode("a", &[(Action::Done, true, Some("I"), Some(1), Some(1))]);
    let without = episode("b", &[(Action::Done, true, None, None, None)]);
    write_episodes(&folder.path().join("with.parquet"), None, &[with]).unwrap();
    write_episodes(&folder.path().join("without.parquet"), None, &[without]).unwrap();
    run(folder.path(), &["score", "with.parquet", "--definitions", "extended"]).done();
    let message = run(folder.path(), &["score", ".", "--definitions", "extended"]).refused();
    for word in ["`SRR`", "`reasoning`", "`without.parquet`", "--metrics"] {
        assert!(message.contains(word), "{message}");
    }
}
