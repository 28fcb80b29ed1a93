//! The structs of include/fringeflow.h have the same memory layout as those of Rust, and names and numbers agree.

use std::fmt::Write as _;
use std::mem::offset_of;
use std::path::Path;
use std::process::Command;

use fringeflow_message::{
    ControlRequest, ControlResponse, FrameHeader, PATTERN_FRINGES, PatternEvent, PixelFormat, ScanState, Text, flags,
};
use fringeflow_transport::ChannelId;

/// A C expression and its expected value.
type Expectation = (String, u64);

/// Adds size and field offsets of a struct, which has the name `$c` in C.
macro_rules! layout {
    ($lines:ident, $c:literal, $rust:ty, [$($field:ident),*]) => {
        $lines.push((format!("sizeof({})", $c), size_of::<$rust>() as u64));
        $($lines.push((format!("offsetof({}, {})", $c, stringify!($field)), offset_of!($rust, $field) as u64));)*
    };
}

fn layouts() -> Vec<Expectation> {
    let mut lines = Vec::new();
    layout!(
        lines,
        "fringeflow_pattern_event",
        PatternEvent,
        [session, sequence, exposure_start_ns, duration_ns, period_px, step, steps, kind, reserved]
    );
    layout!(
        lines,
        "fringeflow_frame_header",
        FrameHeader,
        [
            session,
            sequence,
            published,
            exposure_start_ns,
            received_ns,
            exposure_ns,
            width_px,
            height_px,
            stride_bytes,
            pixel_format,
            flags,
            camera
        ]
    );
    layout!(
        lines,
        "fringeflow_scan_state",
        ScanState,
        [revision, scanning, recording, recordings, marks, recording_file, mark]
    );
    layout!(lines, "fringeflow_control_request", ControlRequest, [command, reserved, text]);
    layout!(lines, "fringeflow_control_response", ControlResponse, [refused, reserved, state, text]);
    lines.push(("sizeof(fringeflow_text)".to_owned(), size_of::<Text>() as u64));
    lines
}

fn numbers() -> Vec<Expectation> {
    let commands = [
        ("STATE", fringeflow_message::Command::State),
        ("START", fringeflow_message::Command::Start),
        ("STOP", fringeflow_message::Command::Stop),
        ("RECORD_START", fringeflow_message::Command::RecordStart),
        ("RECORD_STOP", fringeflow_message::Command::RecordStop),
        ("MARK", fringeflow_message::Command::Mark),
        ("QUIT", fringeflow_message::Command::Quit),
    ];
    let commands = commands.map(|(name, command)| (format!("FRINGEFLOW_COMMAND_{name}"), u64::from(command as u32)));
    let others = [
        ("FRINGEFLOW_PATTERN_FRINGES", PATTERN_FRINGES),
        ("FRINGEFLOW_FRAME_DAMAGED", flags::DAMAGED),
        ("FRINGEFLOW_FRAME_START_RECKONED", flags::START_RECKONED),
        ("FRINGEFLOW_FRAME_REPLAYED", flags::REPLAYED),
        ("FRINGEFLOW_TEXT_BYTES", size_of::<Text>() as u32),
    ];
    let others = others.map(|(name, value)| (name.to_owned(), u64::from(value)));
    let formats =
        PixelFormat::ALL.map(|format| (format!("FRINGEFLOW_PIXEL_FORMAT_{}", format.name()), u64::from(format.code())));
    commands.into_iter().chain(others).chain(formats).collect()
}

/// The iceoryx2 type name of a struct in crates/message/src.
fn type_name(rust: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/message/src");
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let sources: String =
        entries.filter(|path| path.is_file()).map(|file| std::fs::read_to_string(file).unwrap()).collect();
    let (before, _) = sources.split_once(&format!("\")]\npub struct {rust}")).unwrap();
    before.rsplit_once("#[type_name(\"").unwrap().1.to_owned()
}

/// Macros for names in C, and their expected values.
fn names() -> Vec<(&'static str, String)> {
    vec![
        ("FRINGEFLOW_CHANNEL_PATTERN", ChannelId::ProjectorPattern.name().to_owned()),
        ("FRINGEFLOW_CHANNEL_CAM1", ChannelId::Cam1Frame.name().to_owned()),
        ("FRINGEFLOW_CHANNEL_CAM2", ChannelId::Cam2Frame.name().to_owned()),
        ("FRINGEFLOW_CHANNEL_STATE", ChannelId::ScanState.name().to_owned()),
        ("FRINGEFLOW_TYPE_PATTERN_EVENT", type_name("PatternEvent")),
        ("FRINGEFLOW_TYPE_FRAME_HEADER", type_name("FrameHeader")),
        ("FRINGEFLOW_TYPE_TEXT", type_name("Text")),
        ("FRINGEFLOW_TYPE_SCAN_STATE", type_name("ScanState")),
        ("FRINGEFLOW_TYPE_CONTROL_REQUEST", type_name("ControlRequest")),
        ("FRINGEFLOW_TYPE_CONTROL_RESPONSE", type_name("ControlResponse")),
    ]
}

/// A C program that prints every expression and every name.
fn c_program(lines: &[Expectation], names: &[(&str, String)]) -> String {
    let mut source =
        String::from("#include <fringeflow.h>\n#include <stddef.h>\n#include <stdio.h>\nint main(void) {\n");
    for (expression, _) in lines {
        writeln!(source, "    printf(\"%llu\\n\", (unsigned long long)({expression}));").unwrap();
    }
    for (name, _) in names {
        writeln!(source, "    printf(\"%s\\n\", {name});").unwrap();
    }
    source + "    return 0;\n}\n"
}

#[test]
fn c_and_rust_have_the_same_layout_and_names() {
    let folder = tempfile::tempdir().unwrap();
    let [source, binary] = ["layout.c", "layout"].map(|name| folder.path().join(name));
    let lines: Vec<Expectation> = layouts().into_iter().chain(numbers()).collect();
    let names = names();
    std::fs::write(&source, c_program(&lines, &names)).unwrap();
    let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("../include");
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-I"]).arg(include).arg("-o").arg(&binary).arg(&source);
    let compiled = compiler.output().unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let printed = String::from_utf8(Command::new(&binary).output().unwrap().stdout).unwrap();
    let expected = lines.iter().map(|(_, value)| value.to_string()).chain(names.iter().map(|(_, name)| name.clone()));
    let expressions =
        lines.iter().map(|(expression, _)| expression.as_str()).chain(names.iter().map(|(name, _)| *name));
    let printed: Vec<&str> = printed.lines().collect();
    assert_eq!(printed.len(), lines.len() + names.len());
    for ((expression, expected), printed) in expressions.zip(expected).zip(printed) {
        assert_eq!(printed, expected, "{expression}");
    }
}
