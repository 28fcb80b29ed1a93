// Waiting items, skew of the cameras, and free space.

import { byId, setState, setText } from "./elements.js";
import { capitalized, fixed, megabytes, milliseconds, plural, withUnit } from "./format.js";
import { titled } from "./names.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

const LOW_MEMORY_MB = 64;

export function showFlow({ figures }) {
    showRows(byId("flow-rows"), (figures.stages ?? []).map(cellsOf));
    showSkew(figures.skew);
    const { disk_free_mb: disk, shared_memory_free_mb: memory } = figures.room ?? {};
    showFreeSpace("disk-free", disk, figures.recorder?.is_short);
    showFreeSpace("memory-free", memory, memory < LOW_MEMORY_MB);
    setText(byId("disk-note"), capitalized(figures.recorder?.text ?? "free for recordings"));
    setText(byId("about-clients"), `${plural(figures.clients, "page")} connected`);
    markLive("panel-flow");
}

function cellsOf({ stage, rate_hz: rate, waiting, in_work: inWork, latency }) {
    const number = (text) => ({ number: true, text });
    return [
        { head: true, text: titled(stage) },
        number(withUnit(fixed(rate, 1), "/s")),
        number(fixed(waiting)),
        number(fixed(inWork)),
        number(milliseconds(latency?.p50_ms)),
        number(milliseconds(latency?.p99_ms)),
    ];
}

function showSkew(skew) {
    setText(byId("skew"), withUnit(fixed(skew?.mean_ms, 3), "ms"));
    setText(byId("skew-ends"), skew ? `${fixed(skew.least_ms, 3)} to ${fixed(skew.greatest_ms, 3)} ms` : "no pairs");
}

function showFreeSpace(id, free, isLow) {
    setText(byId(id), megabytes(free));
    setState(byId(id), "level", isLow ? "error" : null);
}
