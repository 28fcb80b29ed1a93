//! The licence of every dependency is on the list in `deny.toml`, which `cargo deny` reads too.
//!
//! Checks only the dependencies on this machine's platform: those of other platforms need not be downloaded here.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use sha2::{Digest as _, Sha256};
use spdx::{Expression, Licensee, ParseMode};

type Outcome<T> = Result<T, Box<dyn Error>>;

#[test]
fn every_dependency_has_an_allowed_licence() {
    let allowed = allowed_licences(include_str!("../deny.toml")).unwrap();
    let metadata = metadata().unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 20, "only {} packages: cargo metadata did not list the dependencies", packages.len());
    let refused: Vec<String> = packages.iter().filter_map(|package| refusal(package, &allowed)).collect();
    assert!(
        refused.is_empty(),
        "{}\nreplace the dependency; or, if its licence requires only its notice to be kept, add it to [licenses] \
         allow in deny.toml",
        refused.join("\n")
    );
}

#[test]
fn licence_expressions_are_evaluated() {
    let allowed = allowed_licences("[licenses]\nallow = ['MIT', 'Zlib', 'Apache-2.0 WITH LLVM-exception']").unwrap();
    for accepted in [
        "MIT",
        "MIT/GPL-3.0-only",
        "GPL-3.0-only OR MIT",
        "MIT AND Zlib",
        "(GPL-2.0-only OR Zlib) AND MIT",
        "Apache-2.0 WITH LLVM-exception",
    ] {
        assert_eq!(objection(Some(accepted), &allowed), None);
    }
    for refused in
        ["GPL-3.0-only", "MIT AND GPL-3.0-only", "Apache-2.0", "MIT WITH LLVM-exception", "LicenseRef-Own", "Mit-ish"]
    {
        assert!(objection(Some(refused), &allowed).is_some(), "{refused} was accepted");
    }
    assert!(objection(None, &allowed).is_some(), "a package without a licence was accepted");
}

#[test]
fn an_invalid_list_is_an_error() {
    assert!(allowed_licences("[licenses]\nallow = ['MTI']").is_err());
    assert!(allowed_licences("[licenses]\nallow = []").is_err());
    assert!(allowed_licences("[bans]").is_err());
}

#[test]
fn vendored_libraries_are_intact_and_carry_their_licence() {
    let vendor = Path::new(env!("CARGO_MANIFEST_DIR")).join("../services/monitor/page/vendor");
    let sums = std::fs::read_to_string(vendor.join("SHA256SUMS")).unwrap();
    let mut listed = Vec::new();
    for line in sums.lines() {
        let (sum, name) = line.split_once("  ").unwrap();
        let found: String =
            Sha256::digest(std::fs::read(vendor.join(name)).unwrap()).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(found, sum, "{name} differs from the output of scripts/vendor-page.sh; run the script again");
        listed.push(vendor.join(name));
    }
    let folders = std::fs::read_dir(&vendor).unwrap().flatten().map(|entry| entry.path()).filter(|path| path.is_dir());
    for folder in folders {
        let licence = std::fs::read_to_string(folder.join("LICENSE")).unwrap();
        assert!(licence.contains("MIT License"), "{}: unknown licence", folder.display());
        for file in std::fs::read_dir(&folder).unwrap().flatten() {
            assert!(listed.contains(&file.path()), "{} is not in SHA256SUMS", file.path().display());
        }
    }
}

/// The entries of `[licenses] allow`.
fn allowed_licences(deny_toml: &str) -> Outcome<Vec<Licensee>> {
    let table: toml::Table = deny_toml.parse()?;
    let list = table.get("licenses").and_then(|section| section.get("allow")).and_then(toml::Value::as_array);
    let list = list.filter(|list| !list.is_empty()).ok_or("deny.toml: [licenses] allow must list licences")?;
    let entries = list.iter().map(|entry| entry.as_str().ok_or("deny.toml: [licenses] allow holds strings"));
    entries.map(|entry| Ok(Licensee::parse(entry?)?)).collect()
}

/// Metadata of the workspace and its dependencies, from cargo.
fn metadata() -> Outcome<Value> {
    let platform = host_platform()?;
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform", &platform])
        .args(["--manifest-path", concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml")])
        .output()?;
    if !output.status.success() {
        return Err(format!("cargo metadata: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// The target triple of this machine, from `rustc -vV`.
fn host_platform() -> Outcome<String> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = String::from_utf8(Command::new(rustc).arg("-vV").output()?.stdout)?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.ok_or("rustc -vV names no host")?.to_owned())
}

fn refusal(package: &Value, allowed: &[Licensee]) -> Option<String> {
    let objection = objection(package["license"].as_str(), allowed)?;
    let text = |key: &str| package[key].as_str().unwrap_or("?").to_owned();
    Some(format!("{} {}: {objection}", text("name"), text("version")))
}

/// Why a licence expression is not acceptable; `None` if it is acceptable.
fn objection(licence: Option<&str>, allowed: &[Licensee]) -> Option<String> {
    let Some(licence) = licence else { return Some("states no licence".to_owned()) };
    // Older packages write a choice as `MIT/Apache-2.0`; lax mode accepts that.
    match Expression::parse_mode(licence, ParseMode::LAX) {
        Err(error) => Some(format!("{licence:?} is no SPDX expression: {}", error.reason)),
        Ok(expression) => {
            let accepted = expression.evaluate(|wanted| allowed.iter().any(|licensee| licensee.satisfies(wanted)));
            (!accepted).then(|| format!("{licence:?} is not on the list"))
        }
    }
}
