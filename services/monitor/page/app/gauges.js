// Quantities of health as text and colour, wherever they are shown.

import { MISSING, fixed, isNumber, withUnit } from "./format.js";

/** How a state is coloured; one that is not known is idle. */
export const HEALTH_LEVELS = { ok: "ok", warn: "warning", bad: "error" };

/** Level or limit with its unit; shares in percent. */
export function gaugeValue(value, unit) {
    if (!isNumber(value)) {
        return MISSING;
    }
    return unit ? withUnit(fixed(value, 3), unit) : withUnit(fixed(100 * value, 1), "%");
}

/** The drift as of a window: its level, rad, whether it is beyond a limit, and what to say of it. */
export function describeDrift(window) {
    const drift = window?.health?.quantities.find(({ quantity }) => quantity === "drift");
    const isBeyond = drift?.state === "warn" || drift?.state === "bad";
    const limit = `limit ${withUnit(fixed(drift?.state === "bad" ? drift?.bad : drift?.warn, 3), "rad")}`;
    const note = isBeyond ? `calibrate again, ${limit}` : isNumber(drift?.level) ? limit : "not measured";
    return { level: fixed(drift?.level, 3), isBeyond, note };
}
