// Numbers and times as text. A missing value is a dash, never a zero. The report on a run includes this file, so it has
// no imports.

export const MISSING = "–";
// The same digit groups and decimal point in every locale.
const formats = Array.from(
    { length: 5 },
    (_, digits) => new Intl.NumberFormat("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }),
);

export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);

export function fixed(value, digits = 0) {
    return isNumber(value) ? formats[digits].format(value).replace("-", "−") : MISSING;
}

/** About three significant digits, for values of any size. */
export function short(value) {
    if (!isNumber(value)) {
        return MISSING;
    }
    const size = Math.abs(value);
    return fixed(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

export const withUnit = (text, unit) => (text === MISSING ? MISSING : `${text} ${unit}`);

/** Milliseconds with about two significant digits. */
export function milliseconds(value) {
    return withUnit(fixed(value, value >= 10 || value === 0 ? 0 : value >= 1 ? 1 : value >= 0.1 ? 2 : 3), "ms");
}

export function megabytes(value) {
    return isNumber(value) && value >= 10_000 ? `${fixed(value / 1000, 0)} GB` : withUnit(fixed(value, 0), "MB");
}

export const plural = (count, one, many = `${one}s`) => `${fixed(count)} ${count === 1 ? one : many}`;

/** A number below 100 as two digits. */
export const twoDigits = (value) => String(value).padStart(2, "0");

/** Local time of day, 24 hours. */
export function timeOfDay(wallMs) {
    if (!isNumber(wallMs)) {
        return MISSING;
    }
    const time = new Date(wallMs);
    return `${twoDigits(time.getHours())}:${twoDigits(time.getMinutes())}:${twoDigits(time.getSeconds())}`;
}

export const capitalized = (text) => text.charAt(0).toUpperCase() + text.slice(1);

export const fileName = (path) => path.split("/").pop();
