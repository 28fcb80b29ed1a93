// What was dropped, where and why: losses, then what was left out by decision, then incidents, which need cost nothing.

import { byId, setState, setText } from "./elements.js";
import { fixed, plural } from "./format.js";
import { DROP_KINDS, titled } from "./names.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

export function showDrops({ figures }) {
    const drops = figures.drops ?? [];
    showSummary(drops);
    showRows(byId("drops-rows"), drops.map(cellsOf));
    byId("drops-table").hidden = drops.length === 0;
    markLive("panel-drops");
}

function showSummary(drops) {
    const lost = drops.filter(({ kind }) => kind === "loss").reduce((total, { count }) => total + count, 0);
    const summary = byId("drops-summary");
    setState(summary, "level", lost > 0 ? "error" : "ok");
    setText(summary, describe(lost, drops.length));
}

function describe(lost, rows) {
    if (lost > 0) {
        return `${plural(lost, "item")} lost since the start.`;
    }
    return rows > 0 ? "Nothing lost. This was left out on purpose:" : "Nothing lost and nothing left out so far.";
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
