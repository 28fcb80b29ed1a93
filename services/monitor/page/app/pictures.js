// The pictures of the last window: camera images, phase, modulation and depth. Zero means no value, except in camera
// images.

import { cyclic, depthColours, gradientOf } from "./colour-maps.js";
import { oncePerFrame } from "./drawing.js";
import { byId, setText } from "./elements.js";
import { fixed } from "./format.js";
import { markLive } from "./panels.js";

// Share of the depths beyond each end of the colour map. A few outliers must not use up the colours.
const OUTLIERS = 0.01;

const painters = {
    camera1: paintGrey(0),
    camera2: paintGrey(0),
    phase: paintPhase,
    modulation: paintGrey(1),
    depth: paintDepth,
};

let newest = null;
const draw = oncePerFrame(() => {
    const { message, reply } = newest;
    message.pictures.forEach(drawPicture);
    markLive("panel-pictures");
    reply({ type: "shown", id: message.id });
});

export function startPictures() {
    byId("phase-scale").style.background = gradientOf(cyclic);
    byId("depth-scale").style.background = gradientOf(depthColours);
}

/** Draws the pictures in the next frame, then confirms them to the server. */
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

// A pixel as a word whose bytes in memory are red, green, blue, alpha.
const pixelOf = (red, green, blue) => ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
const greyPixels = Uint32Array.from({ length: 256 }, (_, grey) => pixelOf(grey, grey, grey));
const tableOf = (colours) =>
    Uint32Array.from({ length: 256 }, (_, index) => pixelOf(...colours.subarray(3 * index, 3 * index + 3)));
const phasePixels = tableOf(cyclic);
const depthPixels = tableOf(depthColours);

/** Returns a painter of grey values. Values below `least` stay transparent. */
function paintGrey(least) {
    return ({ pixels }, output) => {
        for (let index = 0; index < pixels.length; index += 1) {
            output[index] = pixels[index] >= least ? greyPixels[pixels[index]] : 0;
        }
    };
}

function paintPhase({ pixels }, output) {
    for (let index = 0; index < pixels.length; index += 1) {
        output[index] = pixels[index] > 0 ? phasePixels[pixels[index] - 1] : 0;
    }
}

function paintDepth({ pixels, base_mm: base, step_mm: step }, output) {
    const [nearest, farthest] = rangeWithoutOutliers(pixels);
    const scale = 255 / Math.max(1, farthest - nearest);
    for (let index = 0; index < pixels.length; index += 1) {
        const nearness = (farthest - pixels[index]) * scale;
        output[index] = pixels[index] > 0 ? depthPixels[Math.max(0, Math.min(255, nearness)) | 0] : 0;
    }
    const millimetres = (value) => (value > 0 ? fixed(base + (value - 1) * step, 0) : "–");
    setText(byId("depth-near"), `${millimetres(nearest)} mm`);
    setText(byId("depth-far"), `${millimetres(farthest)} mm`);
}

/** Least and greatest depth code without outliers; zeros without depths. */
function rangeWithoutOutliers(pixels) {
    const valid = pixels.filter((value) => value > 0).sort();
    if (valid.length === 0) {
        return [0, 0];
    }
    const margin = Math.floor(OUTLIERS * valid.length);
    return [valid[margin], valid[valid.length - 1 - margin]];
}
