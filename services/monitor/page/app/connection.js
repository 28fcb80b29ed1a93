// The WebSocket to the monitor: opens it, opens it again when it is lost, and notices when nothing comes any more.

import { decode } from "./messages.js";

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
// Figures come once a second; after so long without any message what is shown is old.
const STALE_MS = 3000;
// A connection that is silent for so long is given up: the other side may be gone without a word.
const DEAD_MS = 10_000;

export class Connection {
    #url;
    #listener;
    #socket = null;
    #heardAt = 0;
    #openedAt = 0;
    #wait = FIRST_WAIT_MS;
    #retry = null;

    /** `listener` has `opened()`, `message(message, reply)`, `unreadable(error)` and `state(state)`. */
    constructor(url, listener) {
        this.#url = url;
        this.#listener = listener;
    }

    start() {
        setInterval(() => this.#watch(), 1000);
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
        socket.onclose = (event) => this.#lost(whyClosed(event, this.#heardAt >= this.#openedAt));
        this.#socket = socket;
        this.#openedAt = Date.now();
    }

    #receive(socket, received) {
        this.#heardAt = Date.now();
        this.#wait = FIRST_WAIT_MS;
        this.#listener.state({ name: "live" });
        try {
            this.#listener.message(decode(received), (message) => sendTo(socket, message));
        } catch (error) {
            this.#listener.unreadable(error);
        }
    }

    #watch() {
        if (this.#retry !== null) {
            return;
        }
        const silentMs = Date.now() - Math.max(this.#heardAt, this.#openedAt);
        if (silentMs > DEAD_MS) {
            this.#abandon();
            this.#lost(`the server has been silent for ${Math.round(silentMs / 1000)} s`);
        } else if (silentMs > STALE_MS && this.#heardAt >= this.#openedAt) {
            this.#listener.state({ name: "stale", heardAt: this.#heardAt });
        }
    }

    // Closing asks the other side, which may never answer; so nobody listens to this socket any more.
    #abandon() {
        this.#socket.onopen = this.#socket.onmessage = this.#socket.onclose = null;
        this.#socket.close();
    }

    #lost(why) {
        this.#socket = null;
        this.#listener.state({ name: "reconnecting", why, waitMs: this.#wait, heardAt: this.#heardAt || null });
        this.#retry = setTimeout(() => {
            this.#retry = null;
            this.#open();
        }, this.#wait);
        this.#wait = Math.min(2 * this.#wait, LONGEST_WAIT_MS);
    }
}

function sendTo(socket, message) {
    if (socket?.readyState === WebSocket.OPEN) {
        socket.send(JSON.stringify(message));
    }
}

// Browsers do not say more than this about a connection that never came about.
function whyClosed(event, wasHeard) {
    if (event.reason) {
        return event.reason;
    }
    if (event.code === 1001) {
        return "the server is shutting down";
    }
    return wasHeard ? "the server closed the connection" : "the server does not answer or refuses";
}
