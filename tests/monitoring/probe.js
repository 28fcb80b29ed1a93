// What the test looks at the page with. It runs in a world of its own: it sees what the page's scripts see, not what they
// hold, and they do not see it.

// By number; the one used last is the last. Not more are kept: each may have a megabyte.
const looks = new Map();
let looked = 0;
const KEPT = 8;
// Steps of a channel, 0..255, that make a colour another.
const VISIBLE = 12;
const VIVID = 40;

const one = (selector) => {
    const found = document.querySelector(selector);
    if (found === null) {
        throw new Error(`the page has no ${selector}`);
    }
    return found;
};

const textOf = (selector) => one(selector).textContent.trim();

/** Two frames: what was asked for in the one is drawn in the other. */
const settled = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))));

async function shownPart(selector) {
    const element = one(selector);
    element.scrollIntoView({ block: "center", inline: "center", behavior: "instant" });
    await settled();
    const { x, y, width, height } = element.getBoundingClientRect();
    if (width < 1 || height < 1) {
        throw new Error(`${selector} is not to be seen`);
    }
    return { x, y, width, height };
}

/** Where an element is on the page, without so many pixels at each edge, for a picture of it. */
async function placeOf(selector, inset) {
    const { x, y, width, height } = await shownPart(selector);
    return { x: x + scrollX + inset, y: y + scrollY + inset, width: width - 2 * inset, height: height - 2 * inset };
}

/** Where to click at; only what lies on top there can be meant. */
async function middleOf(selector) {
    const { x, y, width, height } = await shownPart(selector);
    const middle = [x + width / 2, y + height / 2];
    const there = document.elementFromPoint(...middle);
    if (!there || !one(selector).contains(there)) {
        throw new Error(`${selector} is covered by ${nameOf(there)}`);
    }
    return middle;
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

// Looks

async function keepLook(png) {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const { width, height } = image;
    const context = new OffscreenCanvas(width, height).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    looked += 1;
    looks.set(looked, { width, height, data });
    if (looks.size > KEPT) {
        looks.delete(looks.keys().next().value);
    }
    return { number: looked, width, height, ...factsOf(data) };
}

function factsOf(data) {
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

/** 0..1 around the circle. */
function hueOf(red, green, blue, least, most) {
    const range = most - least;
    const sixths =
        most === red ? (green - blue) / range + 6 : most === green ? (blue - red) / range + 2 : (red - green) / range + 4;
    return (sixths % 6) / 6;
}

/** Share of the pixels that are visibly others. */
function difference(number, otherNumber) {
    const [look, other] = [looks.get(number), looks.get(otherNumber)];
    looks.delete(otherNumber);
    looks.set(otherNumber, other);
    if (look.width !== other.width || look.height !== other.height) {
        return 1;
    }
    let others = 0;
    for (let at = 0; at < look.data.length; at += 4) {
        const far = (channel) => Math.abs(look.data[at + channel] - other.data[at + channel]) > VISIBLE;
        others += far(0) || far(1) || far(2) ? 1 : 0;
    }
    return (4 * others) / look.data.length;
}

// Panels

const livePanels = () => Object.fromEntries(allPanels().map((panel) => [panel.id, panel.dataset.live === "true"]));
const allPanels = () => [...document.querySelectorAll("[id^=panel-]")];

/** The texts of a table, row by row. */
const tableOf = (selector) =>
    [...one(selector).rows].map((row) => [...row.cells].map((cell) => cell.textContent.trim()));

const eventTexts = () => [...document.querySelectorAll("#events-list .event-text")].map((text) => text.textContent);
/** Elements that only a text could have made that was taken for markup. */
const intruders = () => document.querySelectorAll("[onerror], img:not([src='/favicon.svg']), body script").length;

/** Adds numbers, so that each of several canvases of a panel can be looked at by a selector. */
const numberCanvases = (selector) =>
    [...document.querySelectorAll(selector)].map((canvas, index) => {
        canvas.setAttribute("data-probe", String(index));
        return `${selector}[data-probe="${index}"]`;
    });

const figures = async () => (await fetch("/figures")).json();

// Connection

let connections = [];

/** From now on notes each state of the connection that the page shows, however short. */
function noteConnections() {
    connections = [connectionNow()];
    const note = () => {
        if (JSON.stringify(connections.at(-1)) !== JSON.stringify(connectionNow())) {
            connections.push(connectionNow());
        }
    };
    new MutationObserver(note).observe(document.body, { attributes: true, attributeFilter: ["data-connection"] });
    new MutationObserver(note).observe(one("#connection-banner"), { attributes: true, childList: true });
}

const connectionNow = () => ({
    state: document.body.dataset.connection,
    pill: textOf("#connection"),
    banner: one("#connection-banner").hidden ? "" : textOf("#connection-banner"),
    live: allPanels().filter((panel) => panel.dataset.live === "true").length,
});
const notedConnections = () => connections;

// Keyboard

const CONTROLS = "a[href], button, input, select, summary, [tabindex='0']";
const controls = () => [...document.querySelectorAll(CONTROLS)];
const isShown = (element) => element.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true });

/** Names of all that the keyboard should get to, by their place in the page. */
const controlNames = () =>
    Object.fromEntries(
        controls()
            .map((control, place) => [place, control])
            .filter(([, control]) => isShown(control))
            .map(([place, control]) => [place, nameOf(control)]),
    );

/** What has the focus, and what is wrong with how it is seen; null where nothing has it. */
async function focused() {
    await settled();
    const element = document.activeElement;
    if (!element || element === document.body) {
        return null;
    }
    const place = controls().indexOf(element);
    const { outlineStyle, outlineWidth, outlineColor } = getComputedStyle(element);
    if (outlineStyle === "none" || parseFloat(outlineWidth) < 2 || /, 0\)$/.test(outlineColor)) {
        return { place, wrong: "no outline shows that it has the focus" };
    }
    const { left, top, width, height } = element.getBoundingClientRect();
    if (left + width < 1 || top + height < 1 || left > innerWidth - 1 || top > innerHeight - 1) {
        return { place, wrong: "is out of sight while it has the focus" };
    }
    const at = [Math.max(left, 0) + Math.min(width, 20) / 2, Math.max(top, 0) + Math.min(height, 20) / 2];
    const there = document.elementFromPoint(...at);
    const seen = there && (element.contains(there) || there.contains(element));
    return { place, wrong: seen ? null : `is covered by ${nameOf(there)} while it has the focus` };
}

const unfocus = () => {
    document.activeElement?.blur();
    getSelection().removeAllRanges();
    return toTop();
};

// Layout

/** What does not fit across, with every explanation open in turn. */
function overflows() {
    const found = tooWide();
    for (const help of document.querySelectorAll("details.help")) {
        help.open = true;
        const more = tooWide().filter((text) => !found.includes(text));
        found.push(...more.map((text) => `${text}, with ${nameOf(help.querySelector("summary"))} open`));
        help.open = false;
    }
    return found;
}

function tooWide() {
    const root = document.documentElement;
    const wide = root.scrollWidth > root.clientWidth ? [`the page is ${root.scrollWidth} px wide`] : [];
    const out = [...document.body.querySelectorAll("*")].filter(
        (element) =>
            isShown(element) &&
            !element.closest(".table-scroll, .skip, .unseen") &&
            reachesOut(element) &&
            // The outermost says it all.
            !reachesOut(element.parentElement),
    );
    return [...wide, ...out.map((element) => `${nameOf(element)} reaches out of the page`)];
}

function reachesOut(element) {
    const { left, right, width } = element.getBoundingClientRect();
    return width > 0 && (left < -0.5 || right > innerWidth + 0.5);
}

/** Texts that are cut or that a question mark covers, which nobody sees in full. */
const cutTexts = () =>
    [...document.querySelectorAll("dt, dd, h1, h2, button, .choice, .legend-label, .small-plot-label, .pill")]
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
