//! The guide lists every drop reason as the program means it.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use fringeflow_message::DropReason;
use fringeflow_telemetry::DropKind;

#[test]
fn the_guide_says_of_every_drop_reason_whether_it_is_a_loss() {
    let guide = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/guide/README.md")).unwrap();
    let rows: Vec<Vec<&str>> = guide
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.strip_suffix('|'))
        .map(|row| row.split('|').map(|cell| cell.trim().trim_matches('`')).collect())
        .filter(|row: &Vec<&str>| row.len() == 3)
        .collect();
    for reason in DropReason::ALL {
        let setting = reason.drop_meaning().setting().unwrap_or_default();
        let expected = vec![reason.name(), DropKind::of(reason).name(), setting];
        assert!(rows.contains(&expected), "the table of losses lacks {expected:?}");
    }
}
