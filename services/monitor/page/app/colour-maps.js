// Colour maps as tables of RGB bytes: a cyclic one for the phase, and one of increasing lightness for depth.

/** 256 colours of one lightness around the hue circle of OKLCH. Equal steps of phase look equally large. */
export const cyclic = tableOf((share) => {
    const angle = 2 * Math.PI * share;
    return fromOklab(0.72, 0.12 * Math.cos(angle), 0.12 * Math.sin(angle));
});

// Viridis of matplotlib (CC0) without its darkest part, which would not stand out from the dark background.
const VIRIDIS = [0x472d7b, 0x3b528b, 0x2c728e, 0x21918c, 0x28ae80, 0x5ec962, 0xaddc30, 0xfde725];

/** 256 colours from far (0) to near (255). */
export const depthColours = tableOf((share) => {
    const place = share * (VIRIDIS.length - 1);
    const index = Math.min(Math.floor(place), VIRIDIS.length - 2);
    return [16, 8, 0].map((shift) => {
        const [from, to] = [VIRIDIS[index], VIRIDIS[index + 1]].map((rgb) => (rgb >> shift) & 255);
        return from + (place - index) * (to - from);
    });
});

/** A colour map as a CSS gradient. */
export function gradientOf(table) {
    const stops = Array.from({ length: 17 }, (_, step) => {
        const first = 3 * Math.round((step * 255) / 16);
        return `rgb(${table[first]} ${table[first + 1]} ${table[first + 2]})`;
    });
    return `linear-gradient(90deg, ${stops.join(", ")})`;
}

function tableOf(rgbOf) {
    const table = new Uint8ClampedArray(3 * 256);
    for (let step = 0; step < 256; step += 1) {
        table.set(rgbOf(step / 255), 3 * step);
    }
    return table;
}

// Converts OKLab (Björn Ottosson) to bytes of sRGB.
function fromOklab(lightness, a, b) {
    const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
    const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
    const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
    return [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
    ].map((linear) => 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));
}
