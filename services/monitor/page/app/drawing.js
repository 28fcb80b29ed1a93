// Draws when something has changed, once a frame at most, and not at all while the tab is hidden: browsers hold back
// animation frames then, so that what came meanwhile is drawn as one when it is seen again.

/** Makes a function that asks for `draw` to be called in the next frame; asking again before that changes nothing. */
export function whenVisible(draw) {
    let asked = false;
    return () => {
        if (!asked) {
            asked = true;
            requestAnimationFrame(() => {
                asked = false;
                draw();
            });
        }
    };
}
