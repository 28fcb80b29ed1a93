//! Commands from the page's buttons to the instance.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use http::header::CONTENT_TYPE;
use http::{HeaderMap, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};

use fringeflow_message::{Command, ControlRequest, ControlResponse, Text};
use fringeflow_runtime::RecorderStatus;
use fringeflow_transport::{Instance, TransportError, request};

use crate::instance_status::state_entry;

use super::state::ServerState;

/// Time limit for the answer of the supervisor.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(3);
/// Media type of a command. Browsers do not let pages of other origins send it without permission.
const MEDIA_TYPE: &str = "application/json";

/// The body of a request.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CommandBody {
    command: CommandName,
    #[serde(default)]
    text: String,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum CommandName {
    Start,
    Stop,
    Record,
    EndRecording,
    Mark,
}

/// Sends a command to the supervisor, and answers with the state after it.
pub(super) async fn control(State(server): State<ServerState>, headers: HeaderMap, body: Bytes) -> Response {
    let is_json = headers.get(CONTENT_TYPE).is_some_and(|value| value.as_bytes().starts_with(MEDIA_TYPE.as_bytes()));
    if !is_json {
        return refuse(StatusCode::UNSUPPORTED_MEDIA_TYPE, "a command must be JSON, sent as application/json");
    }
    let command = match parse(&body) {
        Ok(command) => command,
        Err(why) => return refuse(StatusCode::BAD_REQUEST, &why),
    };
    let instance = server.shared.instance.clone();
    let answer = tokio::task::spawn_blocking(move || send(&instance, &command)).await;
    match answer {
        Ok(Ok(response)) if response.refused == 0 => {
            let recorder = RecorderStatus::read(&server.shared.instance);
            reply(StatusCode::OK, &json!({"state": state_entry(&response.state, recorder.as_ref())}))
        }
        Ok(Ok(response)) => refuse(StatusCode::CONFLICT, &response.text.to_text()),
        Ok(Err(error)) => refuse(StatusCode::BAD_GATEWAY, &error.to_string()),
        Err(_) => refuse(StatusCode::SERVICE_UNAVAILABLE, "the monitor is shutting down"),
    }
}

fn parse(body: &[u8]) -> Result<ControlRequest, String> {
    let body: CommandBody = serde_json::from_slice(body).map_err(|error| format!("this is not a command: {error}"))?;
    if !Text::fits(&body.text) {
        return Err("the text is too long; give at most 256 bytes".to_owned());
    }
    // A page must not choose where files are written on the scanner PC.
    if matches!(body.command, CommandName::Record) && !body.text.is_empty() {
        return Err("a recording that the page starts is named by the time; leave out the text".to_owned());
    }
    let command = match body.command {
        CommandName::Start => Command::Start,
        CommandName::Stop => Command::Stop,
        CommandName::Record => Command::RecordStart,
        CommandName::EndRecording => Command::RecordStop,
        CommandName::Mark => Command::Mark,
    };
    Ok(ControlRequest { command: command as u32, reserved: 0, text: Text::new(&body.text) })
}

fn send(instance: &Instance, command: &ControlRequest) -> Result<ControlResponse, TransportError> {
    request(instance, command, ANSWER_TIMEOUT)
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
    fn commands_are_parsed_and_anything_else_is_refused() {
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
