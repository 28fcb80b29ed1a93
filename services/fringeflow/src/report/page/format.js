// Numbers and times as text, in addition to those of the dashboard.

/** Milliseconds without the unit, which a table shows in its head. */
const inMilliseconds = (value) => fixed(value, value >= 100 ? 0 : value >= 1 ? 1 : 2);

const day = (time) => `${time.getFullYear()}-${twoDigits(time.getMonth() + 1)}-${twoDigits(time.getDate())}`;
const minute = (time) => `${twoDigits(time.getHours())}:${twoDigits(time.getMinutes())}`;
const second = (time) => timeOfDay(time.getTime());

function duration(seconds) {
    if (!(seconds >= 60)) {
        return withUnit(fixed(seconds, 1), "s");
    }
    const whole = Math.round(seconds);
    const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
    return hours > 0 ? `${hours} h ${twoDigits(minutes)} min` : `${minutes} min ${twoDigits(whole % 60)} s`;
}
