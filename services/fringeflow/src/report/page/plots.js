// Plots over the whole run, all with the same time axis, and a cursor that they share.

const FONT = "13px system-ui, sans-serif";
const DAY_S = 86_400;
// Where there are fewer points than this, each is marked: a line needs two.
const FEW = 40;

const plots = new Set();

/** Every plot in the size of its place and in the colours of now. */
function redrawPlots() {
    forgetColours();
    plots.forEach(({ plot, size }) => {
        plot.setSize(size());
        plot.redraw();
    });
}

/**
 * A plot over `times`, Unix seconds. `series` are `{ label, colour, width, fill, shown }`, `columns` their values;
 * `range(least, greatest)` gives the ends of the vertical axis, `unit` stands at its labels; `hovered(index)` is told the place
 * in the columns that the cursor points to, or null.
 */
function makePlot(holder, { times, series, columns, range = fromZero, unit = "", small = false, hovered }) {
    const size = () => ({ width: Math.max(holder.clientWidth, 50), height: Math.max(holder.clientHeight, 40) });
    const options = {
        ...size(),
        legend: { show: false },
        padding: [10, small ? 12 : 30, small ? 6 : 0, 0],
        cursor: {
            y: false,
            drag: { x: false, y: false },
            points: { size: 7, width: 0 },
            sync: { key: "time", scales: ["x", null], setSeries: false },
        },
        scales: {
            x: { range: (_, first, last) => (last > first ? [first, last] : [(first ?? 0) - 1, (last ?? 0) + 1]) },
            y: { range: (_, least, greatest) => range(least, greatest) },
        },
        axes: [timeAxis(times, small), valueAxis(small, unit)],
        series: [{}, ...series.map((entry) => lineStyle(entry, times.length))],
        hooks: { setCursor: [(plot) => hovered?.(plot.cursor.left >= 0 ? (plot.cursor.idx ?? null) : null)] },
    };
    const plot = new uPlot(options, [times, ...columns], holder);
    plots.add({ plot, size });
    new ResizeObserver(() => plot.setSize(size())).observe(holder);
    return plot;
}

function lineStyle({ label, colour: name, width = 1.5, fill, shown = true }, count) {
    return {
        label,
        show: shown,
        width,
        stroke: () => colour(name),
        fill: fill && (() => colour(fill)),
        points: { show: count < FEW && width > 0, size: 5, width: 0, fill: () => colour(name) },
    };
}

const axisStyle = () => ({
    stroke: () => colour("ink-soft"),
    font: FONT,
    grid: { stroke: () => colour("line"), width: 1 },
    ticks: { show: false },
    gap: 6,
});

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

const valueAxis = (small, unit) => ({
    ...axisStyle(),
    size: small ? 50 : 72,
    space: small ? 24 : 36,
    values: (_, splits) => {
        const places = digitsOf(splits[1] - splits[0]);
        return splits.map((value) => fixed(value, places) + unit);
    },
});
