// The page: receives the monitor's messages, keeps the history for the plots, and updates the panels.

import { forgetColours } from "./colours.js";
import { makeCloudView } from "./cloud.js";
import { Commands } from "./commands.js";
import { Connection } from "./connection.js";
import { makeDelta } from "./delta.js";
import { oncePerFrame } from "./drawing.js";
import { showDrops } from "./drops.js";
import { byId } from "./elements.js";
import { addEvents, markEventsLive, replaceEvents } from "./events.js";
import { showFlow } from "./flow.js";
import { showHealth } from "./health.js";
import { startHelp } from "./help.js";
import { History } from "./history.js";
import { showKeyFigures } from "./key-figures.js";
import { makeLatency } from "./latency.js";
import { markAllStale } from "./panels.js";
import { showPictures, startPictures } from "./pictures.js";
import { redrawPlots } from "./plot.js";
import { makeQuality } from "./quality.js";
import { makeRates } from "./rates.js";
import { showServices } from "./services.js";
import { makeShares } from "./shares.js";
import { showConnection, showInstance, showState } from "./status.js";
import { startTheme } from "./theme.js";
import { showTracking, startTracking } from "./tracking.js";

const history = new History();
const cloudView = makeCloudView();
const commands = new Commands(applyState);
let build = null;
let panels = [];
let figures = null;

const drawPanels = oncePerFrame(() => panels.forEach((show) => show({ figures, history })));

const handlers = {
    hello: handleHello,
    figures: handleFigures,
    events: ({ events }) => addEvents(events ?? []),
    pictures: showPictures,
    cloud: (message, reply) => cloudView?.show(message, reply),
    model: (message, reply) => cloudView?.show(message, reply),
};

const connection = new Connection(new URL("/live", location.href.replace(/^http/, "ws")), {
    opened: sendWanted,
    message: (message, reply) => handlers[message.type]?.(message, reply),
    unreadable: ({ message }) =>
        addEvents([{ wall_ms: Date.now(), level: "error", source: "page", text: `cannot show a message: ${message}` }]),
    state: handleConnection,
});

function handleHello(hello) {
    // After an update of the monitor, the loaded page may not fit its messages.
    const builtFor = JSON.stringify([hello.version, hello.stages, hello.segments]);
    if (build !== null && build !== builtFor) {
        location.reload();
        return;
    }
    if (build === null) {
        build = builtFor;
        panels = [
            showKeyFigures,
            makeLatency(hello),
            makeShares(hello),
            makeRates(),
            makeQuality(),
            makeDelta(),
            showHealth,
            showServices,
            showDrops,
            showFlow,
            markEventsLive,
            showTracking,
        ];
    }
    showInstance(hello);
    startTracking(hello);
    history.replace(hello.history ?? []);
    replaceEvents(hello.events ?? []);
}

function handleFigures(message) {
    figures = message;
    history.add(message.sample);
    applyState(message.state ?? {}, message);
    cloudView?.showPreparation(message.preparation ?? null);
    drawPanels();
}

function applyState(state, { preparation = null, recorder = null } = figures ?? {}) {
    showState(state, preparation, recorder);
    commands.showState(state);
}

function handleConnection(state) {
    showConnection(state);
    if (state.name === "live") {
        return;
    }
    markAllStale();
    if (state.name === "reconnecting") {
        commands.showState(null);
    }
}

// Tells the server which large messages it should send: none while the tab is hidden.
function sendWanted() {
    const isVisible = !document.hidden;
    const source = isVisible && cloudView !== null ? byId("cloud-source").value : null;
    connection.send({ type: "want", pictures: isVisible, cloud: source === "cloud", model: source === "model" });
}

document.addEventListener("visibilitychange", sendWanted);
byId("cloud-source").addEventListener("change", () => {
    cloudView?.refitNext();
    sendWanted();
});
startTheme(byId("button-theme"), () => {
    forgetColours();
    redrawPlots();
});
startHelp();
startPictures();
connection.start();
