// Ranges and labels of axes. The report on a run includes this file, so it has no imports.

/** Range from zero to a round number above the greatest value. Round numbers keep the axis from changing often. */
export function fromZero(_, greatest) {
    return [0, roundAbove(greatest ?? 1)];
}

/** Range from minus to plus a round number above the greatest absolute value. */
export function aroundZero(least, greatest) {
    const reach = roundAbove(Math.max(Math.abs(least ?? 0), Math.abs(greatest ?? 0), 0.01));
    return [-reach, reach];
}

/** Returns a round number at least 5 % above the value; 1 if the value is not positive. */
export function roundAbove(value) {
    if (!(value > 0)) {
        return 1;
    }
    const power = 10 ** Math.floor(Math.log10(value));
    const steps = [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
    return power * (steps.find((step) => step * power >= 1.05 * value) ?? 15);
}

/** Decimals that labels with this distance need: 2.5 needs one. At most four. */
export function digitsOf(step) {
    const exact = (digits) => Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) < 1e-6;
    return [0, 1, 2, 3].find(exact) ?? 4;
}
