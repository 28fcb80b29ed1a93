// Elements, tables and legends. Everything from the data is set as text.

const byId = (id) => document.getElementById(id);

function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [attribute, value] of Object.entries(attributes)) {
        if (value !== undefined && value !== null) {
            made.setAttribute(attribute, value);
        }
    }
    made.append(...children);
    return made;
}

/**
 * A table. `columns` are `{ title, number, text(row), cell(row) }`: text of a cell, or its element; the first is the head of
 * each row. `emphasized(row)` sets a row off.
 */
function showTable(holder, caption, columns, rows, emphasized = () => false) {
    const style = ({ number, wide }) => (number ? "number" : wide ? "wide-cell" : undefined);
    const head = columns.map((column) => element("th", { scope: "col", class: style(column) }, column.title));
    const cells = (row) =>
        columns.map((column, index) => {
            const attributes = { class: style(column), ...(index === 0 && { scope: "row" }) };
            return element(index === 0 ? "th" : "td", attributes, column.cell ? column.cell(row) : column.text(row));
        });
    const body = rows.map((row) => element("tr", { class: emphasized(row) ? "whole" : undefined }, ...cells(row)));
    const table = element(
        "table",
        {},
        element("caption", { class: "unseen" }, caption),
        element("thead", {}, element("tr", {}, ...head)),
        element("tbody", {}, ...body),
    );
    holder.replaceChildren(rows.length > 0 ? table : element("p", { class: "summary" }, "Nothing."));
}

const swatch = (name) => element("span", { class: "swatch", style: `--swatch: var(--${name})` });

/** A name with its colour. */
const coloured = (name) => element("span", { class: "coloured" }, swatch(stageColour(name)), titled(name));

/**
 * Name, colour and value of each series. With `toggled(index, shown)` each is a button that shows or hides it. Returns a
 * function that shows the values.
 */
function makeLegend(holder, series, toggled) {
    const values = series.map(({ label, colour: name, shown = true }, index) => {
        const value = element("span", { class: "legend-value" });
        const parts = [swatch(name), element("span", { class: "legend-label" }, label), value];
        if (!toggled) {
            holder.append(element("li", {}, element("span", { class: "legend-entry" }, ...parts)));
            return value;
        }
        const state = { class: "legend-entry", type: "button", "aria-pressed": String(shown) };
        const button = element("button", state, ...parts);
        button.addEventListener("click", () => {
            const now = button.getAttribute("aria-pressed") !== "true";
            button.setAttribute("aria-pressed", String(now));
            toggled(index, now);
        });
        holder.append(element("li", {}, button));
        return value;
    });
    return (texts) => texts.forEach((text, index) => (values[index].textContent = text));
}
