"""Checks a Grafana dashboard: grafana.py DASHBOARD METRICS

DASHBOARD is a JSON file, METRICS a file with the text of /metrics. The schema is that of Grafana, from the types of its
package `grafana_foundation_sdk`. Prints problems to stderr; exit code 0 means none.
"""

import enum
import json
import re
import sys
import types
import typing

from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.cog.plugins import register_default_plugins
from grafana_foundation_sdk.cog.runtime import panelcfg_config
from grafana_foundation_sdk.models import dashboard, units

import promql

COLUMNS = 24
ANYTHING = (object, typing.Any)
# Metrics that Prometheus itself creates.
BUILT_IN_METRICS = {"ALERTS": [{"alertstate": "firing"}]}
# Labels that Prometheus adds to series or alerts.
ADDED_LABELS = {"instance", "job", "alertname", "alertstate"}
# Units that are not on Grafana's list: a text after the number.
CUSTOM_UNIT = re.compile(r"suffix:.+")
LISTED_UNITS = {value for value in vars(units).values() if isinstance(value, str)}


def mistyped(value, wanted, path):
    """Yields a sentence for each value that has not the type of the schema."""
    origin, arguments = typing.get_origin(wanted), typing.get_args(wanted)
    if wanted in ANYTHING or isinstance(wanted, type) and isinstance(value, wanted) and hasattr(value, "to_json"):
        yield from mistyped_fields(value, path) if hasattr(value, "to_json") else []
    elif origin in (typing.Union, types.UnionType):
        if value is not None or types.NoneType not in arguments:
            choices = [a for a in arguments if a is not types.NoneType]
            choices = [a for a in choices if isinstance(a, type) and isinstance(value, a)] or choices
            yield from min((list(mistyped(value, choice, path)) for choice in choices), key=len)
    elif origin is typing.Literal or isinstance(wanted, type) and issubclass(wanted, enum.Enum):
        allowed = arguments or [member.value for member in wanted]
        # True equals 1 in Python, but not in JSON.
        if not any(value == a and isinstance(value, bool) == isinstance(a, bool) for a in allowed):
            yield f"{path}: {value!r} is none of {', '.join(map(repr, allowed))}"
    elif origin is list and isinstance(value, list):
        for k, item in enumerate(value):
            yield from mistyped(item, arguments[0], f"{path}[{k}]")
    elif origin is dict and isinstance(value, dict):
        for key, item in value.items():
            yield from mistyped(item, arguments[1], f"{path}.{key}")
    elif isinstance(value, dict) and hasattr(wanted, "from_json"):
        # The package does not convert some values to its types.
        typed = wanted.from_json(value)
        yield from differences(value, plain(typed), path)
        yield from mistyped_fields(typed, path)
    elif isinstance(value, enum.Enum) and type(value.value) is wanted:
        return
    elif type(value) is not wanted and not (wanted is float and type(value) is int):
        yield f"{path}: {value!r} is no {getattr(wanted, '__name__', wanted)}"


def mistyped_fields(typed, path):
    for field, wanted in typing.get_type_hints(type(typed)).items():
        yield from mistyped(getattr(typed, field), wanted, f"{path}.{field}")


def plain(typed):
    return json.loads(json.dumps(typed, cls=JSONEncoder))


def differences(written, kept, path):
    """Yields a sentence for each value that the schema drops or changes."""
    if isinstance(written, dict) and isinstance(kept, dict):
        for key, value in written.items():
            if key not in kept and value is not None:
                yield f"{path}.{key}: the schema has no such field"
            elif key in kept:
                yield from differences(value, kept[key], f"{path}.{key}")
    elif isinstance(written, list) and isinstance(kept, list) and len(written) == len(kept):
        for k, (a, b) in enumerate(zip(written, kept, strict=True)):
            yield from differences(a, b, f"{path}[{k}]")
    elif written != kept:
        yield f"{path}: {written!r} is read as {kept!r}"


def against_schema(written):
    register_default_plugins()
    for panel in written.get("panels", []):
        if panel.get("type") != "row" and panelcfg_config(panel.get("type")) is None:
            yield f"{name_of(panel)}: Grafana has no panel of type {panel.get('type')!r}"
    typed = dashboard.Dashboard.from_json(written)
    yield from differences(written, plain(typed), "dashboard")
    yield from mistyped_fields(typed, "dashboard")


def name_of(panel):
    return f'panel {panel.get("id")} "{panel.get("title")}"'


def texts(panel):
    title, description = panel.get("title", ""), panel.get("description", "")
    if not re.match(r"[A-ZΔ]", title) or title.endswith("."):
        yield "the title must begin with a capital letter and end without a full stop"
    if any(re.match(r"[A-Z][a-z]", word) for word in title.split()[1:]):
        yield "the title must be in sentence case"
    if panel["type"] != "row" and not re.fullmatch(r"[A-Z].*[^.]\.", description):
        yield "the description must be one or more sentences"


def unit(panel):
    found = panel["fieldConfig"]["defaults"].get("unit", "")
    if found not in LISTED_UNITS and not CUSTOM_UNIT.fullmatch(found):
        yield f"unit {found!r} is neither on Grafana's list nor a custom one"


def queries(panel, series, variables):
    labels = {label for sets in series.values() for one in sets for label in one} | ADDED_LABELS
    if not panel.get("targets"):
        yield "there is no query"
    if len({target["refId"] for target in panel["targets"]}) < len(panel["targets"]):
        yield "two queries have the same refId"
    for target in panel["targets"]:
        yield from promql.unknown_names(target["expr"], series)
        for label in re.findall(r"\{\{\s*(.*?)\s*\}\}", target.get("legendFormat", "")):
            if label not in labels:
                yield f"the legend names the label {label}, which no series has"
        for variable in re.findall(r"\$\{?(\w+)", target["expr"]):
            if variable not in variables and not variable.startswith("__"):
                yield f"there is no variable {variable}"


def grid(panels):
    """Yields a sentence for each panel that overlaps another one or is outside the grid."""
    occupied = {}
    for panel in panels:
        box = panel["gridPos"]
        if box["x"] < 0 or box["y"] < 0 or box["w"] < 1 or box["h"] < 1 or box["x"] + box["w"] > COLUMNS:
            yield f"{name_of(panel)} is outside the grid of {COLUMNS} columns"
        cells = [(x, y) for x in range(box["x"], box["x"] + box["w"]) for y in range(box["y"], box["y"] + box["h"])]
        overlapped = {name_of(occupied[cell]) for cell in cells if cell in occupied}
        yield from (f"{name_of(panel)} overlaps {other}" for other in sorted(overlapped))
        occupied.update((cell, panel) for cell in cells)


def against_metrics(written, series):
    panels = written["panels"]
    variables = {variable["name"] for variable in written["templating"]["list"]}
    if not any(v["type"] == "datasource" and v["name"] == "datasource" for v in written["templating"]["list"]):
        yield "there is no variable datasource"
    for variable in written["templating"]["list"]:
        if variable["type"] == "query":
            query = re.fullmatch(r"label_values\(([^,]+), *\w+\)", variable["query"]["query"])
            unknown_query = [f"variable {variable['name']}: unknown query"]
            yield from promql.unknown_names(query[1], series) if query else unknown_query
    ids = [panel["id"] for panel in panels]
    yield from (f"{ids.count(i)} panels have the id {i}" for i in sorted({i for i in ids if ids.count(i) > 1}))
    yield from grid(panels)
    for panel in panels:
        problems = list(texts(panel))
        if panel["type"] != "row":
            if panel.get("datasource") != {"type": "prometheus", "uid": "${datasource}"}:
                problems.append("the data source must be the variable")
            problems += [*unit(panel), *queries(panel, series, variables)]
        yield from (f"{name_of(panel)}: {problem}" for problem in problems)


def exposed(text):
    """Returns the label sets of each metric of /metrics, by its name."""
    series = dict(BUILT_IN_METRICS)
    for line in text.splitlines():
        sample = re.match(r"([a-zA-Z_:][\w:]*)(?:\{(.*)\})? ", line)
        if sample:
            series.setdefault(sample[1], []).append(dict(re.findall(r'(\w+)="((?:[^"\\]|\\.)*)"', sample[2] or "")))
    return series


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        written = json.load(file)
    with open(sys.argv[2], encoding="utf-8") as file:
        series = exposed(file.read())
    # The second check relies on the schema.
    problems = list(against_schema(written)) or list(against_metrics(written, series))
    for problem in problems:
        print(problem, file=sys.stderr)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
