// Functions with which the test inspects the page. They run in an isolated world: they share the document with the
// scripts of the page, but no variables.

// Captures by number, in order of their last use. Only a few are stored: each may have a megabyte.
const captures = new Map();
let captureCount = 0;
const MAX_CAPTURES = 8;
// Smallest visible difference of a channel, 0..255.
const VISIBLE = 12;
// Smallest difference between the channels of a vivid colour, 0..255.
const VIVID = 40;

const one = (selector) => {
    const found = document.querySelector(selector);
    if (found === null) {
        throw new Error(`the page has no ${selector}`);
    }
    return found;
};

const textOf = (selector) => one(selector).textContent.trim();

/** Waits for two frames: changes requested in the first are drawn in the second. */
const settled = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))));

async function scrollToBox(selector) {
    const element = one(selector);
    element.scrollIntoView({ block: "center", inline: "center", behavior: "instant" });
    await settled();
    const { x, y, width, height } = element.getBoundingClientRect();
    if (width < 1 || height < 1) {
        throw new Error(`${selector} is not visible`);
    }
    return { x, y, width, height };
}

/** Returns the box of an element on the page, reduced by `inset` pixels at each edge, for a screenshot. */
async function pageBox(selector, inset) {
    const { x, y, width, height } = await scrollToBox(selector);
    return { x: x + scrollX + inset, y: y + scrollY + inset, width: width - 2 * inset, height: height - 2 * inset };
}

/** Returns the centre of an element, for a click. Throws an error if another element covers it. */
async function clickPoint(selector) {
    const { x, y, width, height } = await scrollToBox(selector);
    const centre = [x + width / 2, y + height / 2];
    const topmost = document.elementFromPoint(...centre);
    if (!topmost || !one(selector).contains(topmost)) {
        throw new Error(`${selector} is covered by ${nameOf(topmost)}`);
    }
    return centre;
}

const toTop = () => {
    scrollTo({ top: 0, behavior: "instant" });
    return settled();
};

function nameOf(element) {
    if (!element || element === document.body) {
        return "body";
    }
    const name = element.getAttribute("aria-label") ?? (element.innerText ?? "").trim().replace(/\s+/g, " ").slice(0, 40);
    return `${element.localName}${element.id && `#${element.id}`} “${name}”`;
}

// Captures

async function storeCapture(png) {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const { width, height } = image;
    const context = new OffscreenCanvas(width, height).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    captureCount += 1;
    captures.set(captureCount, { width, height, data });
    if (captures.size > MAX_CAPTURES) {
        captures.delete(captures.keys().next().value);
    }
    return { number: captureCount, width, height, ...statisticsOf(data) };
}

/** Statistics of RGBA pixels, as the class Capture in browser.py explains. */
function statisticsOf(data) {
    const counts = new Map();
    const hues = new Array(24).fill(0);
    const pixels = data.length / 4;
    let [vivid, sum, squares] = [0, 0, 0];
    for (let at = 0; at < data.length; at += 4) {
        const [red, green, blue] = [data[at], data[at + 1], data[at + 2]];
        const colour = ((red >> 4) << 8) | ((green >> 4) << 4) | (blue >> 4);
        counts.set(colour, (counts.get(colour) ?? 0) + 1);
        const [least, most] = [Math.min(red, green, blue), Math.max(red, green, blue)];
        if (most - least > VIVID) {
            vivid += 1;
            hues[Math.floor(24 * hueOf(red, green, blue, least, most)) % 24] += 1;
        }
        const lightness = 0.299 * red + 0.587 * green + 0.114 * blue;
        sum += lightness;
        squares += lightness * lightness;
    }
    const mean = sum / pixels;
    return {
        colours: counts.size,
        foreground: 1 - Math.max(...counts.values()) / pixels,
        vivid,
        hues: hues.filter((count) => count > 0.005 * vivid).length,
        lightness: mean,
        scatter: Math.sqrt(Math.max(0, squares / pixels - mean * mean)),
    };
}

/** Hue, 0..1 around the circle. */
function hueOf(red, green, blue, least, most) {
    const range = most - least;
    const sixths =
        most === red ? (green - blue) / range + 6 : most === green ? (blue - red) / range + 2 : (red - green) / range + 4;
    return (sixths % 6) / 6;
}

/** Returns the share of the pixels that differ visibly between two captures. */
function difference(number, otherNumber) {
    const [capture, other] = [captures.get(number), captures.get(otherNumber)];
    // Insert it again, as the one used last.
    captures.delete(otherNumber);
    captures.set(otherNumber, other);
    if (capture.width !== other.width || capture.height !== other.height) {
        return 1;
    }
    let differing = 0;
    for (let at = 0; at < capture.data.length; at += 4) {
        const differs = (channel) => Math.abs(capture.data[at + channel] - other.data[at + channel]) > VISIBLE;
        differing += differs(0) || differs(1) || differs(2) ? 1 : 0;
    }
    return (4 * differing) / capture.data.length;
}

// Panels

const livePanels = () => Object.fromEntries(allPanels().map((panel) => [panel.id, panel.dataset.live === "true"]));
const allPanels = () => [...document.querySelectorAll("[id^=panel-]")];

/** Returns the texts of a table, row by row. */
const tableOf = (selector) =>
    [...one(selector).rows].map((row) => [...row.cells].map((cell) => cell.textContent.trim()));

const eventTexts = () => [...document.querySelectorAll("#events-list .event-text")].map((text) => text.textContent);
/** Counts elements that exist only if a text was interpreted as markup. */
const injectedElements = () =>
    document.querySelectorAll("[onerror], img:not([src='/favicon.svg']), body script").length;

/** Numbers the canvases of a panel, and returns a selector for each. */
const numberCanvases = (selector) =>
    [...document.querySelectorAll(selector)].map((canvas, index) => {
        canvas.setAttribute("data-probe", String(index));
        return `${selector}[data-probe="${index}"]`;
    });

const figures = async () => (await fetch("/figures")).json();

// Connection

let connections = [];

/** Starts to record each connection state that the page shows, however briefly. */
function recordConnections() {
    connections = [currentConnection()];
    const record = () => {
        if (JSON.stringify(connections.at(-1)) !== JSON.stringify(currentConnection())) {
            connections.push(currentConnection());
        }
    };
    new MutationObserver(record).observe(document.body, { attributes: true, attributeFilter: ["data-connection"] });
    new MutationObserver(record).observe(one("#connection-banner"), { attributes: true, childList: true });
}

const currentConnection = () => ({
    state: document.body.dataset.connection,
    pill: textOf("#connection"),
    banner: one("#connection-banner").hidden ? "" : textOf("#connection-banner"),
    live: allPanels().filter((panel) => panel.dataset.live === "true").length,
});
const recordedConnections = () => connections;

// Keyboard

const CONTROLS = "a[href], button, input, select, summary, [tabindex='0']";
const controls = () => [...document.querySelectorAll(CONTROLS)];
const isShown = (element) => element.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true });

/** Returns the names of all elements that the keyboard should reach, by their index in the page. */
const controlNames = () =>
    Object.fromEntries(
        controls()
            .map((control, index) => [index, control])
            .filter(([, control]) => isShown(control))
            .map(([index, control]) => [index, nameOf(control)]),
    );

/** Returns the index of the focused element, and a problem with its visibility; null if no element has the focus. */
async function focused() {
    await settled();
    const element = document.activeElement;
    if (!element || element === document.body) {
        return null;
    }
    const index = controls().indexOf(element);
    const { outlineStyle, outlineWidth, outlineColor } = getComputedStyle(element);
    if (outlineStyle === "none" || parseFloat(outlineWidth) < 2 || /, 0\)$/.test(outlineColor)) {
        return { index, wrong: "has the focus, but no outline shows it" };
    }
    const { left, top, width, height } = element.getBoundingClientRect();
    if (left + width < 1 || top + height < 1 || left > innerWidth - 1 || top > innerHeight - 1) {
        return { index, wrong: "has the focus, but is outside the window" };
    }
    const at = [Math.max(left, 0) + Math.min(width, 20) / 2, Math.max(top, 0) + Math.min(height, 20) / 2];
    const topmost = document.elementFromPoint(...at);
    const seen = topmost && (element.contains(topmost) || topmost.contains(element));
    return { index, wrong: seen ? null : `has the focus, but is covered by ${nameOf(topmost)}` };
}

const unfocus = () => {
    document.activeElement?.blur();
    getSelection().removeAllRanges();
    return toTop();
};

// Layout

/** Lists what does not fit the width of the page, also with each explanation open in turn. */
function overflows() {
    const found = elementsTooWide();
    for (const help of document.querySelectorAll("details.help")) {
        help.open = true;
        const more = elementsTooWide().filter((text) => !found.includes(text));
        found.push(...more.map((text) => `${text}, with ${nameOf(help.querySelector("summary"))} open`));
        help.open = false;
    }
    return found;
}

function elementsTooWide() {
    const root = document.documentElement;
    const wide = root.scrollWidth > root.clientWidth ? [`the page is ${root.scrollWidth} px wide`] : [];
    const out = [...document.body.querySelectorAll("*")].filter(
        (element) =>
            isShown(element) &&
            !element.closest(".table-scroll, .skip, .unseen") &&
            extendsBeyondPage(element) &&
            // List only the outermost element.
            !extendsBeyondPage(element.parentElement),
    );
    return [...wide, ...out.map((element) => `${nameOf(element)} extends beyond the page`)];
}

function extendsBeyondPage(element) {
    const { left, right, width } = element.getBoundingClientRect();
    return width > 0 && (left < -0.5 || right > innerWidth + 0.5);
}

/** Lists tables that hide columns until they are scrolled. */
const hiddenColumns = () =>
    [...document.querySelectorAll(".table-scroll")]
        .filter((box) => isShown(box) && isCut(box))
        .map((box) => `${box.querySelector("table").id || box.id} is ${box.scrollWidth} px wide in ${box.clientWidth}`);

/** Whether an element is wholly visible without scrolling the page. */
async function isOnFirstScreen(selector) {
    await toTop();
    const { top, bottom } = one(selector).getBoundingClientRect();
    return top >= 0 && bottom <= innerHeight;
}

/** Lists texts that are cut off, or covered by the question mark of an explanation. */
const cutTexts = () =>
    [...document.querySelectorAll("dt, dd, h1, h2, button, .choice, .tile-note, .legend-label, .small-plot-label, .pill")]
        .filter((element) => isShown(element) && (isCut(element) || isCovered(element)))
        .map((element) => nameOf(element));

const isCut = (element) => element.clientWidth > 0 && element.scrollWidth > element.clientWidth + 1;

function isCovered(element) {
    const range = document.createRange();
    range.selectNodeContents(element);
    const text = range.getBoundingClientRect();
    return [...document.querySelectorAll("summary")].some((mark) => {
        const { left, right, top, bottom } = mark.getBoundingClientRect();
        return left < text.right && text.left < right && top < text.bottom && text.top < bottom;
    });
}
