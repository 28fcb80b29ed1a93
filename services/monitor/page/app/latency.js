// Timeline of the latency from exposure to cloud, and of each stage.

import { stageColour } from "./colours.js";
import { byId } from "./elements.js";
import { milliseconds } from "./format.js";
import { Legend } from "./legend.js";
import { titled } from "./names.js";
import { markLive } from "./panels.js";
import { TimePlot } from "./plot.js";

// Lines that are shown at first. Most other stages take microseconds; one click shows them.
const SHOWN = ["total", "phase", "correspondence", "cloud"];
const PERCENTILES = { p50: 0, p90: 1, p99: 2 };

export function makeLatency(hello) {
    const names = ["total", ...(hello.stages ?? [])];
    const series = names.map((name) => ({
        label: titled(name),
        colour: stageColour(name),
        shown: SHOWN.includes(name),
        ...(name === "total" && { width: 2.5, fill: "ink-wash" }),
    }));
    const select = byId("latency-percentile");
    let history = null;
    let columns = [];

    const showLegend = () => {
        const index = plot.hovered ?? columns[0]?.length - 1;
        legend.show(columns.map((column) => milliseconds(column[index])));
    };
    const plot = new TimePlot(byId("latency-plot"), { series, unit: " ms", hovered: showLegend });
    const legend = new Legend(byId("latency-legend"), series, (index, shown) => plot.setShown(index, shown));

    const show = () => {
        const percentile = PERCENTILES[select.value];
        columns = names.map((name) =>
            history.column((sample) => (name === "total" ? sample.total : sample.stages?.[name])?.[percentile]),
        );
        plot.show(history.times(), columns);
        showLegend();
    };
    select.addEventListener("change", () => history && show());

    return (view) => {
        history = view.history;
        show();
        if (history.last) {
            markLive("panel-latency");
        }
    };
}
