// The segments of the time from exposure to cloud, stacked over time, in percent. They add up to the total.

import { stageColour } from "./colours.js";
import { byId } from "./elements.js";
import { fixed, milliseconds } from "./format.js";
import { Legend } from "./legend.js";
import { titled } from "./names.js";
import { markLive } from "./panels.js";
import { TimePlot } from "./plot.js";

export function makeShares(hello) {
    const names = hello.segments ?? [];
    const series = names.map((name) => ({ label: titled(name), colour: stageColour(name) }));
    let samples = [];

    const showLegend = () => {
        const means = samples[plot.hovered ?? samples.length - 1]?.segments;
        const total = sum(means ?? []);
        legend.show(names.map((_, index) => describe(means?.[index], total)));
    };
    // Each area reaches from zero to the top of its segment. Areas drawn later cover the lower part.
    const areas = series.toReversed().map((entry) => ({ ...entry, width: 0, fill: entry.colour }));
    const options = { series: areas, range: () => [0, 100], unit: " %", hovered: showLegend };
    const plot = new TimePlot(byId("shares-plot"), options);
    const legend = new Legend(byId("shares-legend"), series);

    return ({ history }) => {
        samples = history.samples;
        const tops = samples.map((sample) => stackedPercent(sample.segments));
        const columns = names.map((_, index) => tops.map((top) => top?.[index] ?? null));
        plot.show(history.times(), columns.toReversed());
        showLegend();
        if (history.last) {
            markLive("panel-shares");
        }
    };
}

const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);

function stackedPercent(means) {
    const total = sum(means ?? []);
    if (total <= 0) {
        return null;
    }
    let top = 0;
    return means.map((mean) => {
        top += mean ?? 0;
        return (100 * top) / total;
    });
}

function describe(mean, total) {
    return total > 0 && Number.isFinite(mean) ? `${fixed((100 * mean) / total)} % · ${milliseconds(mean)}` : "–";
}
