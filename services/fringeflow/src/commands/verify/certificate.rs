//! The artefact of `--artefact`: its kind and its certified lengths, in a word or in a file.

use std::path::Path;

use serde::Deserialize;

use fringeflow_base::text_file::read_text;
use fringeflow_lab::artefact::Artefact;

use crate::failure::Failure;
use crate::output_folder::has_extension;

/// Bounds of a diameter and of a spacing, millimetres.
const LENGTHS_MM: [f64; 2] = [0.5, 2000.0];
/// Most balls of an artefact.
const MAX_BALLS: usize = 8;

/// A certified artefact.
#[derive(Clone, Debug)]
pub(super) struct Certificate {
    /// What it is called, for people.
    pub(super) name: Option<String>,
    pub(super) artefact: Artefact,
    /// Expanded uncertainties (k = 2) of the certified lengths, metres.
    pub(super) diameter_u2_m: f64,
    pub(super) spacing_u2_m: f64,
    pub(super) limits: Limits,
}

/// Largest accepted sizes of the figures, millimetres.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub(super) struct Limits {
    pub(super) pf_mm: Option<f64>,
    pub(super) ps_mm: Option<f64>,
    pub(super) sd_mm: Option<f64>,
    pub(super) f_mm: Option<f64>,
    pub(super) noise_mm: Option<f64>,
}

/// The content of a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    kind: String,
    name: Option<String>,
    diameters_mm: Option<Vec<f64>>,
    spacings_mm: Option<Vec<f64>>,
    diameter_uncertainty_mm: Option<f64>,
    spacing_uncertainty_mm: Option<f64>,
    #[serde(default)]
    limits: Limits,
}

/// Parses `plane`, `sphere:DIAMETER_MM`, `ball-bar:DIAMETER_MM,SPACING_MM`, or reads a TOML file.
///
/// # Errors
/// Names the file, the field, its value and the remedy.
pub(super) fn parse(text: &str) -> Result<Certificate, Failure> {
    let path = Path::new(text);
    if has_extension(path, "toml") {
        let content = read_text(path).map_err(|e| Failure::Usage(format!("{text}: {e}")))?;
        return from_toml(&content).map_err(|what| Failure::Usage(format!("{text}: {what}")));
    }
    let wrong = || {
        Failure::Usage(format!(
            "--artefact {text}: write plane, sphere:DIAMETER_MM as sphere:20, ball-bar:DIAMETER_MM,SPACING_MM as \
             ball-bar:20,60, or a file as ball-bar.toml"
        ))
    };
    let (kind, lengths) = text.split_once(':').unwrap_or((text, ""));
    let numbers: Result<Vec<f64>, _> =
        lengths.split(',').filter(|_| !lengths.is_empty()).map(|number| number.trim().parse::<f64>()).collect();
    let numbers = numbers.map_err(|_| wrong())?;
    let raw = |diameters_mm, spacings_mm| Raw {
        kind: kind.to_owned(),
        name: None,
        diameters_mm,
        spacings_mm,
        diameter_uncertainty_mm: None,
        spacing_uncertainty_mm: None,
        limits: Limits::default(),
    };
    let raw = match (kind, &numbers[..]) {
        ("plane", []) => raw(None, None),
        ("sphere", &[diameter]) => raw(Some(vec![diameter]), None),
        ("ball-bar", &[diameter, spacing]) => raw(Some(vec![diameter; 2]), Some(vec![spacing])),
        _ => return Err(wrong()),
    };
    checked(raw).map_err(|what| Failure::Usage(format!("--artefact {text}: {what}")))
}

fn from_toml(text: &str) -> Result<Certificate, String> {
    checked(toml::from_str(text).map_err(|e| format!("is not a valid artefact: {}", e.to_string().trim_end()))?)
}

fn checked(raw: Raw) -> Result<Certificate, String> {
    let Raw { kind, diameters_mm: diameters, spacings_mm: spacings, .. } = &raw;
    let balls = diameters.as_ref().map_or(0, Vec::len);
    let gaps = spacings.as_ref().map_or(0, Vec::len);
    let fits = match kind.as_str() {
        "plane" => (balls, gaps) == (0, 0),
        "sphere" => (balls, gaps) == (1, 0),
        "ball-bar" => (2..=MAX_BALLS).contains(&balls) && gaps + 1 == balls,
        _ => return Err(format!("key kind is {kind:?}; it must be one of plane, sphere, ball-bar")),
    };
    if !fits {
        return Err(format!(
            "a {kind} with {balls} diameters_mm and {gaps} spacings_mm; give a plane neither, a sphere one diameter, a \
             ball-bar 2 to {MAX_BALLS} diameters and the spacings of neighbours, one fewer"
        ));
    }
    check_lengths("diameters_mm", diameters)?;
    check_lengths("spacings_mm", spacings)?;
    check_limits(&raw)?;
    let metres = |lengths: &Option<Vec<f64>>| lengths.iter().flatten().map(|mm| mm * 1e-3).collect();
    let artefact = match kind.as_str() {
        "plane" => Artefact::Plane,
        _ => Artefact::Balls { diameters_m: metres(diameters), spacings_m: metres(spacings) },
    };
    Ok(Certificate {
        artefact,
        diameter_u2_m: uncertainty("diameter_uncertainty_mm", raw.diameter_uncertainty_mm, balls > 0)?,
        spacing_u2_m: uncertainty("spacing_uncertainty_mm", raw.spacing_uncertainty_mm, gaps > 0)?,
        name: raw.name,
        limits: raw.limits,
    })
}

fn check_lengths(key: &str, lengths: &Option<Vec<f64>>) -> Result<(), String> {
    let [least, most] = LENGTHS_MM;
    match lengths.iter().flatten().find(|mm| !(least..=most).contains(*mm)) {
        Some(mm) => Err(format!("key {key} holds {mm}; each must lie between {least} and {most} mm")),
        None => Ok(()),
    }
}

fn uncertainty(key: &str, value: Option<f64>, acts: bool) -> Result<f64, String> {
    match value {
        None => Ok(0.0),
        Some(mm) if !acts => Err(format!("key {key} is {mm}, but the artefact has no such length; leave it out")),
        Some(mm) if mm >= 0.0 && mm.is_finite() => Ok(mm * 1e-3),
        Some(mm) => Err(format!("key {key} is {mm}; it must be 0 or more")),
    }
}

/// Checks that each limit is a length above 0 and that the artefact has its figure.
fn check_limits(raw: &Raw) -> Result<(), String> {
    let (has_balls, has_spacings) = (raw.kind != "plane", raw.kind == "ball-bar");
    let Limits { pf_mm, ps_mm, sd_mm, f_mm, noise_mm } = raw.limits;
    let all = [
        ("pf_mm", pf_mm, has_balls),
        ("ps_mm", ps_mm, has_balls),
        ("sd_mm", sd_mm, has_spacings),
        ("f_mm", f_mm, !has_balls),
        ("noise_mm", noise_mm, true),
    ];
    for (key, value, acts) in all {
        match value {
            Some(mm) if !acts => {
                let kind = &raw.kind;
                return Err(format!("key limits.{key} is {mm}, but a {kind} has no such figure; leave it out"));
            }
            Some(mm) if !(mm > 0.0 && mm.is_finite()) => {
                return Err(format!("key limits.{key} is {mm}; it must be above 0"));
            }
            _ => {}
        }
    }
    Ok(())
}

impl Certificate {
    /// The artefact in a few words.
    pub(super) fn describe(&self) -> String {
        let what = match &self.artefact {
            Artefact::Plane => "plane".to_owned(),
            Artefact::Balls { diameters_m, spacings_m } if spacings_m.is_empty() => {
                format!("ball of {}", lengths(diameters_m))
            }
            Artefact::Balls { diameters_m, spacings_m } => {
                format!("{} balls of {}, {} apart", diameters_m.len(), lengths(diameters_m), lengths(spacings_m))
            }
        };
        self.name.as_ref().map_or(what.clone(), |name| format!("{name}, {what}"))
    }
}

/// Lengths in millimetres, equal ones once.
fn lengths(lengths_m: &[f64]) -> String {
    let mut texts: Vec<String> = lengths_m.iter().map(|m| format!("{:.4}", m * 1e3)).collect();
    texts.dedup();
    format!("{} mm", texts.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BAR: &str = "kind = \"ball-bar\"\nname = \"KB 60\"\ndiameters_mm = [20.0012, 19.9998]\nspacings_mm = [60.0034]\n\
                       diameter_uncertainty_mm = 0.0008\nspacing_uncertainty_mm = 0.001\n[limits]\npf_mm = 0.05\nsd_mm = 0.03\n";

    #[test]
    fn a_file_and_words_describe_the_same() {
        let bar = from_toml(BAR).unwrap();
        assert_eq!(bar.describe(), "KB 60, 2 balls of 20.0012 and 19.9998 mm, 60.0034 mm apart");
        assert_eq!((bar.spacing_u2_m, bar.limits.sd_mm, bar.limits.ps_mm), (1e-6, Some(0.03), None));
        assert_eq!(parse("ball-bar:20,60").unwrap().describe(), "2 balls of 20.0000 mm, 60.0000 mm apart");
        assert_eq!(parse("plane").unwrap().artefact, Artefact::Plane);
    }

    #[test]
    fn errors_name_key_value_and_remedy() {
        for (from, to, told) in [
            ("ball-bar", "cube", "key kind is \"cube\"; it must be one of"),
            ("[60.0034]", "[]", "2 diameters_mm and 0 spacings_mm; give"),
            ("19.9998", "-3", "key diameters_mm holds -3; each must lie between"),
            ("0.0008", "nan", "key diameter_uncertainty_mm is NaN; it must be 0 or more"),
            ("sd_mm = 0.03", "f_mm = 0.03", "key limits.f_mm is 0.03, but a ball-bar has no such figure; leave it out"),
            ("pf_mm = 0.05", "pf_mm = 0", "key limits.pf_mm is 0; it must be above 0"),
            ("name", "nmae", "unknown field `nmae`"),
        ] {
            let error = from_toml(&BAR.replace(from, to)).unwrap_err();
            assert!(error.contains(told), "{error}");
        }
        for text in ["cube", "sphere", "sphere:x", "ball-bar:20", "plane:3", "sphere:-1"] {
            assert!(parse(text).unwrap_err().to_string().contains(text), "{text}");
        }
    }
}
