//! `[pattern] file`: the cycle of a `patterns.toml`, so that configuration and projector cannot disagree.
//!
//! In: the text of a configuration that names such a file. Out: the same configuration with the cycle stated in it, as a
//! recording needs it, and the size of the projector.

use std::path::{Path, PathBuf};

use fringeflow_patterns::{FringeCycle, PatternSet, even_shifts_rad};
use toml::{Table, Value};

use super::ConfigurationProblem;
use super::paths::in_folder;
use super::raw::RawPattern;

/// The patterns that a configuration names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatternFile {
    /// The list of the patterns.
    pub file: PathBuf,
    /// Width and height of the image of the projector, pixels.
    pub projector_px: [usize; 2],
}

/// Reads the patterns that `[pattern]` names in the place of values. Returns the text with the values, and the file.
///
/// # Errors
/// The table states values too, or the file cannot be read, or has no cycle for scanning.
pub(super) fn with_its_cycle(
    text: &str,
    raw: &RawPattern,
    named: &Path,
    folder: &Path,
) -> Result<(String, PatternFile), ConfigurationProblem> {
    raw.refuse_values()?;
    let file = in_folder(folder, named);
    let set = PatternSet::read(&file)?;
    let cycle = set.cycle().map_err(|problem| ConfigurationProblem::NoCycle { file: file.clone(), problem })?;
    Ok((with_cycle(text, &cycle)?, PatternFile { file, projector_px: set.projector_px }))
}

/// Returns the text with the values of a cycle in the place of the file. The rest of the text stays as it is, if the file
/// has a line of its own.
fn with_cycle(text: &str, cycle: &FringeCycle) -> Result<String, ConfigurationProblem> {
    let mut table: Table = text.parse()?;
    let stated = stated(cycle);
    let lines = stated.to_string();
    table.insert("pattern".to_owned(), Value::Table(stated));
    let is_file = |line: &&str| line.split('=').next().is_some_and(|key| key.trim() == "file");
    let with_lines = |line: &str| text.replacen(line, lines.trim_end(), 1);
    let edited = text.lines().filter(is_file).map(with_lines);
    let mut whole = edited.filter(|edited| edited.parse::<Table>().is_ok_and(|read| read == table));
    Ok(whole.next().unwrap_or_else(|| table.to_string()))
}

/// The keys of `[pattern]`.
fn stated(cycle: &FringeCycle) -> Table {
    let (pattern, steps) = (&cycle.pattern, cycle.shifts_rad.len());
    let mut table = Table::new();
    let mut insert = |key: &str, value: Value| drop(table.insert(key.to_owned(), value));
    insert("steps", Value::Integer(steps as i64));
    insert("period_px", pattern.period_px.into());
    insert("phase_sign", pattern.sign.into());
    insert("phase_offset_rad", pattern.offset_rad.into());
    if cycle.shifts_rad != even_shifts_rad(steps) {
        insert("phase_shift_rad", cycle.shifts_rad.clone().into());
    }
    table
}

#[cfg(test)]
mod tests {
    use fringeflow_patterns::{Direction, usual_fringes};

    use super::*;
    use crate::{RigSource, ScannerConfiguration};

    const REST: &str =
        "[cameras]\nsource = \"external\"\nrate_hz = 30.0\n[rig]\ncalibration = \"rig.yml\"\nunit = \"mm\"\n";

    fn folder_with(shifts_rad: &[f64], direction: Direction) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let cycle = FringeCycle { pattern: usual_fringes(18.0), shifts_rad: shifts_rad.to_vec() };
        let set = PatternSet::fringes([64, 48], &[direction], &cycle, false).unwrap();
        set.write(&folder.path().join("patterns")).unwrap();
        folder
    }

    fn parse(pattern: &str, folder: &tempfile::TempDir) -> Result<ScannerConfiguration, String> {
        let text = format!("# My rig.\n[pattern]\n{pattern}\n{REST}");
        ScannerConfiguration::parse(&text, folder.path()).map_err(|e| e.to_string())
    }

    #[test]
    fn the_cycle_is_that_of_the_file_and_recordings_state_it() {
        for shifts_rad in [even_shifts_rad(5), vec![0.0, 1.5, 3.0]] {
            let folder = folder_with(&shifts_rad, Direction::Columns);
            for file in ["file = \"patterns/patterns.toml\"", "file = \"patterns\" # all of it"] {
                let read = parse(file, &folder).unwrap();
                let Some(RigSource::Files { sequence, .. }) = &read.rig else { panic!("{:?}", read.rig) };
                assert_eq!((sequence.pattern, &sequence.shifts_rad), (usual_fringes(18.0), &shifts_rad));
                assert_eq!(read.pattern_file.as_ref().unwrap().projector_px, [64, 48]);
                let recorded = read.recorded_text();
                assert!(recorded.starts_with("# My rig.\n") && !recorded.contains("file"), "{recorded}");
                let again = ScannerConfiguration::parse(&recorded, Path::new("/elsewhere")).unwrap();
                let Some(RigSource::Files { sequence: recorded, .. }) = &again.rig else { panic!("{:?}", again.rig) };
                assert_eq!(recorded, sequence);
            }
        }
    }

    #[test]
    fn a_table_on_one_line_is_read_too() {
        let folder = folder_with(&even_shifts_rad(3), Direction::Columns);
        let text = format!("pattern = {{ file = \"patterns\" }}\n{REST}");
        let read = ScannerConfiguration::parse(&text, folder.path()).unwrap();
        let Some(RigSource::Files { sequence, .. }) = &read.rig else { panic!("{:?}", read.rig) };
        assert_eq!(sequence.shifts_rad.len(), 3);
    }

    #[test]
    fn a_pattern_stated_twice_and_a_file_without_a_cycle_are_refused() {
        let folder = folder_with(&even_shifts_rad(4), Direction::Columns);
        let both = parse("file = \"patterns\"\nperiod_px = 18.0", &folder).unwrap_err();
        assert!(both.contains("pattern.period_px is 18") && both.contains("pattern.file"), "{both}");
        let rows = folder_with(&even_shifts_rad(4), Direction::Rows);
        let rows = parse("file = \"patterns\"", &rows).unwrap_err();
        assert!(rows.contains("key pattern.file") && rows.contains("image 0 is rows fringes"), "{rows}");
        let missing = parse("file = \"pattern\"", &folder).unwrap_err();
        assert!(missing.contains("key pattern.file") && missing.contains("cannot be read"), "{missing}");
        let nothing = parse("phase_sign = 1", &folder).unwrap_err();
        assert!(nothing.contains("pattern.steps is missing"), "{nothing}");
    }
}
