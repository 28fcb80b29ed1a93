// Colours of the style sheet for canvases, which cannot use custom properties. A stage has the same colour everywhere.
// The report on a run includes this file, so it has no imports.

const namesByStage = {
    total: "ink",
    camera: "series-1",
    camera1: "series-1",
    camera2: "series-2",
    projector: "series-9",
    pattern: "series-10",
    pairing: "series-3",
    windowing: "series-8",
    phase: "series-4",
    correspondence_queue: "series-5-soft",
    correspondence: "series-5",
    cloud_queue: "series-6-soft",
    cloud: "series-6",
    recorder: "series-7",
};

const resolved = new Map();
const probe = document.createElement("span");
probe.hidden = true;
document.documentElement.append(probe);

/** Value of the custom property `--name` in the current theme. */
export function colour(name) {
    if (!resolved.has(name)) {
        probe.style.color = `var(--${name})`;
        resolved.set(name, getComputedStyle(probe).color);
    }
    return resolved.get(name);
}

/** Name of the custom property for a stage or a segment. */
export const stageColour = (name) => namesByStage[name] ?? "ink-soft";

/** Must be called when the theme changes. */
export const forgetColours = () => resolved.clear();
