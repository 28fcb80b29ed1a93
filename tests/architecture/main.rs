//! The direction of dependencies inside the library, and what its algorithms may not touch.
//!
//! The rules are the tables of [`layers`]; every source file of the library and of the services is held to them.

mod layers;
mod scanner;
mod tokens;

use std::fs;
use std::path::{Path, PathBuf};

use layers::{MODULES, RESTRICTED, UNSAFE_FILES};
use scanner::{Mentions, mentions};

#[test]
fn every_source_keeps_to_the_layers() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = [sources(&root.join("src")).unwrap(), sources(&root.join("services")).unwrap()].concat();
    assert!(files.len() > 20, "only {} source files found", files.len());
    let broken: Vec<String> = files
        .iter()
        .flat_map(|file| {
            let name = file.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
            violations(&name, &fs::read_to_string(file).unwrap())
        })
        .collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_table_has_no_cycles() {
    for (row, (module, allowed)) in MODULES.iter().enumerate() {
        for target in *allowed {
            let target = target.split("::").next().unwrap();
            assert!(MODULES[..row].iter().any(|(above, _)| *above == target), "{target} must stand above {module}");
        }
    }
}

#[test]
fn violations_are_found_however_they_are_written() {
    for source in [
        "use crate::cloud::Cloud;",
        "use crate::{geometry, cloud::Cloud};",
        "use crate::{cloud};",
        "use crate::*;",
        "use crate as lib;",
        "use super::super::cloud::Cloud;",
        "mod inner { use super::super::super::cloud; }",
        "fn f() -> crate::cloud::Cloud { todo() }",
        "fn f() { let c = r#\"\"#; let q = '\"'; crate :: cloud :: merge(c, q) }",
        "macro_rules! m { () => { $crate::cloud::merge() } }",
        "#[cfg(test)] mod tests { fn f() {} } use crate::cloud::Cloud;",
        "use iceoryx2::prelude::*;",
        "use iceoryx2 as bus;",
        "extern crate mcap;",
        "use std::{io, time::Instant};",
        "fn f() { let t = ::std::time::SystemTime::now(); }",
        "fn f() { tracing::info!(\"x\"); log::warn!(\"y\") }",
        "fn f() { unsafe { g() } }",
        "/* /* */ */ use crate::unknown::Thing;",
    ] {
        assert!(!violations("src/phase/map.rs", source).is_empty(), "not found: {source}");
    }
}

#[test]
fn what_is_allowed_is_let_through() {
    for source in [
        "use crate::phase::PhaseMap; use super::map::PhaseMap; use super::*;",
        "//! See [`crate::cloud::Cloud`].\n/* crate::cloud::x, /* unsafe */ std::time::y */ fn f<'a>() {}",
        "fn f() { let s = \"crate::cloud::x \\\" unsafe\"; let r = r#\"std::time::Instant \" \"#; let b = b\"mcap::x\"; }",
        "fn f(log: f64) -> f64 { x.log(log) + tracing }",
        "#[cfg(test)] mod tests { use crate::cloud::Cloud; }",
        "#[cfg(test)] use crate::cloud::Cloud;",
        "#![allow(unsafe_code)]",
        "mod inner { use super::super::other; }",
        "use std::f64::consts::TAU; fn f() -> i32 { '\\'' as i32 }",
    ] {
        assert_eq!(violations("src/phase/map.rs", source), Vec::<String>::new(), "{source}");
    }
    assert!(violations("src/cloud/ply.rs", "use crate::calibration::{Unit};").is_empty());
    assert!(!violations("src/cloud/ply.rs", "use crate::calibration::{Unit, read};").is_empty());
    assert!(violations("services/capture/src/main.rs", "use v4l::Device; use std::time::Instant;").is_empty());
    assert!(!violations("services/phase/src/main.rs", "use v4l::Device;").is_empty());
}

#[test]
fn a_module_that_is_not_in_the_table_is_refused() {
    let found = violations("src/novelty/mod.rs", "");
    assert!(found.len() == 1 && found[0].contains("add it to MODULES"), "{found:?}");
}

/// What one file of the repository, named from its root, does against the tables.
fn violations(file: &str, source: &str) -> Vec<String> {
    let place = place(file);
    let found = mentions(source, depth(file));
    let mut broken = Vec::new();
    if file.starts_with("src/") && place != "lib" && !is_test_file(file) {
        broken.extend(against_layers(file, &place, &found));
    }
    broken.extend(found.paths.iter().filter_map(|path| against_restrictions(file, &place, path)));
    if found.has_unsafe && !UNSAFE_FILES.contains(&file) {
        broken.push(format!("{file}: unsafe outside the files of UNSAFE_FILES in tests/architecture/layers.rs"));
    }
    broken
}

fn against_layers(file: &str, module: &str, found: &Mentions) -> Vec<String> {
    let Some((_, allowed)) = MODULES.iter().find(|(name, _)| *name == module) else {
        let table = "MODULES in tests/architecture/layers.rs, with the modules it may name";
        return vec![format!("{file}: module {module} has no layer yet: add it to {table}")];
    };
    let into_library = found.paths.iter().filter(|path| path[0] == "crate").map(|path| path[1..].join("::"));
    let refused = into_library.filter(|path| !is_within(path, module) && !allowed.iter().any(|a| is_within(path, a)));
    refused.map(|path| format!("{file}: {module} must not name crate::{path}; it may name {allowed:?}")).collect()
}

fn against_restrictions(file: &str, place: &str, path: &[String]) -> Option<String> {
    let path = path.join("::");
    let (name, places) = RESTRICTED.iter().find(|(name, _)| is_within(&path, name))?;
    let allowed = places.iter().any(|p| place == *p || (p.ends_with('/') && place.starts_with(p)));
    (!allowed).then(|| format!("{file}: {path}: only {places:?} may name {name}"))
}

/// Whether `path` is `prefix` or lies inside it.
fn is_within(path: &str, prefix: &str) -> bool {
    path.strip_prefix(prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// `src/phase/map.rs` → `phase`; `src/lib.rs` → `lib`; `services/capture/src/main.rs` → `services/capture`.
fn place(file: &str) -> String {
    let parts: Vec<&str> = file.split('/').collect();
    match parts[..] {
        ["services", service, ..] => format!("services/{service}"),
        [_, first, ..] => first.trim_end_matches(".rs").to_owned(),
        _ => file.to_owned(),
    }
}

/// Levels of a file's module below the root of its crate.
fn depth(file: &str) -> usize {
    let inside = file.rsplit_once("src/").map_or(file, |(_, inside)| inside);
    let names_itself = !matches!(inside.rsplit('/').next(), Some("mod.rs" | "lib.rs" | "main.rs"));
    inside.matches('/').count() + usize::from(names_itself)
}

/// Unit tests in a file of their own: `tests.rs`, or anything in a folder `tests`.
fn is_test_file(file: &str) -> bool {
    file.ends_with("/tests.rs") || file.contains("/tests/")
}

/// Every Rust file below a folder.
fn sources(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(sources(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
