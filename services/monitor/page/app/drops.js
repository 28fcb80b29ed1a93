// What was dropped, where and why: losses, then what was left out by decision, then incidents, which need cost nothing.

import { byId, setState, setText } from "./elements.js";
import { fixed, plural } from "./format.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";
import { reasonText, stageName } from "./words.js";

const KINDS = [
    { name: "loss", label: "Loss", level: "error" },
    { name: "decision", label: "Decision", level: "idle" },
    { name: "incident", label: "Incident", level: "warning" },
];

export function showDrops({ figures }) {
    const rows = (figures.stages ?? []).flatMap(rowsOf).sort(byKindThenCount);
    showSummary(rows);
    showRows(byId("drops-rows"), rows.map(cellsOf));
    byId("drops-table").hidden = rows.length === 0;
    markLive("panel-drops");
}

function rowsOf({ stage, dropped = {}, losses = [], incidents = {} }) {
    const row = (kind, reason, count) => ({ kind, stage, reason, count });
    return [
        ...Object.entries(dropped ?? {}).map(([reason, count]) =>
            row(losses?.includes(reason) ? "loss" : "decision", reason, count),
        ),
        ...Object.entries(incidents ?? {}).map(([incident, count]) => row("incident", incident, count)),
    ].filter(({ count }) => count > 0);
}

const rank = (kind) => KINDS.findIndex(({ name }) => name === kind);

function byKindThenCount(one, other) {
    return rank(one.kind) - rank(other.kind) || other.count - one.count;
}

function showSummary(rows) {
    const lost = rows.filter(({ kind }) => kind === "loss").reduce((total, { count }) => total + count, 0);
    const summary = byId("drops-summary");
    setState(summary, "level", lost > 0 ? "error" : "ok");
    setText(summary, describe(lost, rows.length));
}

function describe(lost, rows) {
    if (lost > 0) {
        return `${plural(lost, "item")} lost since the start.`;
    }
    return rows > 0 ? "Nothing lost. This was left out on purpose:" : "Nothing lost and nothing left out so far.";
}

function cellsOf({ kind, stage, reason, count }) {
    const { label, level } = KINDS[rank(kind)];
    return [
        { badge: "badge", text: label, level },
        { text: stageName(stage) },
        { text: reasonText(reason), title: reason },
        { number: true, text: fixed(count), level },
    ];
}
