// Header and key figures of the page. Builds all panels.

const run = JSON.parse(byId("data").textContent);
const times = run.time_line.map(({ wall_ms }) => wall_ms / 1000);

function showHead() {
    byId("instance").textContent = run.instance ?? "";
    document.title = `${run.instance ?? "Fringeflow"}: report on a run`;
    byId("losses").textContent = run.verdict_text;
    byId("losses").dataset.level = run.verdict.is_loss ? "error" : "ok";
    byId("replayed").hidden = !run.replayed;
}

function showAbout() {
    const start = run.started_wall_ms === null ? null : new Date(run.started_wall_ms);
    const zone = Intl.DateTimeFormat().resolvedOptions().timeZone;
    const [width, height] = run.image_size_px;
    const { host, cpu, kernel } = run.origin;
    const facts = [
        ["First image", start ? `${day(start)} ${second(start)}` : "none", `time zone ${zone}`],
        ["Duration", duration(run.duration_s), `a point every ${duration(run.span_s)}`],
        ["Images", `${width} × ${height}`, `${run.steps} steps${run.virtual_images ? ", virtual: no camera took them" : ""}`],
        ["Fringeflow", run.version, run.is_recorded ? "version that made the recording" : ""],
        ["Machine", host || MISSING, [cpu, kernel && `Linux ${kernel}`].filter(Boolean).join(", ")],
        [run.is_recorded ? "From the recording" : "Recording", run.recording ?? "none", ""],
    ];
    const entry = ([name, value, note]) =>
        element("div", {}, element("dt", {}, name), element("dd", {}, value), element("dd", { class: "note" }, note));
    byId("about").append(...facts.map(entry));
}

function showRemarks() {
    const remarks = [
        run.replayed &&
            "This run was a replay. Times count from the completion of a window. There is no latency from exposure to cloud.",
        run.windows_incomplete > 0 &&
            `The segments leave out ${plural(run.windows_incomplete, "window")} without the report of an earlier stage. The recording began during the run, or a report was lost.`,
        run.time_line.length === 0 && "No image arrived.",
    ].filter(Boolean);
    byId("remark").textContent = remarks.join(" ");
    byId("remark").hidden = remarks.length === 0;
}

function driftTile(window) {
    const { level, isBeyond, note } = describeDrift(window);
    return [level, "rad", note, isBeyond ? "error" : undefined];
}

function healthTile({ worst, windows, quantities }) {
    return windows > 0 ? [worst, "", describeHealth(quantities), HEALTH_LEVELS[worst]] : [MISSING, "", "not reported"];
}

function showTiles() {
    const total = run.exposure_to_cloud;
    const window = run.last_window;
    const efc = mean(run.time_line.map((sample) => sample.window?.efc));
    const lossLevel = run.verdict.is_loss ? "error" : "ok";
    const leftOut = sum(run.verdict.choices.map(({ count }) => count));
    const clouds = run.stages.find(({ stage }) => stage === "cloud");
    const unknown = run.replayed ? "unknown in a replay" : "no cloud";
    const tiles = [
        ["Clouds", fixed(clouds?.passed), "", withUnit(fixed(clouds?.mean_rate_hz, 1), "per second")],
        ["p50 exposure to cloud", short(total?.p50_ms), "ms", total ? `p90 ${milliseconds(total.p90_ms)}` : unknown],
        ["p99 exposure to cloud", short(total?.p99_ms), "ms", total ? `max ${milliseconds(total.max_ms)}` : unknown],
        ["Points", fixed(window?.points), "", "in the last cloud"],
        ["Clouds lost", fixed(run.verdict.clouds), "", `${fixed(leftOut)} items left out by choice`, lossLevel],
        ["False candidates (efc)", short(efc), "", "for each true one, on average"],
        ["Calibration drift", ...driftTile(window)],
        ["Worst health", ...healthTile(run.health)],
    ];
    const tile = ([name, value, unit, note, level]) =>
        element(
            "div",
            { class: "tile", "data-level": level },
            element("dt", {}, name),
            element("dd", {}, element("span", { class: "tile-value" }, value), " ", element("span", { class: "unit" }, value === MISSING ? "" : unit)),
            element("dd", { class: "tile-note" }, note),
        );
    byId("tiles").append(...tiles.map(tile));
}

function startTheme() {
    const root = document.documentElement;
    const system = matchMedia("(prefers-color-scheme: dark)");
    const current = () => root.dataset.theme ?? (system.matches ? "dark" : "light");
    const button = byId("theme");
    const label = () => (button.textContent = current() === "dark" ? "Light" : "Dark");
    const changed = () => {
        label();
        redrawPlots();
    };
    button.addEventListener("click", () => {
        root.dataset.theme = current() === "dark" ? "light" : "dark";
        changed();
    });
    system.addEventListener("change", changed);
    // A print has the light theme, and plots in the width of the paper.
    let before;
    addEventListener("beforeprint", () => {
        before = root.dataset.theme;
        root.dataset.theme = "light";
        root.dataset.printing = "";
        redrawPlots();
    });
    addEventListener("afterprint", () => {
        delete root.dataset.printing;
        if (before === undefined) {
            delete root.dataset.theme;
        } else {
            root.dataset.theme = before;
        }
        redrawPlots();
    });
    label();
}

showAbout();
showRemarks();
showHead();
showTiles();
showLatency(run, times);
showSegments(run, times);
showLatencyTables(run);
showWorst(run);
showLost(run, times);
showRates(run, times);
showDrops(run);
showHealth(run);
showQuality(run, times);
byId("foot").textContent = `Fringeflow ${run.version}. This file needs no other files.`;
startTheme();
