// Marks panels that show live data, for tests.

import { byId } from "./elements.js";

export const markLive = (id) => {
    byId(id).dataset.live = "true";
};

export function markAllStale() {
    for (const panel of document.querySelectorAll("[data-live]")) {
        delete panel.dataset.live;
    }
}
