// What happened lately, newest first.

import { byId, element } from "./elements.js";
import { timeOfDay } from "./format.js";
import { markLive } from "./panels.js";

const LIMIT = 200;
const LEVELS = ["info", "warning", "error"];

const list = byId("events-list");

/** Shows the events of a new connection in place of those before. */
export function replaceEvents(events) {
    list.replaceChildren();
    addEvents(events);
}

export function addEvents(events) {
    for (const event of events) {
        list.prepend(makeEvent(event));
    }
    while (list.childElementCount > LIMIT) {
        list.lastElementChild.remove();
    }
    byId("events-empty").hidden = list.childElementCount > 0;
}

/** An empty list is live too, as long as figures come. */
export const markEventsLive = () => markLive("panel-events");

function makeEvent({ wall_ms: time, level, source, text }) {
    const known = LEVELS.includes(level) ? level : "info";
    return element(
        "li",
        { "data-level": known },
        element("span", { class: "event-time", text: timeOfDay(time) }),
        element("span", { class: "event-level", text: known }),
        element("span", { class: "event-source", text: source ?? "" }),
        element("span", { class: "event-text", text: text ?? "" }),
    );
}
