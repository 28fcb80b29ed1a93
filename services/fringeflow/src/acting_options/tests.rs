//! Walks all pairs of options that a command takes, by the parser's own description of the command.

use super::name;
use crate::Cli;

/// A way to use a command: arguments that choose its modes. Together, the forms of a command choose every mode.
struct Form {
    command: &'static str,
    arguments: &'static [&'static str],
}

const fn form(command: &'static str, arguments: &'static [&'static str]) -> Form {
    Form { command, arguments }
}

const FORMS: &[Form] = &[
    form("cameras", &[]),
    form("control", &["a", "record"]),
    form("check", &["a.mcap"]),
    form("board", &["charuco:5x5:square=10:marker=8:dictionary=4x4_50", "-o", "board.pdf"]),
    form("board", &["chessboard:9x6:square=20", "--find", "image.png"]),
    form("calibrate", &["set", "--board", "chessboard:9x6:square=20", "-o", "a.yml"]),
    form("calibrate", &["--refine", "a.mcap", "-o", "a.yml"]),
    form("demo", &[]),
    form("evaluate", &["set"]),
    form("evaluate", &["set", "--method", "egc"]),
    form("evaluate", &["--paper"]),
    form("evaluate", &["--sweep", "-o", "out"]),
    form("evaluate", &["--scenes", "build"]),
    form("evaluate", &["--scenes", "build", "--sensitivity"]),
    form("export", &["a.mcap", "-o", "a.ply"]),
    form("export", &["a.mcap", "-o", "out"]),
    form("export", &["a.mcap", "-o", "out", "--images"]),
    form("fuse", &["a.mcap", "-o", "a.ply"]),
    form("import", &["set", "-o", "a.mcap"]),
    form("info", &["a.mcap"]),
    form("latency", &["a.mcap"]),
    form("patterns", &["-o", "out"]),
    form("patterns", &["-o", "out", "--calibration"]),
    form("patterns", &["-o", "out", "--chart"]),
    form("patterns", &["-o", "out", "--config", "a.toml"]),
    form("patterns", &["-o", "out", "--bits", "1"]),
    form("project", &["--config", "a.toml"]),
    form("project", &["--patterns", "out"]),
    form("project", &["--check"]),
    form("project", &["--list"]),
    form("reconstruct", &["set", "-o", "a.ply"]),
    form("reconstruct", &["set", "-o", "a.ply", "--method", "cgc"]),
    form("recover", &["a.mcap", "-o", "b.mcap"]),
    form("replay", &["a.mcap"]),
    form("replay", &["a.mcap", "--verify"]),
    form("rig", &["rig.yml"]),
    form("rig", &["rig.yml", "--images", "set"]),
    form("run", &["--config", "a.toml"]),
    form("run", &["--config", "a.toml", "--check"]),
    form("service phase", &["--config", "a.toml"]),
    form("service cloud", &["--config", "a.toml"]),
    form("simulate", &["-o", "set"]),
    form("simulate", &["-o", "set", "--motion", "0.5", "--board", "85"]),
    form("simulate", &["-o", "set", "--sd", "0"]),
    form("simulate", &["-o", "set", "--calibration-board", "chessboard:9x6:square=7"]),
    form("simulate", &["-o", "set", "--calibration-board", "chessboard:9x6:square=7", "--board-motion", "1"]),
    form("simulate", &["-o", "set", "--rig", "rig.yml"]),
    form("simulate", &["-o", "set", "--projector-at", "150,-60,0"]),
    form("simulate", &["-o", "set", "--format", "RGGB"]),
    form("simulate", &["-o", "a.mcap", "--config", "a.toml"]),
    form("status", &[]),
    form("verify", &["set", "--artefact", "plane"]),
    form("verify", &["a.mcap", "--artefact", "plane"]),
    form("verify", &["a.mcap", "--artefact", "plane", "--recompute"]),
    form("verify", &["a.ply", "--artefact", "plane"]),
];

/// An argument of a command: its name in messages, and words that give it a valid value.
struct Given {
    name: String,
    words: Vec<String>,
}

/// Returns valid values for all arguments of the command of a form that the form leaves out, those of nested commands
/// included. `command` is the whole command line.
fn arguments_beyond(form: &Form, mut command: &clap::Command) -> Vec<Given> {
    let mut arguments = Vec::new();
    for word in form.command.split(' ').chain(form.arguments.iter().copied()) {
        let Some(nested) = command.find_subcommand(word) else { continue };
        command = nested;
        arguments.extend(command.get_arguments().filter(|argument| argument.get_id() != "help"));
    }
    let is_in_form = |argument: &clap::Arg| {
        let short = argument.get_short().map(|short| format!("-{short}"));
        let long = argument.get_long().map(|long| format!("--{long}"));
        let mut words = form.arguments.iter();
        match &long {
            None => argument.is_required_set() || argument.get_id() == "input" && !form.arguments[0].starts_with('-'),
            Some(_) => words.any(|&word| Some(word) == short.as_deref() || Some(word) == long.as_deref()),
        }
    };
    arguments.into_iter().filter(|argument| !is_in_form(argument)).map(given).collect()
}

/// Returns an argument with a valid value: the first of its list, or the first of some that its parser accepts.
fn given(argument: &clap::Arg) -> Given {
    let name = name(argument);
    let mut words: Vec<String> = argument.get_long().map(|long| format!("--{long}")).into_iter().collect();
    if argument.get_action().takes_values() {
        let listed = argument.get_possible_values();
        let value = listed.first().map_or_else(|| sample(&name).to_owned(), |value| value.get_name().to_owned());
        words = if words.is_empty() { vec![value] } else { vec![format!("{}={value}", words[0])] };
    }
    Given { name, words }
}

/// A valid value of an option without a list of values.
fn sample(name: &str) -> &'static str {
    match name {
        "--frames" | "--clouds" => "0..4",
        "--board" => "85",
        "--calibration-board" => "chessboard:9x6:square=7",
        "DEVICE" => "/dev/video0",
        "--shift" | "--projector-at" => "1,2,3",
        "--rulers" => "100,80",
        "--format" => "Y12",
        "--size" => "64x64",
        "--min-confidence" | "--blur" | "--board-albedo" => "0.5",
        _ => "4",
    }
}

fn built() -> clap::Command {
    let mut command = Cli::description();
    command.build();
    command
}

/// Returns the error about a command line; `None` if it is accepted.
fn refusal(command: &mut clap::Command, form: &Form, more: &[&Given]) -> Option<String> {
    let words = ["fringeflow"].into_iter().chain(form.command.split(' ')).chain(form.arguments.iter().copied());
    let words = words.map(str::to_owned).chain(more.iter().flat_map(|given| given.words.clone()));
    Cli::parse_checked(command, words.map(Into::into)).err().map(|error| error.to_string())
}

/// Whether a message names an option, and not only a longer one.
fn names(message: &str, option: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '-';
    message.match_indices(option).any(|(at, _)| !message[at + option.len()..].starts_with(is_part))
}

#[test]
fn every_form_is_accepted_and_every_command_and_every_option_has_a_form() {
    let mut whole = built();
    for form in FORMS {
        assert_eq!(refusal(&mut whole, form, &[]), None, "{} {:?}", form.command, form.arguments);
    }
    for command in whole.clone().get_subcommands().filter(|command| command.get_name() != "help") {
        let forms: Vec<&Form> =
            FORMS.iter().filter(|form| form.command.split(' ').next() == Some(command.get_name())).collect();
        assert!(!forms.is_empty(), "{} has no form", command.get_name());
        for argument in command.get_arguments().filter(|argument| !argument.is_global_set()) {
            let option = name(argument);
            let mut acts = |form: &&Form| {
                let beyond = arguments_beyond(form, &whole);
                let given = beyond.iter().find(|given| given.name == option);
                given.is_none_or(|given| refusal(&mut whole, form, &[given]).is_none())
            };
            let is_help = argument.get_id() == "help";
            assert!(is_help || forms.iter().any(&mut acts), "{option} acts in no form of {}", command.get_name());
        }
    }
}

#[test]
fn every_pair_of_options_acts_or_is_refused_with_a_message_that_names_both_sides() {
    let (mut whole, mut pairs) = (built(), 0);
    for form in FORMS {
        let beyond = arguments_beyond(form, &whole);
        let alone: Vec<Option<String>> = beyond.iter().map(|given| refusal(&mut whole, form, &[given])).collect();
        for (i, a) in beyond.iter().enumerate() {
            let case = format!("{} {:?} {}", form.command, form.arguments, a.name);
            if let Some(message) = &alone[i] {
                assert!(names(message, &a.name), "{case}: {message}");
            }
            for (j, b) in beyond.iter().enumerate().skip(i + 1) {
                pairs += 1;
                let together = refusal(&mut whole, form, &[a, b]);
                let case = format!("{case} {}", b.name);
                match (&alone[i], &alone[j], together) {
                    // Each acts alone, but they contradict each other, or one chooses a mode without the other.
                    (None, None, Some(message)) => {
                        assert!(names(&message, &a.name) && names(&message, &b.name), "{case}: {message}");
                    }
                    // Both act, or one acts in the mode that the other chooses.
                    (_, _, None) => {}
                    (_, _, Some(message)) => {
                        assert!(names(&message, &a.name) || names(&message, &b.name), "{case}: {message}");
                    }
                }
            }
        }
    }
    // Of the commands of today. A walk that forms no pairs would hold nothing.
    assert!(pairs > 2000, "{pairs}");
}
