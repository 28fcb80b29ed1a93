// Style of plots over time. The report on a run includes this file too, after those it imports from.

import { digitsOf } from "./axis.js";
import { colour } from "./colours.js";
import { fixed } from "./format.js";

const FONT = "13px system-ui, sans-serif";

/** Size of an element, at least 50 × 40 px. */
export const sizeOf = (holder) => ({
    width: Math.max(holder.clientWidth, 50),
    height: Math.max(holder.clientHeight, 40),
});

/** Padding and cursor. All plots over time share the cursor. */
export const timePlotOptions = (small) => ({
    padding: [10, small ? 12 : 30, small ? 6 : 0, 0],
    cursor: {
        y: false,
        drag: { x: false, y: false },
        points: { size: 7, width: 0 },
        sync: { key: "time", scales: ["x", null], setSeries: false },
    },
});

export const axisStyle = () => ({
    stroke: () => colour("ink-soft"),
    font: FONT,
    grid: { stroke: () => colour("line"), width: 1 },
    ticks: { show: false },
    gap: 6,
});

/** Vertical axis, `size` pixels wide, with `unit` after each label. */
export const valueAxis = (small, unit, size) => ({
    ...axisStyle(),
    size,
    space: small ? 24 : 36,
    values: (_, splits) => {
        const places = digitsOf(splits[1] - splits[0]);
        return splits.map((value) => fixed(value, places) + unit);
    },
});

/** Line style of a series `{ label, colour, width, fill, shown }`. */
export const lineStyle = ({ label, colour: name, width = 1.5, fill, shown = true }) => ({
    label,
    show: shown,
    width,
    stroke: () => colour(name),
    fill: fill && (() => colour(fill)),
    points: { show: false },
});
