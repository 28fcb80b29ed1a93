// Whether the scanner measures as it should: what is watched from window to window, with its limits.

import { byId, setState, setText } from "./elements.js";
import { MISSING, fixed, isNumber, withUnit } from "./format.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

const LEVELS = { ok: "ok", warn: "warning", bad: "error" };
const MINUTE_S = 60;
const HOUR_S = 3600;

export function showHealth({ figures }) {
    const health = figures.window?.health;
    const state = health?.state ?? "not known";
    const overall = byId("health-state");
    setText(overall, state);
    setState(overall, "level", LEVELS[state] ?? "idle");
    showRows(byId("health-rows"), (health?.quantities ?? []).map((gauge) => cellsOf(gauge, figures.health_for_s ?? {})));
    markLive("panel-health");
}

function cellsOf({ quantity, title, unit, state, level, warn, bad }, forS) {
    return [
        { head: true, text: capital(title ?? quantity), title: quantity },
        { badge: "badge", text: state, level: LEVELS[state] ?? "idle" },
        { number: true, text: measured(level, unit), level: state === "ok" ? null : LEVELS[state] },
        { number: true, text: measured(warn, unit) },
        { number: true, text: measured(bad, unit) },
        { number: true, text: since(forS[quantity]) },
    ];
}

/** Level or limit with its unit; shares in percent. */
export function measured(value, unit) {
    if (!isNumber(value)) {
        return MISSING;
    }
    return unit ? withUnit(fixed(value, 3), unit) : withUnit(fixed(100 * value, 1), "%");
}

function since(seconds) {
    if (!isNumber(seconds)) {
        return MISSING;
    }
    if (seconds < 2 * MINUTE_S) {
        return withUnit(fixed(seconds), "s");
    }
    return seconds < 2 * HOUR_S ? withUnit(fixed(seconds / MINUTE_S), "min") : withUnit(fixed(seconds / HOUR_S), "h");
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
