// Text and colour of the quantities of health. The report on a run includes this file too, after those it imports from.

import { MISSING, fixed, isNumber, withUnit } from "./format.js";

/** Level that colours a state. An unknown state is idle. */
export const HEALTH_LEVELS = { ok: "ok", warn: "warning", bad: "error" };

/** Level or limit with its unit. Shares are in percent. */
export function gaugeValue(value, unit) {
    if (!isNumber(value)) {
        return MISSING;
    }
    return unit ? withUnit(fixed(value, 3), unit) : withUnit(fixed(100 * value, 1), "%");
}

/** Says which of the quantities of health are beyond their limits. */
export function describeHealth(quantities) {
    const beyond = quantities.filter(({ state }) => state === "warn" || state === "bad");
    if (beyond.length > 1) {
        return `${beyond.length} quantities beyond their limits`;
    }
    return beyond.length === 1 ? beyond[0].title : "all quantities within their limits";
}

/** The drift of a window: its level in rad as text, whether it is beyond a limit, and a note. */
export function describeDrift(window) {
    const drift = window?.health?.quantities.find(({ quantity }) => quantity === "drift");
    const isBeyond = drift?.state === "warn" || drift?.state === "bad";
    const limit = `limit ${withUnit(fixed(drift?.state === "bad" ? drift?.bad : drift?.warn, 3), "rad")}`;
    const note = isBeyond ? `calibrate again, ${limit}` : isNumber(drift?.level) ? limit : "not measured";
    return { level: fixed(drift?.level, 3), isBeyond, note };
}
