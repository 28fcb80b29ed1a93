// The legend of a plot: name, colour and value of each series.

import { element, setText } from "./elements.js";

/**
 * A legend. `entries` are `{ label, colour, shown }`. With `toggled(index, shown)` each entry is a button that shows or
 * hides its series.
 */
export class Legend {
    #values;

    constructor(holder, entries, toggled) {
        this.#values = entries.map((entry, index) => {
            const value = element("span", { class: "legend-value" });
            holder.append(element("li", {}, makeEntry(entry, value, toggled && ((shown) => toggled(index, shown)))));
            return value;
        });
    }

    /** Shows the values, one text per entry. */
    show(texts) {
        texts.forEach((text, index) => setText(this.#values[index], text));
    }
}

function makeEntry({ label, colour, shown = true }, value, toggled) {
    const swatch = element("span", { class: "swatch" });
    swatch.style.setProperty("--swatch", `var(--${colour})`);
    const parts = [swatch, element("span", { class: "legend-label", text: label, title: label }), value];
    if (!toggled) {
        return element("span", { class: "legend-entry" }, ...parts);
    }
    const state = { class: "legend-entry", type: "button", "aria-pressed": String(shown) };
    const button = element("button", state, ...parts);
    button.addEventListener("click", () => {
        const now = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(now));
        toggled(now);
    });
    return button;
}
