// Histogram of δ of the tested candidates. Candidates within mean ± thr are accepted. The plot shows the range around
// zero, or the whole turn if the user wants it.

import uPlot from "../vendor/uplot/uPlot.min.js";
import { roundAbove } from "./axis.js";
import { colour } from "./colours.js";
import { byId, setText } from "./elements.js";
import { fixed } from "./format.js";
import { markLive } from "./panels.js";
import { axisStyle } from "./plot-style.js";
import { makePlot } from "./plot.js";

// The plot reaches at least this far from zero, and at least this many times thr: the peak and what is around it.
const MIN_REACH_RAD = 0.6;
const MIN_REACH_THRESHOLDS = 8;

export function makeDelta() {
    let window = null;
    const whole = byId("delta-whole");
    const paint = (plot) => window && paintThreshold(plot, window);
    const range = (_, first, last) => (window && !whole.checked ? rangeAroundZero(window) : [first ?? -1, last ?? 1]);
    const plot = makePlot(byId("delta-plot"), plotOptions(range, paint), [[], []]);
    whole.addEventListener("change", () => window && plot.setData(columnsOf(window.delta_histogram)));

    return ({ figures }) => {
        if (!figures.window?.delta_histogram) {
            return;
        }
        window = figures.window;
        plot.setData(columnsOf(window.delta_histogram));
        setText(byId("delta-summary"), describe(window));
        markLive("panel-delta");
    };
}

const plotOptions = (range, paint) => ({
    padding: [22, 32, 0, 0],
    cursor: { show: false },
    scales: {
        x: { time: false, range },
        y: { range: (_, __, most) => [0, roundAbove(Math.max(most, 10))] },
    },
    axes: [
        { ...axisStyle(), size: 28, space: 80, values: (_, splits) => splits.map(radians) },
        { ...axisStyle(), size: 52, space: 40, values: (_, splits) => splits.map(thousands) },
    ],
    series: [
        {},
        {
            width: 0,
            fill: () => colour("series-5"),
            points: { show: false },
            paths: uPlot.paths.bars({ size: [0.9, Infinity] }),
        },
    ],
    hooks: { drawAxes: [paint] },
});

function rangeAroundZero({ delta_mean_rad: mean, thr_rad: thr, delta_histogram: histogram }) {
    const { first_rad: first, last_rad: last } = histogram;
    const reach = Math.max(MIN_REACH_RAD, MIN_REACH_THRESHOLDS * (thr ?? 0), 2 * Math.abs(mean ?? 0));
    return [Math.max(first, -reach), Math.min(last, reach)];
}

function columnsOf({ first_rad: first, last_rad: last, counts }) {
    const width = (last - first) / counts.length;
    return [counts.map((_, index) => first + (index + 0.5) * width), counts];
}

// Shades the accepted range, so that the tails outside are seen at a glance.
function paintThreshold(plot, { delta_mean_rad: mean, thr_rad: thr }) {
    if (!Number.isFinite(mean) || !Number.isFinite(thr)) {
        return;
    }
    const { ctx, bbox } = plot;
    const place = (value) => Math.min(bbox.left + bbox.width, Math.max(bbox.left, plot.valToPos(value, "x", true)));
    const [low, middle, high] = [mean - thr, mean, mean + thr].map(place);
    ctx.save();
    ctx.fillStyle = colour("ok-wash");
    ctx.fillRect(low, bbox.top, high - low, bbox.height);
    ctx.fillStyle = colour("ink-soft");
    ctx.strokeStyle = colour("ink-soft");
    ctx.lineWidth = devicePixelRatio;
    ctx.textAlign = "center";
    ctx.textBaseline = "bottom";
    ctx.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    // Labels that would overlap become one.
    const width = (high - low) / devicePixelRatio;
    const names = width > 90 ? ["−thr", "mean", "+thr"] : width > 40 ? ["−thr", "", "+thr"] : ["", "mean ± thr", ""];
    for (const [x, text] of [low, middle, high].map((x, index) => [x, names[index]])) {
        ctx.fillText(text, x, bbox.top - 4 * devicePixelRatio);
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
    }
    ctx.restore();
}

const radians = (value) => `${fixed(value, 2)} rad`;
const thousands = (count) => (count >= 1000 ? `${fixed(count / 1000, count % 1000 ? 1 : 0)}k` : fixed(count));

function describe({ delta_mean_rad: mean, thr_rad: thr, sd_rad: sd, noise_sd_rad: noise }) {
    const [a, b, c, d] = [mean, thr, sd, noise].map((value) => `${fixed(value, 4)} rad`);
    return `mean ${a} · thr ±${b} · sd ${c} (noise ${d})`;
}
