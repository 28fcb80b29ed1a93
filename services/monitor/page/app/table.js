// Rows of a table. They are changed in place, so that selections and tooltips stay.

import { element, setState, setText } from "./elements.js";

/** Shows `rows` of cells `{ text, number, head, badge, level, title }`. `badge` is a class for the text of a cell. */
export function showRows(body, rows) {
    while (body.rows.length > rows.length) {
        body.lastElementChild.remove();
    }
    const titles = [...body.parentElement.tHead.rows[0].cells].map((cell) => cell.textContent);
    rows.forEach((cells, index) => {
        const row = body.rows[index] ?? body.appendChild(makeRow(cells, titles));
        cells.forEach((cell, column) => showCell(row.cells[column], cell));
    });
}

const makeRow = (cells, titles) => element("tr", {}, ...cells.map((cell, column) => makeCell(cell, titles[column])));

// On narrow screens, where the head is hidden, each cell shows its title.
function makeCell({ head, number, badge }, title) {
    const text = element("span", badge ? { class: badge } : {});
    const attributes = { "data-title": title, ...(number && { class: "number" }) };
    return head ? element("th", { scope: "row" }, text) : element("td", attributes, text);
}

function showCell(cell, { text, level, title }) {
    const holder = cell.firstElementChild;
    setText(holder, text);
    setState(holder, "level", level);
    if (cell.title !== (title ?? "")) {
        cell.title = title ?? "";
    }
}
