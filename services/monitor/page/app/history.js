// The samples of the last ten minutes, one a second, and nothing older.

export const LIMIT = 600;
// Samples further apart leave a gap in the plots instead of a line across what nobody saw.
const GAP_MS = 2500;

export class History {
    #samples = [];

    get samples() {
        return this.#samples;
    }

    get last() {
        return this.#samples.at(-1) ?? null;
    }

    replace(samples) {
        this.#samples = [];
        for (const sample of samples) {
            this.add(sample);
        }
    }

    add(sample) {
        if (!Number.isFinite(sample?.wall_ms)) {
            return;
        }
        let last = this.last;
        if (last && sample.wall_ms <= last.wall_ms) {
            if (last.wall_ms - sample.wall_ms < GAP_MS) {
                return;
            }
            // The server's clock was set back: times of before it no longer say when something was.
            this.#samples = [];
            last = null;
        }
        if (last && sample.wall_ms - last.wall_ms > GAP_MS) {
            this.#samples.push({ wall_ms: last.wall_ms + 1000 });
        }
        this.#samples.push(sample);
        this.#samples.splice(0, this.#samples.length - LIMIT);
    }

    /** Times in seconds, as the plots count. */
    times() {
        return this.#samples.map((sample) => sample.wall_ms / 1000);
    }

    /** One figure of every sample, null where there is none. */
    column(read) {
        return this.#samples.map((sample) => read(sample) ?? null);
    }

    /** The sample of about so long ago, or the oldest. */
    ago(milliseconds) {
        const since = (this.last?.wall_ms ?? 0) - milliseconds;
        return this.#samples.find((sample) => sample.wall_ms >= since && sample.dropped) ?? null;
    }
}
