// What stands in the queues, how well the cameras keep together, and how much room is left.

import { byId, setState, setText } from "./elements.js";
import { fixed, megabytes, milliseconds, withUnit } from "./format.js";
import { titled } from "./names.js";
import { markLive } from "./panels.js";
import { showRows } from "./table.js";

// Below these a scan of some minutes may no longer fit.
const LITTLE_DISK_MB = 2000;
const LITTLE_MEMORY_MB = 64;

export function showFlow({ figures }) {
    showRows(byId("flow-rows"), (figures.stages ?? []).map(cellsOf));
    showSkew(figures.skew);
    showRoom("disk-free", figures.room?.disk_free_mb, LITTLE_DISK_MB);
    showRoom("memory-free", figures.room?.shared_memory_free_mb, LITTLE_MEMORY_MB);
    setText(byId("about-clients"), `${fixed(figures.clients)} watching`);
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
    setText(byId("skew-ends"), skew ? `${fixed(skew.least_ms, 3)} to ${fixed(skew.greatest_ms, 3)} ms` : "no pairs now");
}

function showRoom(id, free, little) {
    setText(byId(id), megabytes(free));
    setState(byId(id), "level", free < little ? "error" : null);
}
