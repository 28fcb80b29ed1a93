// Whether the scanner measures as it should: what is watched from window to window, with its limits.

import { byId, setState, setText } from "./elements.js";
import { MISSING, fixed, isNumber, withUnit } from "./format.js";
import { HEALTH_LEVELS, gaugeValue } from "./gauges.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

const MINUTE_S = 60;
const HOUR_S = 3600;

export function showHealth({ figures }) {
    const health = figures.window?.health;
    const state = health?.state ?? "not known";
    const overall = byId("health-state");
    setText(overall, state);
    setState(overall, "level", HEALTH_LEVELS[state] ?? "idle");
    showRows(byId("health-rows"), (health?.quantities ?? []).map((gauge) => cellsOf(gauge, figures.health_for_s ?? {})));
    markLive("panel-health");
}

function cellsOf({ quantity, title, unit, state, level, warn, bad }, forS) {
    return [
        { head: true, text: capital(title ?? quantity), title: quantity },
        { badge: "badge", text: state, level: HEALTH_LEVELS[state] ?? "idle" },
        { number: true, text: gaugeValue(level, unit), level: state === "ok" ? null : HEALTH_LEVELS[state] },
        { number: true, text: gaugeValue(warn, unit) },
        { number: true, text: gaugeValue(bad, unit) },
        { number: true, text: since(forS[quantity]) },
    ];
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
