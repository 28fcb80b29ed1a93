// Plots over the whole run. They have the same time axis and share the cursor.

const DAY_S = 86_400;
// With fewer points than this, each point is marked, since a line needs two.
const MARKED_POINTS = 40;

const plots = new Set();

/** Redraws every plot in the size of its holder and with the current colours. */
function redrawPlots() {
    forgetColours();
    plots.forEach(({ plot, holder }) => {
        plot.setSize(sizeOf(holder));
        plot.redraw();
    });
}

/**
 * Makes a plot over `times`, Unix seconds. `series` are `{ label, colour, width, fill, shown }`, and `columns` their
 * values. `range(least, greatest)` returns the range of the vertical axis, and `unit` follows its labels.
 * `hovered(index)` receives the index into the columns at the cursor, or null.
 */
function makePlot(holder, { times, series, columns, range = fromZero, unit = "", small = false, hovered }) {
    const options = {
        ...sizeOf(holder),
        legend: { show: false },
        ...timePlotOptions(small),
        scales: {
            x: { range: (_, first, last) => (last > first ? [first, last] : [(first ?? 0) - 1, (last ?? 0) + 1]) },
            y: { range: (_, least, greatest) => range(least, greatest) },
        },
        axes: [timeAxis(times, small), valueAxis(small, unit, small ? 50 : 72)],
        series: [{}, ...series.map((entry) => markedLineStyle(entry, times.length))],
        hooks: { setCursor: [(plot) => hovered?.(plot.cursor.left >= 0 ? (plot.cursor.idx ?? null) : null)] },
    };
    const plot = new uPlot(options, [times, ...columns], holder);
    plots.add({ plot, holder });
    new ResizeObserver(() => plot.setSize(sizeOf(holder))).observe(holder);
    return plot;
}

function markedLineStyle(entry, count) {
    const style = lineStyle(entry);
    const show = count < MARKED_POINTS && style.width > 0;
    return { ...style, points: { show, size: 5, width: 0, fill: style.stroke } };
}

function timeAxis(times, small) {
    const isLong = times.at(-1) - times[0] > DAY_S;
    const text = (seconds, step) => {
        const time = new Date(seconds * 1000);
        return step < 60 ? second(time) : isLong ? `${day(time).slice(5)} ${minute(time)}` : minute(time);
    };
    return {
        ...axisStyle(),
        show: !small,
        size: 28,
        space: isLong ? 110 : 90,
        incrs: [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14_400, 21_600, 43_200, DAY_S, 7 * DAY_S],
        values: (_, splits, _axis, _space, step) => splits.map((seconds) => text(seconds, step)),
    };
}
