// The key figures, which show at a glance whether the scan runs well.

import { byId, setState, setText } from "./elements.js";
import { MISSING, fixed, milliseconds, short, withUnit } from "./format.js";
import { HEALTH_LEVELS, describeDrift, describeHealth } from "./gauges.js";
import { markLive } from "./panels.js";

const MINUTE_MS = 60_000;

export function showKeyFigures({ figures, history }) {
    const { sample, window } = figures;
    const wholeRun = figures.exposure_to_cloud;
    showFigure("cloud-rate", fixed(sample?.rates?.cloud, 1), describeCameras(sample?.rates));
    showFigure("latency-p50", short(sample?.total?.[0]), `whole run ${milliseconds(wholeRun?.p50_ms)}`);
    showFigure("latency-p99", short(sample?.total?.[2]), `whole run ${milliseconds(wholeRun?.p99_ms)}`);
    showFigure("points", fixed(window?.points), "in the last cloud");
    showLosses(figures, history);
    showFigure("efc", short(window?.efc), `efc; ${withUnit(fixed(window?.puc, 1), "%")} unique`);
    showDrift(window);
    showHealth(window?.health);
    markLive("panel-key-figures");
}

function showDrift(window) {
    const { level, isBeyond, note } = describeDrift(window);
    showFigure("drift", level, note);
    setState(byId("tile-drift"), "level", isBeyond ? "error" : null);
}

function showHealth(health) {
    const state = health?.state ?? MISSING;
    showFigure("health", state, health ? describeHealth(health.quantities) : "no window yet");
    setState(byId("tile-health"), "level", HEALTH_LEVELS[state] ?? null);
}

function showFigure(name, value, note) {
    const figure = byId(`figure-${name}`);
    setText(figure, value);
    setState(figure, "missing", value === MISSING ? "" : null);
    // Before the first value, a note would only repeat that there is none.
    setText(byId(`note-${name}`), note.includes(MISSING) ? "" : note);
}

function describeCameras(rates) {
    // A window needs images of both cameras, so the slower one counts.
    const rate = Math.min(rates?.camera1 ?? NaN, rates?.camera2 ?? NaN);
    return `from ${withUnit(fixed(rate, 1), "images/s")}`;
}

function showLosses(figures, history) {
    if (!figures.sample?.lost) {
        showFigure("lost", MISSING, "");
        return;
    }
    const total = figures.sample.lost.images;
    const recent = total - (history.firstWithin(MINUTE_MS)?.lost?.images ?? 0);
    showFigure("lost", fixed(total), recent > 0 ? `${fixed(recent)} in the last minute` : "none in the last minute");
    setState(byId("tile-lost"), "level", recent > 0 ? "error" : total > 0 ? "warning" : "ok");
}
