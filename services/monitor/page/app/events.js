// The list of events, newest first.

import { byId, element } from "./elements.js";
import { timeOfDay } from "./format.js";
import { markLive } from "./panels.js";

const MAX_EVENTS = 200;
const LEVELS = ["info", "warning", "error"];

const list = byId("events-list");

/** Replaces all events by those of a new connection. */
export function replaceEvents(events) {
    list.replaceChildren();
    addEvents(events);
}

export function addEvents(events) {
    for (const event of events) {
        list.prepend(makeEvent(event));
    }
    while (list.childElementCount > MAX_EVENTS) {
        list.lastElementChild.remove();
    }
    byId("events-empty").hidden = list.childElementCount > 0;
}

/** Called with each message of figures: an empty list is live too. */
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
