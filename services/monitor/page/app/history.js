// The samples of the last ten minutes, one per second.

const MAX_SAMPLES = 600;
// Samples further apart leave a gap in the plots, since nothing is known in between.
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
            // The server's clock was set back, so the earlier times are wrong.
            this.#samples = [];
            last = null;
        }
        if (last && sample.wall_ms - last.wall_ms > GAP_MS) {
            // A sample without values makes the gap.
            this.#samples.push({ wall_ms: last.wall_ms + 1000 });
        }
        this.#samples.push(sample);
        this.#samples.splice(0, this.#samples.length - MAX_SAMPLES);
    }

    /** Times in seconds, as the plots need them. */
    times() {
        return this.#samples.map((sample) => sample.wall_ms / 1000);
    }

    /** One value of every sample; null if a sample does not have it. */
    column(read) {
        return this.#samples.map((sample) => read(sample) ?? null);
    }

    /** The first sample with values within this time before the last one. */
    firstWithin(milliseconds) {
        const since = (this.last?.wall_ms ?? 0) - milliseconds;
        return this.#samples.find((sample) => sample.wall_ms >= since && sample.dropped) ?? null;
    }
}
