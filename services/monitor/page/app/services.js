// The services of the instance and their state.

import { byId } from "./elements.js";
import { fixed, megabytes, withUnit } from "./format.js";
import { titled } from "./names.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

const LEVELS = { ok: "ok", slow: "warning", silent: "error", restarting: "warning" };

export function showServices({ figures }) {
    showRows(byId("services-rows"), (figures.services ?? []).map(cellsOf));
    markLive("panel-services");
}

function cellsOf({ name, state, why, pid, restarts, cpu_percent: cpu, memory_mb: memory, stages }) {
    return [
        { head: true, text: name ?? "–", title: describe(pid, stages) },
        { badge: "badge", text: state ?? "unknown", level: LEVELS[state] ?? "idle" },
        { badge: "why", text: why ?? "" },
        { number: true, text: fixed(restarts), level: restarts > 0 ? "warning" : null },
        { number: true, text: withUnit(fixed(cpu, 1), "%") },
        { number: true, text: megabytes(memory) },
    ];
}

function describe(pid, stages) {
    const process = pid ? `Process ${pid}` : "No process";
    return stages?.length ? `${process}, runs ${stages.map(titled).join(", ")}` : process;
}
