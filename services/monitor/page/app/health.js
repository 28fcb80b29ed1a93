// The health of the scanner: quantities that are watched from window to window, with their limits.

import { byId, setState, setText } from "./elements.js";
import { MISSING, capitalized, fixed, isNumber, withUnit } from "./format.js";
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
    const secondsInState = figures.health_for_s ?? {};
    showRows(byId("health-rows"), (health?.quantities ?? []).map((gauge) => cellsOf(gauge, secondsInState)));
    markLive("panel-health");
}

function cellsOf({ quantity, title, unit, state, level, warn, bad }, secondsInState) {
    return [
        { head: true, text: capitalized(title ?? quantity), title: quantity },
        { badge: "badge", text: state, level: HEALTH_LEVELS[state] ?? "idle" },
        { number: true, text: gaugeValue(level, unit), level: state === "ok" ? null : HEALTH_LEVELS[state] },
        { number: true, text: gaugeValue(warn, unit) },
        { number: true, text: gaugeValue(bad, unit) },
        { number: true, text: durationText(secondsInState[quantity]) },
    ];
}

function durationText(seconds) {
    if (!isNumber(seconds)) {
        return MISSING;
    }
    if (seconds < 2 * MINUTE_S) {
        return withUnit(fixed(seconds), "s");
    }
    return seconds < 2 * HOUR_S ? withUnit(fixed(seconds / MINUTE_S), "min") : withUnit(fixed(seconds / HOUR_S), "h");
}
