// State of the tracking below the cloud: whether the scanner is tracked, and how well its pose is known.

import { byId, setState, setText } from "./elements.js";
import { plural, short, withUnit } from "./format.js";

// Whether the instance made a model at the last connection; null before the first.
let wasTracked = null;

/** Offers the model if the instance makes one, and shows it until the user chooses the last cloud. */
export function startTracking({ tracked }) {
    byId("cloud-source-choice").hidden = !tracked;
    byId("tracking-state").hidden = !tracked;
    if (tracked !== wasTracked) {
        wasTracked = tracked;
        byId("cloud-source").value = tracked ? "model" : "cloud";
        byId("cloud-source").dispatchEvent(new Event("change"));
    }
}

export function showTracking({ figures: { tracking } }) {
    const line = byId("tracking-state");
    setText(line, tracking ? describe(tracking) : "not tracked yet");
    setState(line, "level", tracking?.state === "lost" ? "error" : null);
}

function describe({ state, reason, sd_mm: sd, model_points: points, model_clouds: clouds }) {
    const model = `model ${plural(points, "point")} of ${plural(clouds, "cloud")}`;
    switch (state) {
        case "tracked":
            return `tracked, sd ${withUnit(short(1000 * sd), "µm")} · ${model}`;
        case "lost":
            return `lost: ${(reason ?? "").replaceAll("_", " ")} · ${model}`;
        default:
            return `no cloud · ${model}`;
    }
}
