// What was dropped, where and why: losses, then items skipped on purpose, then incidents, which may have cost nothing.

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
    setText(summary, describe(lost ? losses : null, drops.length));
}

function describe(losses, rows) {
    if (losses) {
        return `Since the start: ${losses}.`;
    }
    return rows > 0 ? "Nothing lost. Decisions and incidents:" : "Nothing lost or skipped so far.";
}

function cellsOf({ kind, stage, reason, meaning, count }) {
    const { title, level } = DROP_KINDS[kind];
    return [
        { badge: "badge", text: title, level },
        { text: titled(stage) },
        { text: meaning, title: reason },
        { number: true, text: fixed(count), level },
    ];
}
