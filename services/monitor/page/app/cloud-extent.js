// Extent of the bulk of a cloud: a few distant points must not make the rest small or of one colour.

// About so many points are looked at.
const SAMPLES = 3000;
// Share of the points that may lie beyond each end.
const OUTLIERS = 0.02;

/** Range of each axis without outliers, in steps: `[[x, x], [y, y], [z, z]]`; null without points. */
export function extentOf(positions) {
    const points = positions.length / 3;
    if (points === 0) {
        return null;
    }
    const stride = Math.max(1, Math.floor(points / SAMPLES));
    return [0, 1, 2].map((axis) => {
        const values = new Int16Array(Math.floor((points - 1) / stride) + 1);
        for (let index = 0; index < values.length; index += 1) {
            values[index] = positions[3 * index * stride + axis];
        }
        values.sort();
        const margin = Math.floor(OUTLIERS * values.length);
        return [values[margin], values[values.length - 1 - margin]];
    });
}
