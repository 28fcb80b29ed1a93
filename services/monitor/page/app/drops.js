// What was dropped, where and why: losses, then what was left out by choice or could not be measured, then incidents,
// which may have cost nothing.

import { byId, setState, setText } from "./elements.js";
import { fixed } from "./format.js";
import { DROP_KINDS, titled } from "./names.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

export function showDrops({ figures }) {
    const drops = figures.drops ?? [];
    showSummary(drops, figures.losses);
    showRows(byId("drops-rows"), drops.map(cellsOf));
    byId("drops-table").hidden = drops.length === 0;
    markLive("panel-drops");
}

function showSummary(drops, losses) {
    const lost = drops.some(({ kind }) => kind === "loss");
    const summary = byId("drops-summary");
    setState(summary, "level", lost ? "error" : "ok");
    setText(summary, losses ? `Since the start: ${losses}.` : "");
}

function cellsOf({ kind, stage, reason, meaning, setting, count }) {
    const { title, level } = DROP_KINDS[kind];
    return [
        { badge: "badge", text: title, level },
        { text: titled(stage) },
        { text: setting ? `${meaning} (${setting})` : meaning, title: reason },
        { number: true, text: fixed(count), level },
    ];
}
