// The pictures of the last window: what the cameras see, phase, modulation and depth. Zero means nothing there, except
// in the images of the cameras.

import { cyclic, depthColours, gradientOf } from "./colour-maps.js";
import { whenVisible } from "./drawing.js";
import { byId, setText } from "./elements.js";
import { fixed } from "./format.js";
import { markLive } from "./panels.js";

// Some outliers must not take the colours from all others.
const OUTLIERS = 0.01;

const painters = {
    camera1: paintGrey(0),
    camera2: paintGrey(0),
    phase: paintPhase,
    modulation: paintGrey(1),
    depth: paintDepth,
};

let newest = null;
const draw = whenVisible(() => {
    const { message, reply } = newest;
    message.pictures.forEach(drawPicture);
    markLive("panel-pictures");
    reply({ type: "shown", id: message.id });
});

export function startPictures() {
    byId("phase-scale").style.background = gradientOf(cyclic);
    byId("depth-scale").style.background = gradientOf(depthColours);
}

/** Draws the pictures in the next frame, then tells the server. */
export function showPictures(message, reply) {
    newest = { message, reply };
    draw();
}

function drawPicture(picture) {
    const paint = painters[picture.name];
    if (!paint || !picture.pixels) {
        return;
    }
    const canvas = byId(`picture-${picture.name}`);
    const { width, height } = picture;
    if (canvas.width !== width || canvas.height !== height) {
        Object.assign(canvas, { width, height });
    }
    const image = new ImageData(width, height);
    paint(picture, new Uint32Array(image.data.buffer));
    canvas.getContext("2d").putImageData(image, 0, 0);
    canvas.closest("figure").dataset.shown = "true";
}

// One pixel as the bytes red, green, blue, alpha in memory.
const pixelOf = (red, green, blue) => ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
const greys = Uint32Array.from({ length: 256 }, (_, grey) => pixelOf(grey, grey, grey));
const tableOf = (colours) =>
    Uint32Array.from({ length: 256 }, (_, index) => pixelOf(...colours.subarray(3 * index, 3 * index + 3)));
const phases = tableOf(cyclic);
const depths = tableOf(depthColours);

/** Greys from `least` on; below stays clear. */
function paintGrey(least) {
    return ({ pixels }, into) => {
        for (let index = 0; index < pixels.length; index += 1) {
            into[index] = pixels[index] >= least ? greys[pixels[index]] : 0;
        }
    };
}

function paintPhase({ pixels }, into) {
    for (let index = 0; index < pixels.length; index += 1) {
        into[index] = pixels[index] > 0 ? phases[pixels[index] - 1] : 0;
    }
}

function paintDepth({ pixels, base_mm: base, step_mm: step }, into) {
    const [nearest, farthest] = usualRange(pixels);
    const scale = 255 / Math.max(1, farthest - nearest);
    for (let index = 0; index < pixels.length; index += 1) {
        const nearness = (farthest - pixels[index]) * scale;
        into[index] = pixels[index] > 0 ? depths[Math.max(0, Math.min(255, nearness)) | 0] : 0;
    }
    const millimetres = (value) => (value > 0 ? fixed(base + (value - 1) * step, 0) : "–");
    setText(byId("depth-near"), `${millimetres(nearest)} mm`);
    setText(byId("depth-far"), `${millimetres(farthest)} mm`);
}

function usualRange(pixels) {
    const valid = pixels.filter((value) => value > 0).sort();
    if (valid.length === 0) {
        return [0, 0];
    }
    const margin = Math.floor(OUTLIERS * valid.length);
    return [valid[margin], valid[valid.length - 1 - margin]];
}
