// The header: instance, connection, scan and recording.

import { byId, setState, setText } from "./elements.js";
import { fileName, plural, timeOfDay } from "./format.js";

export function showInstance(hello) {
    setText(byId("instance"), hello.instance ?? "");
    byId("virtual-images").hidden = !hello.virtual_images;
    document.title = `${hello.instance ?? "Scanner"} – Fringeflow`;
    setText(byId("about-version"), hello.version ? `Fringeflow ${hello.version}` : "Fringeflow");
    setText(byId("about-images"), describeImages(hello));
    setText(byId("about-foxglove"), hello.foxglove ? `Foxglove: ${hello.foxglove}` : "");
}

function describeImages({ image_size_px: size, steps, rate_hz: rate }) {
    const parts = [];
    if (Array.isArray(size)) {
        parts.push(`${size[0]} × ${size[1]} px`);
    }
    if (rate) {
        parts.push(`${rate} images/s per camera`);
    }
    if (steps) {
        parts.push(`${steps} images per window`);
    }
    return parts.join(", ");
}

/** Shows the state of the connection. The style sheet greys the page while it is not live. */
export function showConnection(state) {
    setState(document.body, "connection", state.name);
    const connection = byId("connection");
    setState(connection, "level", { live: "ok", stale: "warning" }[state.name] ?? "error");
    setText(connection, { live: "Live", stale: "Stale", connecting: "Connecting" }[state.name] ?? "Reconnecting");
    const banner = byId("connection-banner");
    banner.hidden = state.name === "live" || state.name === "connecting";
    setText(banner, describeLoss(state));
}

function describeLoss({ name, why, retryMs, receivedAt }) {
    if (name === "stale") {
        return `No data since ${timeOfDay(receivedAt)}. The page shows the state at that time.`;
    }
    if (name !== "reconnecting") {
        return "";
    }
    const old = receivedAt ? ` The page shows the state at ${timeOfDay(receivedAt)}.` : "";
    return `Not connected: ${why}. Trying again in ${retryMs / 1000} s.${old}`;
}

/**
 * Shows the state of the scan. `preparation` is the progress of a service that prepares before the scan can begin;
 * `recorder` says when the disk will be full.
 */
export function showState(state, preparation, recorder) {
    const scanning = byId("scanning");
    setState(scanning, "level", state.scanning ? "ok" : "idle");
    setText(scanning, preparation ?? (state.scanning ? "Scanning" : "Not scanning"));
    const recording = byId("recording");
    setState(recording, "level", state.recording_ended ? "error" : state.recording ? "recording" : "idle");
    setText(recording, describeRecording(state));
    recording.title = state.recording ?? "";
    const disk = byId("disk-warning");
    disk.hidden = !recorder?.full_in;
    setText(disk, `Disk full in ${recorder?.full_in ?? ""}`);
    disk.title = recorder?.text ?? "";
}

function describeRecording({ recording, recording_ended: why, marks }) {
    if (!recording) {
        return "Not recording";
    }
    if (why) {
        return `Recording ended: ${why}`;
    }
    return `Recording ${fileName(recording)}${marks ? `, ${plural(marks, "mark")}` : ""}`;
}
