// Making elements. Text goes in as text: names of devices and files come from outside and may hold markup.

/** A new element; `properties` are set on it (`class`, `text` and data or aria attributes too). */
export function element(tag, properties = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
        if (name === "class") {
            made.className = value;
        } else if (name === "text") {
            made.textContent = value;
        } else if (/^(aria|data)-|^(role|scope)$/.test(name)) {
            made.setAttribute(name, value);
        } else {
            made[name] = value;
        }
    }
    made.append(...children);
    return made;
}

export const byId = (id) => document.getElementById(id);

/** Writes text only where it differs, so that nothing is laid out or read aloud again without need. */
export function setText(target, text) {
    if (target.textContent !== text) {
        target.textContent = text;
    }
}

/** Sets or removes an attribute of state, such as `data-level`. */
export function setState(target, name, value) {
    if (value === null || value === undefined) {
        delete target.dataset[name];
    } else if (target.dataset[name] !== value) {
        target.dataset[name] = value;
    }
}
