// Plots over the last ten minutes, with the same time axis and a common cursor.

import uPlot from "../vendor/uplot/uPlot.min.js";
import { fromZero } from "./axis.js";
import { timeOfDay } from "./format.js";
import { axisStyle, lineStyle, sizeOf, timePlotOptions, valueAxis } from "./plot-style.js";

const SPAN_S = 600;
// Least span of the time axis, while there are few samples.
const MIN_SPAN_S = 10;

const plots = new Set();

/** Must be called when the theme changes. */
export const redrawPlots = () => plots.forEach((plot) => plot.redraw());

/** Makes a plot in an element, as large as the element. */
export function makePlot(holder, options, columns) {
    const plot = new uPlot({ ...sizeOf(holder), legend: { show: false }, ...options }, columns, holder);
    new ResizeObserver(() => plot.setSize(sizeOf(holder))).observe(holder);
    plots.add(plot);
    return plot;
}

/**
 * A plot over time. `series` are `{ label, colour, width, fill, shown }`, `unit` follows each label of the vertical
 * axis, `range(least, greatest)` returns the ends of that axis, and `hovered()` is called when the cursor moves.
 */
export class TimePlot {
    #plot;

    constructor(holder, { series, range = fromZero, unit = "", small = false, hovered }) {
        const options = {
            ...timePlotOptions(small),
            scales: {
                x: { range: timeRange },
                y: { range: (_, least, greatest) => range(least, greatest) },
            },
            axes: [timeAxis(small), valueAxis(small, unit, small ? 46 : 68)],
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

    /** Index into the columns at the cursor, or null. */
    get hovered() {
        return this.#plot.cursor.left >= 0 ? (this.#plot.cursor.idx ?? null) : null;
    }
}

const timeAxis = (small) => ({
    ...axisStyle(),
    show: !small,
    size: 28,
    space: 90,
    incrs: [2, 5, 10, 30, 60, 120, 300],
    values: (_, splits, _axis, _space, step) => splits.map((seconds) => clock(seconds, step)),
});

// Shows seconds only if labels are less than a minute apart.
const clock = (seconds, step) => timeOfDay(seconds * 1000).slice(0, step < 60 ? 8 : 5);

function timeRange(_, first, last) {
    if (last === null || last === undefined) {
        return [Date.now() / 1000 - MIN_SPAN_S, Date.now() / 1000];
    }
    return [Math.min(last - MIN_SPAN_S, Math.max(first, last - SPAN_S)), last];
}
