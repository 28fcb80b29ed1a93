//! Buttons: commands to the instance.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use http::header::CONTENT_TYPE;
use http::{HeaderMap, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};

use fringeflow_message::{Command, ControlRequest, ControlResponse, Text};
use fringeflow_transport::{Instance, TransportError, request};

use crate::board::state_entry;

use super::server::Answering;

/// How long the supervisor may take to answer.
const ANSWER: Duration = Duration::from_secs(3);
/// The media type of a command: one that pages of other origins cannot send unasked.
const MEDIA_TYPE: &str = "application/json";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wish {
    command: Wanted,
    #[serde(default)]
    text: String,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Wanted {
    Start,
    Stop,
    Record,
    EndRecording,
    Mark,
}

/// Carries out a command, and tells the state after it.
pub(super) async fn control(State(answering): State<Answering>, headers: HeaderMap, body: Bytes) -> Response {
    let is_json = headers.get(CONTENT_TYPE).is_some_and(|value| value.as_bytes().starts_with(MEDIA_TYPE.as_bytes()));
    if !is_json {
        return refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "a command must be JSON, sent as application/json");
    }
    let asked = match parse(&body) {
        Ok(asked) => asked,
        Err(why) => return refuse(StatusCode::BAD_REQUEST, &why),
    };
    let instance = answering.shared.instance.clone();
    let answered = tokio::task::spawn_blocking(move || ask(&instance, &asked)).await;
    match answered {
        Ok(Ok(response)) if response.refused == 0 => {
            reply(StatusCode::OK, &json!({"state": state_entry(&response.state)}))
        }
        Ok(Ok(response)) => refuse(StatusCode::CONFLICT, &response.text.to_text()),
        Ok(Err(error)) => refuse(StatusCode::BAD_GATEWAY, &error.to_string()),
        Err(_) => refuse(StatusCode::SERVICE_UNAVAILABLE, "the monitor is ending"),
    }
}

fn parse(body: &[u8]) -> Result<ControlRequest, String> {
    let wish: Wish = serde_json::from_slice(body).map_err(|error| format!("this is not a command: {error}"))?;
    if !Text::fits(&wish.text) {
        return Err("the text is too long; give at most 256 bytes".to_owned());
    }
    // Where a recording goes is for the scanner PC to say, not for a page.
    if matches!(wish.command, Wanted::Record) && !wish.text.is_empty() {
        return Err("a recording started here is named by the time; leave out the text".to_owned());
    }
    let command = match wish.command {
        Wanted::Start => Command::Start,
        Wanted::Stop => Command::Stop,
        Wanted::Record => Command::RecordStart,
        Wanted::EndRecording => Command::RecordStop,
        Wanted::Mark => Command::Mark,
    };
    Ok(ControlRequest { command: command as u32, reserved: 0, text: Text::new(&wish.text) })
}

fn ask(instance: &Instance, asked: &ControlRequest) -> Result<ControlResponse, TransportError> {
    request(instance, asked, ANSWER)
}

fn refuse(status: StatusCode, why: &str) -> Response {
    reply(status, &json!({"error": why}))
}

fn reply(status: StatusCode, body: &Value) -> Response {
    (status, [(CONTENT_TYPE, MEDIA_TYPE)], body.to_string()).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_read_and_others_refused() {
        let mark = parse(br#"{"command": "mark", "text": "left ear"}"#).unwrap();
        assert_eq!((mark.command, mark.text.to_text().as_str()), (Command::Mark as u32, "left ear"));
        assert_eq!(parse(br#"{"command": "end-recording"}"#).unwrap().command, Command::RecordStop as u32);
        for (body, word) in [
            (r#"{"command": "quit"}"#, "quit"),
            (r#"{"command": "record", "text": "/etc/passwd"}"#, "named by the time"),
            (r#"{"command": "stop", "more": 1}"#, "more"),
            ("", "not a command"),
        ] {
            let why = parse(body.as_bytes()).unwrap_err();
            assert!(why.contains(word), "{body}: {why}");
        }
        let long = format!(r#"{{"command": "mark", "text": "{}"}}"#, "x".repeat(300));
        assert!(parse(long.as_bytes()).unwrap_err().contains("256 bytes"));
    }
}
