// Names of stages and reasons as words. The report on a run includes this file, so it has no imports.

/** A name as words: underscores and final digits are separated. */
export const words = (name) => String(name).replaceAll("_", " ").replace(/(\d+)$/, " $1");

/** Title of a stage or a segment. `cloud_queue` becomes “Wait for cloud”. */
export const titled = (name) =>
    words(String(name).replace(/^(.*)_queue$/, "wait_for_$1")).replace(/^./, (first) => first.toUpperCase());

/** Title and colour level of each kind of drop or incident. */
export const DROP_KINDS = {
    loss: { title: "Loss", level: "error" },
    choice: { title: "By choice", level: "idle" },
    unmeasurable: { title: "Not measurable", level: "idle" },
    incident: { title: "Incident", level: "warning" },
};
