// Quality of the windows over time. Each figure has its own small plot, since units and sizes differ.

import { aroundZero, fromZero } from "./axis.js";
import { byId, element, setText } from "./elements.js";
import { fixed, short, withUnit } from "./format.js";
import { markLive } from "./panels.js";
import { TimePlot } from "./plot.js";

const radians = (value) => withUnit(fixed(value, 4), "rad");
const percent = (value) => withUnit(fixed(value, 1), "%");

const FIGURES = [
    {
        label: "Noise of δ (sd)",
        hint: "Standard deviation of δ in the images. It grows with noise, motion and a drifted calibration.",
        lines: [{ colour: "series-1", read: (window) => window.sd_rad }],
        text: radians,
    },
    {
        label: "Drift of the calibration",
        hint: "Part of δ that a drifted calibration causes, and the noise of δ without it. The drift is subtracted. Calibrate again when it is beyond its limit (health.drift_rad).",
        lines: [
            { colour: "series-6", read: (window) => window.drift_rms_rad },
            { colour: "series-1", read: (window) => window.residual_sd_rad },
        ],
        text: radians,
    },
    {
        label: "Median of δ",
        hint: "It should be constant. A sudden jump means that patterns and images are out of step.",
        lines: [{ colour: "series-5", read: (window) => window.delta_median_rad }],
        text: radians,
        range: aroundZero,
    },
    {
        label: "Expected false (efc)",
        hint: "Expected false candidates for each true one. Well below 1 is good.",
        lines: [{ colour: "series-4", read: (window) => window.efc }],
        text: short,
    },
    {
        label: "Periods per segment (n)",
        hint: "Mean number of fringe periods on an epipolar segment. Rig and volume determine it.",
        lines: [{ colour: "series-9", read: (window) => window.n }],
        text: short,
    },
    {
        label: "Unique",
        hint: "Share of the valid pixels of camera 1 with one candidate only. More is better.",
        lines: [{ colour: "series-3", read: (window) => window.unique }],
        text: percent,
        range: () => [0, 100],
    },
    {
        label: "Undecided",
        hint: "Share of the pixels whose candidates could not be told apart. They yield no point.",
        lines: [{ colour: "series-8", read: (window) => window.undecided }],
        text: percent,
    },
    {
        label: "Rejected",
        hint: "Share of the pixels whose candidate contradicted others. They yield no point.",
        lines: [{ colour: "series-6", read: (window) => window.rejected }],
        text: percent,
    },
    {
        label: "Fit residuals",
        hint: "Deviation of the images of cameras 1 and 2 from a sinusoid. It grows with motion and saturation.",
        lines: [
            { colour: "series-1", read: (window) => window.residual?.[0] },
            { colour: "series-2", read: (window) => window.residual?.[1] },
        ],
        text: (value) => fixed(value, 3),
    },
    {
        label: "Motion per image",
        hint: "Phase motion from image to image of cameras 1 and 2. One pixel in twenty moves faster. Up to about 1 rad is compensated.",
        lines: [
            { colour: "series-1", read: (window) => window.fast_motion_rad?.[0] },
            { colour: "series-2", read: (window) => window.fast_motion_rad?.[1] },
        ],
        text: (value) => withUnit(fixed(value, 3), "rad"),
    },
];

export function makeQuality() {
    const holder = byId("quality-plots");
    byId("quality-help").append(
        ...FIGURES.flatMap(({ label, hint }) => [element("dt", { text: label }), element("dd", { text: hint })]),
    );
    const plots = FIGURES.map((figure) => makeSmallPlot(holder, figure));
    return ({ history }) => {
        plots.forEach((show) => show(history));
        if (history.last) {
            markLive("panel-quality");
        }
    };
}

function makeSmallPlot(holder, { label, hint, lines, text, range = fromZero }) {
    const value = element("span", { class: "small-plot-value" });
    const about = { role: "img", "aria-label": `${label}, last ten minutes` };
    const canvas = element("div", { class: "small-plot-canvas", ...about });
    const name = element("span", { class: "small-plot-label", text: label });
    const caption = element("figcaption", { title: hint }, name, value);
    holder.append(element("figure", { class: "small-plot" }, caption, canvas));
    let columns = [];
    const showValue = () => {
        const index = plot.hovered ?? columns[0]?.length - 1;
        setText(value, columns.map((column) => text(column[index])).join(" · "));
    };
    const series = lines.map((line) => ({ label, colour: line.colour }));
    const plot = new TimePlot(canvas, { series, range, small: true, hovered: showValue });

    return (history) => {
        columns = lines.map(({ read }) => history.column((sample) => sample.window && read(sample.window)));
        plot.show(history.times(), columns);
        showValue();
    };
}
