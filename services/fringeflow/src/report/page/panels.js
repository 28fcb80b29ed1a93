// The panels of the page, each from the figures of the run.

const mean = (values) => {
    const told = values.filter(isNumber);
    return told.length > 0 ? told.reduce((sum, value) => sum + value, 0) / told.length : undefined;
};
const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);

/** A plot with a legend that tells the values under the cursor, or else those of `rest(index)`. */
function showPlot(id, { times, series, columns, text, rest, toggles = true, order = (list) => list, ...options }) {
    const showValues = (place) =>
        tell(columns.map((column, index) => text(place === null ? rest(index) : column[place], index, place)));
    const plot = makePlot(byId(`${id}-plot`), {
        times,
        series: order(series),
        columns: order(options.drawn ?? columns),
        hovered: showValues,
        ...options,
    });
    const toggled = toggles ? (index, show) => plot.setSeries(index + 1, { show }) : undefined;
    const tell = makeLegend(byId(`${id}-legend`), series, toggled);
    showValues(null);
    return {
        show: (next) => {
            columns = next;
            plot.setData([times, ...next]);
            showValues(null);
        },
    };
}

// The others take microseconds; one click shows them.
const SHOWN_STAGES = ["total", "phase", "correspondence", "cloud"];

function showLatency(run, times) {
    const stages = run.stages.filter(({ latency }) => latency).map(({ stage }) => stage);
    const names = run.exposure_to_cloud ? ["total", ...stages] : stages;
    const series = names.map((name) => ({
        label: titled(name),
        colour: stageColour(name),
        shown: SHOWN_STAGES.includes(name),
        ...(name === "total" && { width: 2.5, fill: "ink-wash" }),
    }));
    const whole = (name) =>
        name === "total" ? run.exposure_to_cloud : run.stages.find(({ stage }) => stage === name).latency;
    const select = byId("percentile");
    const of = (percentiles) => percentiles?.[select.value] ?? null;
    const columns = () =>
        names.map((name) => run.time_line.map((at) => of(name === "total" ? at.total : at.stages[name])));
    const plot = showPlot("latency", {
        times,
        series,
        columns: columns(),
        unit: " ms",
        text: (value) => milliseconds(value),
        rest: (index) => whole(names[index])?.[["p50_ms", "p90_ms", "p99_ms"][select.value]],
    });
    select.addEventListener("change", () => plot.show(columns()));
    byId("latency-summary").textContent =
        (run.exposure_to_cloud ? "Total: from the last exposure of a window to its cloud. " : "") +
        "Beside the names: the whole run, or the moment under the cursor.";
}

function showWay(run, times) {
    const told = run.segments.map(({ segment }) => segment);
    const places = told.map((name) => run.segment_names.indexOf(name));
    const series = told.map((name) => ({ label: titled(name), colour: stageColour(name) }));
    const means = places.map((place) => run.time_line.map(({ segments }) => segments?.[place] ?? null));
    // Each area reaches from zero to the top of its segment; those drawn later cover the lower part.
    const tops = told.map((_, index) =>
        times.map((_, at) => (means[0][at] === null ? null : sum(means.slice(0, index + 1).map((one) => one[at])))),
    );
    const areas = series.map((entry) => ({ ...entry, width: 0, fill: entry.colour }));
    showPlot("way", {
        times,
        series: areas,
        columns: means,
        drawn: tops,
        order: (list) => list.toReversed(),
        toggles: false,
        unit: " ms",
        text: (value, index, place) =>
            place === null
                ? `${fixed(run.segments[index].share, 1)} %`
                : milliseconds(value),
        rest: () => undefined,
    });
}

const RATES = [
    { stage: "camera1", label: "Images, camera 1", width: 2 },
    { stage: "camera2", label: "Images, camera 2" },
    { stage: "phase", label: "Phase maps" },
    { stage: "cloud", label: "Clouds", width: 2 },
];

function showRates(run, times) {
    const series = RATES.map((entry) => ({ ...entry, colour: stageColour(entry.stage) }));
    const columns = RATES.map(({ stage }) => run.time_line.map(({ rates }) => rates[stage] ?? null));
    const text = (value) => withUnit(fixed(value, 1), "/s");
    showPlot("rates", { times, series, columns, unit: " /s", text, rest: (index) => mean(columns[index]) });
}

function showLost(run, times) {
    const lost = (name) => run.time_line.map(({ dropped }) => dropped[name] ?? null);
    const names = run.stages.map(({ stage }) => stage).filter((name) => Math.max(...lost(name)) > 0);
    // Of nothing there is no course.
    byId("lost").hidden = names.length === 0;
    byId("rates").classList.toggle("wide", names.length === 0);
    if (names.length > 0) {
        const series = names.map((name) => ({ label: titled(name), colour: stageColour(name) }));
        const columns = names.map(lost);
        showPlot("lost", { times, series, columns, text: (value) => fixed(value), rest: (index) => columns[index].at(-1) });
    }
}

const percentileColumns = [
    ["p50", "p50_ms"],
    ["p90", "p90_ms"],
    ["p99", "p99_ms"],
    ["max", "max_ms"],
].map(([title, key]) => ({ title, number: true, text: ({ latency }) => inMilliseconds(latency?.[key]) }));

function showLatencyTables(run) {
    const name = (key, title) => ({ title, cell: (row) => coloured(row[key]) });
    const share = { title: "share", number: true, text: (row) => withUnit(fixed(row.share, 1), "%") };
    const whole = run.exposure_to_cloud
        ? [{ segment: "total", latency: run.exposure_to_cloud, share: 100 }]
        : [];
    showTable(
        byId("parts"),
        "Latency of each part of the way in milliseconds, and its share of the whole",
        [name("segment", "part, ms"), ...percentileColumns, share],
        [...run.segments.filter(({ latency }) => latency), ...whole],
        ({ segment }) => segment === "total",
    );
    const count = { title: "items", number: true, text: ({ latency }) => fixed(latency?.count) };
    showTable(
        byId("stages"),
        "Latency of each stage in milliseconds",
        [name("stage", "stage, ms"), count, ...percentileColumns],
        run.stages.filter(({ latency }) => latency),
    );
}

/** The parts of a window as a bar; the longest window of all fills it. */
function bar(run, row, longest_ms) {
    const parts = row.segments_ms.map((ms, index) => {
        const name = run.segment_names[index];
        const style = `width: ${(100 * ms) / longest_ms}%; background: var(--${stageColour(name)})`;
        return element("span", { style, title: `${titled(name)}: ${milliseconds(ms)}` });
    });
    return element("span", { class: "bar", "aria-hidden": "true" }, ...parts);
}

function showWorst(run) {
    const longest_ms = run.worst[0]?.total_ms ?? 1;
    const time = ({ wall_ms }) => {
        const at = new Date(wall_ms);
        return `${second(at)}.${String(at.getMilliseconds()).padStart(3, "0")}`;
    };
    showTable(
        byId("worst"),
        "The slowest windows, and why",
        [
            { title: run.replayed ? "complete at" : "exposed at", text: time },
            { title: "after, s", number: true, text: ({ time_s }) => fixed(time_s, 2) },
            { title: "took, ms", number: true, text: ({ total_ms }) => inMilliseconds(total_ms) },
            { title: "made of", cell: (row) => bar(run, row, longest_ms) },
            { title: "cause", wide: true, text: ({ cause }) => cause },
        ],
        run.worst,
    );
}

function showDrops(run) {
    const badge = ({ kind }) =>
        element("span", { class: "badge", "data-level": DROP_KINDS[kind].level }, DROP_KINDS[kind].title);
    showTable(
        byId("drops"),
        "What each stage dropped or survived, by reason",
        [
            { title: "stage", cell: ({ stage }) => coloured(stage) },
            { title: "kind", cell: badge },
            { title: "reason", text: ({ reason }) => words(reason) },
            { title: "what it means", wide: true, text: ({ meaning }) => meaning },
            { title: "items", number: true, text: ({ count }) => fixed(count) },
        ],
        run.drops,
    );
}

function showHealth(run) {
    byId("health-summary").textContent =
        run.health.windows > 0
            ? `${run.health.worst} at worst, over ${plural(run.health.windows, "window")}. Each quantity is shown at its worst. Shares are in percent.`
            : "No window reported it.";
    const state = ({ state }) => element("span", { class: "badge", "data-level": HEALTH_LEVELS[state] ?? "idle" }, state);
    showTable(
        byId("health"),
        "Each quantity of health at its worst",
        [
            { title: "quantity", text: ({ title }) => title },
            { title: "worst", cell: state },
            { title: "value", number: true, text: ({ level, unit }) => gaugeValue(level, unit) },
            { title: "warn beyond", number: true, text: ({ warn, unit }) => gaugeValue(warn, unit) },
            { title: "bad beyond", number: true, text: ({ bad, unit }) => gaugeValue(bad, unit) },
            { title: "windows warn", number: true, text: ({ windows_warn }) => fixed(windows_warn) },
            { title: "windows bad", number: true, text: ({ windows_bad }) => fixed(windows_bad) },
        ],
        run.health.quantities,
    );
}

const radians = (value) => withUnit(fixed(value, 4), "rad");
const percent = (value) => withUnit(fixed(value, 1), "%");

const QUALITY = [
    { label: "Noise of δ (sd)", lines: [["series-1", (window) => window.sd_rad]], text: radians },
    {
        label: "Drift of the calibration · noise about it",
        lines: [
            ["series-6", (window) => window.drift_rms_rad],
            ["series-1", (window) => window.residual_sd_rad],
        ],
        text: radians,
    },
    { label: "Median of δ", lines: [["series-5", (window) => window.delta_median_rad]], text: radians, range: aroundZero },
    { label: "Expected false (efc)", lines: [["series-4", (window) => window.efc]], text: short },
    { label: "Periods a segment (n)", lines: [["series-9", (window) => window.n]], text: short },
    { label: "Unique", lines: [["series-3", (window) => window.unique]], text: percent, range: () => [0, 100] },
    { label: "Undecided", lines: [["series-8", (window) => window.undecided]], text: percent },
    { label: "Rejected", lines: [["series-6", (window) => window.rejected]], text: percent },
    {
        label: "Fit residuals (1 · 2)",
        lines: [
            ["series-1", (window) => window.residual[0]],
            ["series-2", (window) => window.residual[1]],
        ],
        text: (value) => fixed(value, 3),
    },
];

function showQuality(run, times) {
    for (const { label, lines, text, range } of QUALITY) {
        const columns = lines.map(([, read]) => run.time_line.map(({ window }) => (window ? read(window) : null)));
        const value = element("span", { class: "small-plot-value" });
        const about = { class: "small-plot-canvas", role: "img", "aria-label": `${label} over time` };
        const canvas = element("div", about);
        const caption = element("figcaption", {}, element("span", { class: "small-plot-label" }, label), value);
        byId("quality").append(element("figure", { class: "small-plot" }, caption, canvas));
        const show = (place) => {
            const of = (column) => text(place === null ? mean(column) : column[place]);
            value.textContent = columns.map(of).join(" · ") + (place === null ? " mean" : "");
        };
        const series = lines.map(([colour]) => ({ label, colour }));
        makePlot(canvas, { times, series, columns, range, small: true, hovered: show });
        show(null);
    }
}
