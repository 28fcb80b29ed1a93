// Numbers and times as text. What is missing is a dash, never a zero.

const MISSING = "–";
const formats = Array.from(
    { length: 5 },
    (_, digits) => new Intl.NumberFormat("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }),
);

const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
const fixed = (value, digits = 0) => (isNumber(value) ? formats[digits].format(value).replace("-", "−") : MISSING);
const withUnit = (text, unit) => (text === MISSING ? MISSING : `${text} ${unit}`);

/** About three digits that count. */
function short(value) {
    const size = Math.abs(value);
    return fixed(value, size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

/** Milliseconds without their unit: tables and plots name it once. */
const milliseconds = (value) => fixed(value, value >= 100 ? 0 : value >= 1 ? 1 : 2);

const plural = (count, one) => `${fixed(count)} ${one}${count === 1 ? "" : "s"}`;

/** A short name of the program's as words. */
const words = (name) => name.replaceAll("_", " ").replace(/(\d+)$/, " $1");

/** A stage or a part of the way as a title: a queue is where one waits. */
const titled = (name) =>
    words(name.replace(/^(.*)_queue$/, "wait_for_$1")).replace(/^./, (first) => first.toUpperCase());

const two = (value) => String(value).padStart(2, "0");
const day = (time) => `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())}`;
const minute = (time) => `${two(time.getHours())}:${two(time.getMinutes())}`;
const second = (time) => `${minute(time)}:${two(time.getSeconds())}`;

function duration(seconds) {
    if (!(seconds >= 60)) {
        return withUnit(fixed(seconds, 1), "s");
    }
    const whole = Math.round(seconds);
    const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
    return hours > 0 ? `${hours} h ${two(minutes)} min` : `${minutes} min ${two(whole % 60)} s`;
}
