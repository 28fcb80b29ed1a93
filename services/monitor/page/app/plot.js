// Plots over the last ten minutes, all with the same axes, and a cursor that they share.

import uPlot from "../vendor/uplot/uPlot.min.js";
import { digitsOf, fromZero } from "./axis.js";
import { colour } from "./colours.js";
import { fixed, timeOfDay } from "./format.js";

const SPAN_S = 600;
// At the begin the time line starts with the first sample, and so little fills it.
const LEAST_SPAN_S = 10;
const FONT = "13px system-ui, sans-serif";

const plots = new Set();

/** To be called when the theme has changed. */
export const redrawPlots = () => plots.forEach((plot) => plot.redraw());

/** uPlot in an element, as large as the element. */
export function makePlot(holder, options, columns) {
    const size = () => ({ width: Math.max(holder.clientWidth, 50), height: Math.max(holder.clientHeight, 40) });
    const plot = new uPlot({ ...size(), legend: { show: false }, ...options }, columns, holder);
    new ResizeObserver(() => plot.setSize(size())).observe(holder);
    plots.add(plot);
    return plot;
}

export const axisStyle = () => ({
    stroke: () => colour("ink-soft"),
    font: FONT,
    grid: { stroke: () => colour("line"), width: 1 },
    ticks: { show: false },
    gap: 6,
});

/**
 * A plot over time, with `unit` at each label. `series` are `{ label, colour, width, fill, shown }`;
 * `range(least, greatest)` gives the ends of the vertical axis; `hovered()` is called when the cursor moves.
 */
export class TimePlot {
    #plot;

    constructor(holder, { series, range = fromZero, unit = "", small = false, hovered }) {
        const options = {
            padding: [10, small ? 12 : 30, small ? 6 : 0, 0],
            cursor: {
                y: false,
                drag: { x: false, y: false },
                points: { size: 7, width: 0 },
                sync: { key: "time", scales: ["x", null], setSeries: false },
            },
            scales: {
                x: { range: timeRange },
                y: { range: (_, least, greatest) => range(least, greatest) },
            },
            axes: [timeAxis(small), valueAxis(small, unit)],
            series: [{}, ...series.map(lineStyle)],
            hooks: { setCursor: [() => hovered?.()] },
        };
        this.#plot = makePlot(holder, options, [[], ...series.map(() => [])]);
    }

    show(times, columns) {
        this.#plot.setData([times, ...columns]);
    }

    setShown(index, shown) {
        this.#plot.setSeries(index + 1, { show: shown });
    }

    /** The place in the columns that the cursor points to, or null. */
    get hovered() {
        return this.#plot.cursor.left >= 0 ? (this.#plot.cursor.idx ?? null) : null;
    }
}

function lineStyle({ label, colour: name, width = 1.5, fill, shown = true }) {
    return {
        label,
        show: shown,
        width,
        stroke: () => colour(name),
        fill: fill && (() => colour(fill)),
        points: { show: false },
    };
}

const timeAxis = (small) => ({
    ...axisStyle(),
    show: !small,
    size: 28,
    space: 90,
    incrs: [2, 5, 10, 30, 60, 120, 300],
    values: (_, splits, _axis, _space, step) => splits.map((seconds) => clock(seconds, step)),
});

const valueAxis = (small, unit) => ({
    ...axisStyle(),
    size: small ? 46 : 68,
    space: small ? 24 : 36,
    values: (_, splits) => {
        const places = digitsOf(splits[1] - splits[0]);
        return splits.map((value) => fixed(value, places) + unit);
    },
});

// Seconds are told only where labels stand closer than a minute.
const clock = (seconds, step) => timeOfDay(seconds * 1000).slice(0, step < 60 ? 8 : 5);

function timeRange(_, first, last) {
    if (last === null || last === undefined) {
        return [Date.now() / 1000 - LEAST_SPAN_S, Date.now() / 1000];
    }
    return [Math.min(last - LEAST_SPAN_S, Math.max(first, last - SPAN_S)), last];
}
