// Images, phase maps and clouds per second, and the clouds that the machine holds.

import { stageColour } from "./colours.js";
import { byId, setText } from "./elements.js";
import { fixed, withUnit } from "./format.js";
import { Legend } from "./legend.js";
import { markLive } from "./panels.js";
import { TimePlot } from "./plot.js";

const SERIES = [
    { stage: "camera1", label: "Images, camera 1", width: 2 },
    { stage: "camera2", label: "Images, camera 2" },
    { stage: "phase", label: "Phase maps" },
    { stage: "cloud", label: "Clouds", width: 2 },
];

export function makeRates() {
    const series = SERIES.map((entry) => ({ ...entry, colour: stageColour(entry.stage) }));
    let columns = [];
    const showLegend = () => {
        const index = plot.hovered ?? columns[0]?.length - 1;
        legend.show(columns.map((column) => withUnit(fixed(column[index], 1), "/s")));
    };
    const plot = new TimePlot(byId("rates-plot"), { series, unit: " /s", hovered: showLegend });
    const legend = new Legend(byId("rates-legend"), series, (index, shown) => plot.setShown(index, shown));

    return ({ figures, history }) => {
        columns = SERIES.map(({ stage }) => history.column((sample) => sample.rates?.[stage]));
        plot.show(history.times(), columns);
        showLegend();
        showCapacity(figures.capacity);
        if (history.last) {
            markLive("panel-rates");
        }
    };
}

/** Shows the rate that the machine holds, and settings that help. Hidden while no clouds are made. */
function showCapacity(capacity) {
    const line = byId("capacity");
    line.hidden = !capacity;
    setText(line, capacity ? `${capacity}.` : "");
}
