// The buttons that start and stop scan and recordings, and set marks.

import { byId, setState, setText } from "./elements.js";
import { fileName } from "./format.js";

const ANSWER_TIMEOUT_MS = 20_000;
const SHOWN_MS = 10_000;

/** Connects the buttons. `changed(state)` is called with the state after a command. */
export class Commands {
    #state = null;
    #changed;
    #scan = byId("button-scan");
    #record = byId("button-record");
    #mark = byId("button-mark");
    #text = byId("mark-text");

    constructor(changed) {
        this.#changed = changed;
        this.#scan.addEventListener("click", () => this.#send(this.#scan, scanCommand(this.#state)));
        this.#record.addEventListener("click", () => this.#send(this.#record, recordCommand(this.#state)));
        byId("mark-form").addEventListener("submit", (event) => {
            event.preventDefault();
            this.#sendMark();
        });
        this.showState(null);
    }

    /** Sets what the buttons do next. Without a state (not connected) they do nothing. */
    showState(state) {
        this.#state = state;
        if (state !== null) {
            setText(this.#scan, state.scanning ? "Stop scan" : "Start scan");
            setText(this.#record, isRecording(state) ? "End recording" : "Record");
        }
        for (const button of [this.#scan, this.#record, this.#mark]) {
            button.setAttribute("aria-disabled", String(state === null));
        }
    }

    async #sendMark() {
        const text = this.#text.value.trim();
        const done = await this.#send(this.#mark, { command: "mark", ...(text && { text }) });
        if (done) {
            this.#text.value = "";
        }
    }

    async #send(button, command) {
        if (this.#state === null || button.ariaBusy === "true") {
            return false;
        }
        button.ariaBusy = "true";
        showResult("busy", "Sent, waiting for the answer …");
        try {
            const state = await control(command);
            showResult("ok", describe(command, state));
            this.#changed(state);
            return true;
        } catch (error) {
            showResult("error", `Not done: ${error.message}`);
            return false;
        } finally {
            button.ariaBusy = "false";
        }
    }
}

const scanCommand = (state) => ({ command: state?.scanning ? "stop" : "start" });
const isRecording = (state) => Boolean(state?.recording) && !state.recording_ended;
const recordCommand = (state) => ({ command: isRecording(state) ? "end-recording" : "record" });

/** Sends a command and returns the state after it. Throws an error whose message is meant for the user. */
async function control(command) {
    const response = await fetch("/control", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(command),
        signal: AbortSignal.timeout(ANSWER_TIMEOUT_MS),
    }).catch((error) => {
        throw new Error(error.name === "TimeoutError" ? "no answer in time" : "the server does not answer");
    });
    const answer = await response.json().catch(() => ({}));
    if (!response.ok || !answer.state) {
        throw new Error(answer.error ?? `the server answered ${response.status}`);
    }
    return answer.state;
}

function describe({ command, text }, state) {
    switch (command) {
        case "start":
            return "Scan started.";
        case "stop":
            return "Scan stopped.";
        case "record":
            return state.recording ? `Recording to ${fileName(state.recording)}.` : "Recording.";
        case "end-recording":
            return "Recording ended.";
        default:
            return text ? `Mark “${text}” set.` : "Mark set.";
    }
}

let hideTimer = null;

function showResult(level, text) {
    const result = byId("command-result");
    setState(result, "level", level);
    setState(result, "old", null);
    setText(result, text);
    clearTimeout(hideTimer);
    hideTimer = setTimeout(() => setState(result, "old", ""), SHOWN_MS);
}
