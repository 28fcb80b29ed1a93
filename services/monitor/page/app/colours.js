// Colours of the style sheet for canvases, which know nothing of custom properties. A stage has one colour everywhere:
// the report on a run holds this file too, so it imports nothing.

const ofStages = {
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

/** The value that custom property `--name` has in the theme of now. */
export function colour(name) {
    if (!resolved.has(name)) {
        probe.style.color = `var(--${name})`;
        resolved.set(name, getComputedStyle(probe).color);
    }
    return resolved.get(name);
}

/** Name of the custom property for a stage or a segment. */
export const stageColour = (name) => ofStages[name] ?? "ink-soft";

/** To be called when the theme has changed. */
export const forgetColours = () => resolved.clear();
