// The WebSocket to the monitor. Opens it, opens it again when it is lost, and notices when messages stop.

import { decode } from "./messages.js";

// Time until the page connects again; it doubles with each failure.
const MIN_RETRY_MS = 500;
const MAX_RETRY_MS = 5000;
// Figures arrive once a second. After this time without a message, the page is stale.
const STALE_MS = 3000;
// A connection that is silent for this time is given up: the other side may have disappeared without closing it.
const DEAD_MS = 10_000;

export class Connection {
    #url;
    #listener;
    #socket = null;
    #receivedAt = 0;
    #openedAt = 0;
    #retryMs = MIN_RETRY_MS;
    #retry = null;

    /** `listener` has `opened()`, `message(message, reply)`, `unreadable(error)` and `state(state)`. */
    constructor(url, listener) {
        this.#url = url;
        this.#listener = listener;
    }

    start() {
        setInterval(() => this.#checkSilence(), 1000);
        this.#open();
    }

    send(message) {
        sendTo(this.#socket, message);
    }

    #open() {
        const socket = new WebSocket(this.#url);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => this.#listener.opened();
        socket.onmessage = (event) => this.#receive(socket, event.data);
        socket.onclose = (event) => this.#reconnect(describeClose(event, this.#receivedAt >= this.#openedAt));
        this.#socket = socket;
        this.#openedAt = Date.now();
    }

    #receive(socket, received) {
        this.#receivedAt = Date.now();
        this.#retryMs = MIN_RETRY_MS;
        this.#listener.state({ name: "live" });
        try {
            this.#listener.message(decode(received), (message) => sendTo(socket, message));
        } catch (error) {
            this.#listener.unreadable(error);
        }
    }

    #checkSilence() {
        if (this.#retry !== null) {
            return;
        }
        const silentMs = Date.now() - Math.max(this.#receivedAt, this.#openedAt);
        if (silentMs > DEAD_MS) {
            this.#abandon();
            this.#reconnect(`the server has been silent for ${Math.round(silentMs / 1000)} s`);
        } else if (silentMs > STALE_MS && this.#receivedAt >= this.#openedAt) {
            this.#listener.state({ name: "stale", receivedAt: this.#receivedAt });
        }
    }

    // Closing waits for the other side, which may never answer. So the handlers are removed first.
    #abandon() {
        this.#socket.onopen = this.#socket.onmessage = this.#socket.onclose = null;
        this.#socket.close();
    }

    #reconnect(why) {
        this.#socket = null;
        const receivedAt = this.#receivedAt || null;
        this.#listener.state({ name: "reconnecting", why, retryMs: this.#retryMs, receivedAt });
        this.#retry = setTimeout(() => {
            this.#retry = null;
            this.#open();
        }, this.#retryMs);
        this.#retryMs = Math.min(2 * this.#retryMs, MAX_RETRY_MS);
    }
}

function sendTo(socket, message) {
    if (socket?.readyState === WebSocket.OPEN) {
        socket.send(JSON.stringify(message));
    }
}

// Browsers do not tell why a connection could not be opened.
function describeClose(event, wasLive) {
    if (event.reason) {
        return event.reason;
    }
    if (event.code === 1001) {
        return "the instance is ending";
    }
    return wasLive ? "the server closed the connection" : "no answer; the instance has ended, or refuses this page";
}
