// Numbers and times as text, beside those that the dashboard tells too.

/** Milliseconds without their unit: tables name it once. */
const inMilliseconds = (value) => fixed(value, value >= 100 ? 0 : value >= 1 ? 1 : 2);

const day = (time) => `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())}`;
const minute = (time) => `${two(time.getHours())}:${two(time.getMinutes())}`;
const second = (time) => timeOfDay(time.getTime());

function duration(seconds) {
    if (!(seconds >= 60)) {
        return withUnit(fixed(seconds, 1), "s");
    }
    const whole = Math.round(seconds);
    const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
    return hours > 0 ? `${hours} h ${two(minutes)} min` : `${minutes} min ${two(whole % 60)} s`;
}
