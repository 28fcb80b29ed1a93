// Elements, tables and legends. All values from the data are set as text.

const byId = (id) => document.getElementById(id);

function element(name, attributes = {}, ...children) {
    const created = document.createElement(name);
    for (const [attribute, value] of Object.entries(attributes)) {
        if (value !== undefined && value !== null) {
            created.setAttribute(attribute, value);
        }
    }
    created.append(...children);
    return created;
}

/**
 * Shows a table. Each column is `{ title, number, wide, text(row), cell(row) }`: `text` returns the text of a cell, or
 * `cell` its element. The first column holds the row headings. `emphasized(row)` selects rows to emphasize.
 */
function showTable(holder, caption, columns, rows, emphasized = () => false) {
    const style = ({ number, wide }) => (number ? "number" : wide ? "wide-cell" : undefined);
    const head = columns.map((column) => element("th", { scope: "col", class: style(column) }, column.title));
    const cells = (row) =>
        columns.map((column, index) => {
            const own = index === 0 ? { scope: "row" } : { "data-title": column.title };
            const attributes = { class: style(column), ...own };
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
    holder.replaceChildren(rows.length > 0 ? table : element("p", { class: "summary" }, "None."));
}

const swatch = (name) => element("span", { class: "swatch", style: `--swatch: var(--${name})` });

/** A name with a swatch of its colour. */
const coloured = (name) => element("span", { class: "coloured" }, swatch(stageColour(name)), titled(name));

/**
 * Fills a legend with the name, colour and value of each series. With `toggled(index, shown)`, each entry is a button
 * that shows or hides its series. Returns a function that sets the values.
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
            const isShown = button.getAttribute("aria-pressed") !== "true";
            button.setAttribute("aria-pressed", String(isShown));
            toggled(index, isShown);
        });
        holder.append(element("li", {}, button));
        return value;
    });
    return (texts) => texts.forEach((text, index) => (values[index].textContent = text));
}
