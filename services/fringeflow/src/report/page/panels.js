// The panels of the page. Each shows some figures of the run.

const mean = (values) => {
    const numbers = values.filter(isNumber);
    return numbers.length > 0 ? numbers.reduce((sum, value) => sum + value, 0) / numbers.length : undefined;
};
const sum = (values) => values.reduce((total, value) => total + (value ?? 0), 0);

/** Shows a plot with a legend. The legend has the values at the cursor, or those of `rest(index)` without a cursor. */
function showPlot(id, { times, series, columns, text, rest, toggles = true, order = (list) => list, ...options }) {
    const showValues = (at) =>
        setTexts(columns.map((column, index) => text(at === null ? rest(index) : column[at], index, at)));
    const plot = makePlot(byId(`${id}-plot`), {
        times,
        series: order(series),
        columns: order(options.drawn ?? columns),
        hovered: showValues,
        ...options,
    });
    const toggled = toggles ? (index, show) => plot.setSeries(index + 1, { show }) : undefined;
    const setTexts = makeLegend(byId(`${id}-legend`), series, toggled);
    showValues(null);
    return {
        show: (next) => {
            columns = next;
            plot.setData([times, ...next]);
            showValues(null);
        },
    };
}

// Series that are visible at first. The other stages take only microseconds; a click in the legend shows them.
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
    const wholeRun = (name) =>
        name === "total" ? run.exposure_to_cloud : run.stages.find(({ stage }) => stage === name).latency;
    const select = byId("percentile");
    const selected = (percentiles) => percentiles?.[select.value] ?? null;
    const columns = () =>
        names.map((name) =>
            run.time_line.map((sample) => selected(name === "total" ? sample.total : sample.stages[name])),
        );
    const plot = showPlot("latency", {
        times,
        series,
        columns: columns(),
        unit: " ms",
        text: (value) => milliseconds(value),
        rest: (index) => wholeRun(names[index])?.[["p50_ms", "p90_ms", "p99_ms"][select.value]],
    });
    select.addEventListener("change", () => plot.show(columns()));
    byId("latency-summary").textContent =
        (run.exposure_to_cloud ? "Total: from the last exposure of a window to its cloud. " : "") +
        "The legend shows the values of the whole run, or those at the cursor.";
}

function showSegments(run, times) {
    const names = run.segments.map(({ segment }) => segment);
    const indices = names.map((name) => run.segment_names.indexOf(name));
    const series = names.map((name) => ({ label: titled(name), colour: stageColour(name) }));
    const means = indices.map((index) => run.time_line.map(({ segments }) => segments?.[index] ?? null));
    // Each area reaches from zero to the top of its segment. Areas drawn later cover the lower part.
    const tops = names.map((_, index) =>
        times.map((_, at) =>
            means[0][at] === null ? null : sum(means.slice(0, index + 1).map((column) => column[at])),
        ),
    );
    const areas = series.map((entry) => ({ ...entry, width: 0, fill: entry.colour }));
    showPlot("segments", {
        times,
        series: areas,
        columns: means,
        drawn: tops,
        order: (list) => list.toReversed(),
        toggles: false,
        unit: " ms",
        text: (value, index, at) => (at === null ? `${fixed(run.segments[index].share, 1)} %` : milliseconds(value)),
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
    const meanRate = (index) => run.stages.find(({ stage }) => stage === RATES[index].stage)?.mean_rate_hz;
    showPlot("rates", { times, series, columns, unit: " /s", text, rest: meanRate });
}

function showLost(run, times) {
    const lost = (name) => run.time_line.map(({ dropped }) => dropped[name] ?? null);
    const names = run.stages.map(({ stage }) => stage).filter((name) => Math.max(...lost(name)) > 0);
    // Without losses the panel is hidden, and the rates take the whole row.
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
    const total = run.exposure_to_cloud
        ? [{ segment: "total", latency: run.exposure_to_cloud, share: 100 }]
        : [];
    showTable(
        byId("segments"),
        "Latency of each segment in milliseconds, and its share of the total",
        [name("segment", "segment, ms"), ...percentileColumns, share],
        [...run.segments.filter(({ latency }) => latency), ...total],
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

/** The segments of a window as a bar. The slowest window takes the full width. */
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
        "The slowest windows and the cause of their latency",
        [
            { title: run.replayed ? "complete at" : "exposed at", text: time },
            { title: "since start, s", number: true, text: ({ time_s }) => fixed(time_s, 2) },
            { title: "total, ms", number: true, text: ({ total_ms }) => inMilliseconds(total_ms) },
            { title: "segments", cell: (row) => bar(run, row, longest_ms) },
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
        "Drops and incidents by stage and reason",
        [
            { title: "stage", cell: ({ stage }) => coloured(stage) },
            { title: "kind", cell: badge },
            { title: "reason", text: ({ reason }) => words(reason) },
            { title: "meaning", wide: true, text: ({ meaning }) => meaning },
            { title: "items", number: true, text: ({ count }) => fixed(count) },
        ],
        run.drops,
    );
}

function showHealth(run) {
    byId("health-summary").textContent =
        run.health.windows > 0
            ? `Worst state: ${run.health.worst}, over ${plural(run.health.windows, "window")}. The table shows each quantity at its worst. Shares are in percent.`
            : "No window reported its health.";
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
        label: "Calibration drift · noise about it",
        lines: [
            ["series-6", (window) => window.drift_rms_rad],
            ["series-1", (window) => window.residual_sd_rad],
        ],
        text: radians,
    },
    { label: "Median of δ", lines: [["series-5", (window) => window.delta_median_rad]], text: radians, range: aroundZero },
    { label: "Expected false (efc)", lines: [["series-4", (window) => window.efc]], text: short },
    { label: "Periods per segment (n)", lines: [["series-9", (window) => window.n]], text: short },
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
        const attributes = { class: "small-plot-canvas", role: "img", "aria-label": `${label} over time` };
        const canvas = element("div", attributes);
        const caption = element("figcaption", {}, element("span", { class: "small-plot-label" }, label), value);
        byId("quality").append(element("figure", { class: "small-plot" }, caption, canvas));
        const show = (at) => {
            const valueText = (column) => text(at === null ? mean(column) : column[at]);
            value.textContent = columns.map(valueText).join(" · ") + (at === null ? " mean" : "");
        };
        const series = lines.map(([colour]) => ({ label, colour }));
        makePlot(canvas, { times, series, columns, range, small: true, hovered: show });
        show(null);
    }
}
