// The program's short names as words. The report on a run holds this file too, so it imports nothing.

export const words = (name) => String(name).replaceAll("_", " ").replace(/(\d+)$/, " $1");

/** A stage or a part of the way as a title: a queue is where one waits. */
export const titled = (name) =>
    words(String(name).replace(/^(.*)_queue$/, "wait_for_$1")).replace(/^./, (first) => first.toUpperCase());

/** How much it matters that something was dropped or survived: its title, and the level it is coloured by. */
export const DROP_KINDS = {
    loss: { title: "Loss", level: "error" },
    decision: { title: "Decision", level: "idle" },
    incident: { title: "Incident", level: "warning" },
};
