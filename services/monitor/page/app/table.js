// Rows of a table. They are changed in place, so that selections and tooltips stay.

import { element, setState, setText } from "./elements.js";

/** Shows `rows` of cells `{ text, number, head, badge, level, title }`. `badge` is a class for the text of a cell. */
export function showRows(body, rows) {
    while (body.rows.length > rows.length) {
        body.lastElementChild.remove();
    }
    rows.forEach((cells, index) => {
        const row = body.rows[index] ?? body.appendChild(makeRow(cells));
        cells.forEach((cell, column) => showCell(row.cells[column], cell));
    });
}

const makeRow = (cells) => element("tr", {}, ...cells.map(makeCell));

function makeCell({ head, number, badge }) {
    const text = element("span", badge ? { class: badge } : {});
    return head ? element("th", { scope: "row" }, text) : element("td", number ? { class: "number" } : {}, text);
}

function showCell(cell, { text, level, title }) {
    const holder = cell.firstElementChild;
    setText(holder, text);
    setState(holder, "level", level);
    if (cell.title !== (title ?? "")) {
        cell.title = title ?? "";
    }
}
