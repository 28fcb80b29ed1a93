// Draws changes at most once a frame, and not while the tab is hidden. Browsers then stop animation frames, so all
// changes are drawn together when the tab is visible again.

/** Returns a function that requests a call of `draw` in the next frame. Further requests until then have no effect. */
export function oncePerFrame(draw) {
    let isRequested = false;
    return () => {
        if (!isRequested) {
            isRequested = true;
            requestAnimationFrame(() => {
                isRequested = false;
                draw();
            });
        }
    };
}
