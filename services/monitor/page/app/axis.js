// Ends and labels of axes. The report on a run holds this file too, so it imports nothing.

/** From zero to a round number above the greatest value, so that the axis seldom changes. */
export function fromZero(_, greatest) {
    return [0, roundAbove(greatest ?? 1)];
}

/** The same about zero. */
export function aroundZero(least, greatest) {
    const reach = roundAbove(Math.max(Math.abs(least ?? 0), Math.abs(greatest ?? 0), 0.01));
    return [-reach, reach];
}

export function roundAbove(value) {
    if (!(value > 0)) {
        return 1;
    }
    const power = 10 ** Math.floor(Math.log10(value));
    const steps = [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
    return power * (steps.find((step) => step * power >= 1.05 * value) ?? 15);
}

// As many digits as it takes to tell labels of this distance apart: 2.5 asks for one.
export function digitsOf(step) {
    const exact = (digits) => Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) < 1e-6;
    return [0, 1, 2, 3].find(exact) ?? 4;
}
