// Where the bulk of a cloud lies: some points far off must not make the rest small or of one colour.

const SAMPLES = 3000;
const OUTLIERS = 0.02;

/** Usual least and greatest value of each axis, in steps: `[[x, x], [y, y], [z, z]]`; null where there is no point. */
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
