//! Every option of the commands that run offline acts in every form of its command, alone and together with every other
//! option: with it the command gives another result than without it, or refuses it by name.
//!
//! The options are those of the help, so a new option fails until this test has a value for it.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

mod outcome;
mod samples;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::OnceLock;

use outcome::{Outcome, run};
use samples::{FORMS, Form, Inputs, WITHOUT_RESULT, sample};

/// Returns the options of a command by its help, without those of which no result depends.
fn options(command: &str) -> Vec<String> {
    let help = run(Path::new("."), &[command.to_owned(), "--help".to_owned()]);
    let words = |line: &str| {
        let line = line.trim_start();
        let rest = line.get(4..).filter(|_| line.starts_with('-') && line.get(2..4) == Some(", ")).unwrap_or(line);
        rest.starts_with("--").then(|| rest.split([' ', '=']).next().unwrap_or_default().to_owned())
    };
    let options = help.stdout.lines().filter_map(words);
    options.filter(|option| option != "--help" && !WITHOUT_RESULT.contains(&option.as_str())).collect()
}

/// The outcomes of the options of a form.
struct Walk<'a> {
    form: &'a Form,
    inputs: &'a Inputs,
    /// Options that the form leaves out, with their values.
    options: Vec<(String, Vec<String>)>,
}

impl<'a> Walk<'a> {
    fn new(form: &'a Form, inputs: &'a Inputs) -> Self {
        let given = |option: &String| form.arguments.split(' ').any(|word| word == option);
        let all = options(form.command).into_iter().filter(|option| !given(option) && option != "--output");
        let options = all.map(|option| (option.clone(), sample(form, &option, inputs))).collect();
        Self { form, inputs, options }
    }

    /// Runs the form with some more options, in a new folder.
    fn run(&self, more: &[usize]) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        let words = self.form.arguments.split(' ').map(|word| self.inputs.replace(word));
        let more = more.iter().flat_map(|&option| self.options[option].1.clone());
        run(folder.path(), &std::iter::once(self.form.command.to_owned()).chain(words).chain(more).collect::<Vec<_>>())
    }

    /// Whether two outcomes show that options act: the results differ, or the options are refused by name.
    fn act(&self, without: &Outcome, with: &Outcome, options: &[usize]) -> bool {
        let names = |&option: &usize| with.stderr.contains(&self.options[option].0);
        if with.is_refused() { options.iter().any(names) } else { with.differs_from(without) }
    }

    /// Checks the options, and all pairs of them that are not among the `walked` ones.
    fn check(&self, walked: &mut BTreeSet<[String; 2]>) {
        let name = format!("{} {}", self.form.command, self.form.arguments);
        let base = self.run(&[]);
        assert!(base.is_success(), "{name}: {}", base.stderr);
        let alone: BTreeMap<usize, Outcome> =
            (0..self.options.len()).map(|option| (option, self.run(&[option]))).collect();
        let mut idle = Vec::new();
        for (&option, outcome) in &alone {
            if !self.act(&base, outcome, &[option]) {
                idle.push(format!("{}: {}", self.options[option].0, outcome.stderr));
            }
        }
        assert!(idle.is_empty(), "{name}: these options are ignored: {idle:#?}");
        let acting: Vec<usize> = (0..self.options.len()).filter(|option| alone[option].is_success()).collect();
        for (i, &a) in acting.iter().enumerate() {
            for &b in &acting[i + 1..] {
                if !walked.insert([a, b].map(|option| self.options[option].0.clone())) {
                    continue;
                }
                let together = self.run(&[a, b]);
                let acts = self.act(&alone[&a], &together, &[a, b]) && self.act(&alone[&b], &together, &[a, b]);
                let pair = [&self.options[a].0, &self.options[b].0].map(String::as_str);
                if !acts && !self.form.is_excepted(pair) {
                    idle.push(format!("{} {}: {}", pair[0], pair[1], together.stderr));
                }
            }
        }
        assert!(idle.is_empty(), "{name}: one of the pair is ignored: {idle:#?}");
    }
}

/// Checks the forms of one command.
fn check(command: &str) {
    static INPUTS: OnceLock<Inputs> = OnceLock::new();
    let inputs = INPUTS.get_or_init(Inputs::new);
    let forms: Vec<&Form> = FORMS.iter().filter(|form| form.command == command).collect();
    assert!(!forms.is_empty(), "{command} has no form");
    let mut walked = BTreeSet::new();
    forms.iter().for_each(|form| Walk::new(form, inputs).check(&mut walked));
}

#[test]
fn the_options_of_reconstruct_act() {
    check("reconstruct");
}

#[test]
fn the_options_of_evaluate_act() {
    check("evaluate");
}

#[test]
fn the_options_of_simulate_act() {
    check("simulate");
}

#[test]
fn the_options_of_board_act() {
    check("board");
}

#[test]
fn the_options_of_calibrate_act() {
    check("calibrate");
}

#[test]
fn the_options_of_rig_act() {
    check("rig");
}

#[test]
fn the_options_of_fuse_act() {
    check("fuse");
}

#[test]
fn the_options_of_patterns_act() {
    check("patterns");
}

#[test]
fn the_options_of_verify_act() {
    check("verify");
}

#[test]
fn the_options_of_the_commands_on_recordings_act() {
    ["export", "import", "info", "check", "recover", "latency"].into_iter().for_each(check);
}
