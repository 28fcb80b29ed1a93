// Creates and changes elements. Text is never parsed as HTML: names of devices and files come from outside and may
// contain markup.

/** Creates an element and sets `properties` on it, including `class`, `text`, and data and aria attributes. */
export function element(tag, properties = {}, ...children) {
    const created = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (name === "class") {
            created.className = value;
        } else if (name === "text") {
            created.textContent = value;
        } else if (/^(aria|data)-|^(role|scope)$/.test(name)) {
            created.setAttribute(name, value);
        } else {
            created[name] = value;
        }
    }
    created.append(...children);
    return created;
}

export const byId = (id) => document.getElementById(id);

/** Sets the text if it differs, so that nothing is laid out or read aloud again without need. */
export function setText(target, text) {
    if (target.textContent !== text) {
        target.textContent = text;
    }
}

/** Sets a state such as `data-level`, or removes it if the value is null or undefined. */
export function setState(target, name, value) {
    if (value === null || value === undefined) {
        delete target.dataset[name];
    } else if (target.dataset[name] !== value) {
        target.dataset[name] = value;
    }
}
