"""Scrapes a running monitor with a real Prometheus, and checks the result: prometheus.py URL BINARIES

URL is that of the monitor, BINARIES the folder with `prometheus` and `promtool` (see prometheus_package.sh).
Configuration, rules and dashboard are those of configs/. The instance must scan and make clouds all the time, unless
--idle is given. Prints what Prometheus computes as one JSON object, and problems to stderr; exit code 0 means none.

The JSON object:
  scrapes, series     number of successful scrapes, and of series
  alerts              alerts that are pending or firing at the end, by name
  since_start         latencies since the start of the instance
  observed            latencies while this Prometheus was running
each of the last two:
  exposure_to_cloud   {"count", "sum", "p50", "p90", "p99"}, or null without any cloud; each percentile
                      {"seconds", "above", "up_to"}: its value, and the bounds of its bucket (up_to is null for the last
                      bucket)
  stages, segments    the same for each stage and each segment, by name
"""

import argparse
import collections
import contextlib
import ctypes
import json
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

import promql

CONFIGS = pathlib.Path(__file__).parents[2] / "configs"
ALERT_TESTS = pathlib.Path(__file__).parent / "alerts_test.yml"

# Longest time for Prometheus to start, to scrape the monitor, and to evaluate each rule, seconds.
TIMEOUT_S = 30
# Least number of successful scrapes, and largest share of failed ones: the machine may be busy.
LEAST_SCRAPES = 5
MAX_FAILED_SHARE = 0.1
# Values that Grafana uses for its variables if a query has a minimum step of 2s.
GRAFANA_VARIABLES = {"__interval": "2s", "__rate_interval": "8s"}
QUANTILES = {"p50": 0.5, "p90": 0.9, "p99": 0.99}
# Relative difference between the sum of all segments and exposure to cloud that is allowed for rounding.
SEGMENTS_TOLERANCE = 0.01

# Alerts that a working instance never raises.
NEVER = {
    "FringeflowMonitorDown",
    "FringeflowServiceDown",
    "FringeflowCameraSilent",
    "FringeflowNoWindows",
    "FringeflowNoClouds",
}

# Panels that may be empty, and why.
MAY_BE_EMPTY = {
    "Alerts": "no alert fires while all is well",
    "Losses by reason": "shows only losses",
    "Left out by reason": "shows only items left out; on a fast machine there may be none",
    "Incidents": "shows only incidents",
}
# Panels that are empty without a scan.
NEED_A_SCAN = {
    "Exposure to cloud",
    "Points per cloud",
    "Exposure to cloud over time",
    "Latency of the stages, p50",
    "Latency of the stages, p99",
    "Where the time goes",
    "Scatter of δ",
    "Median of δ",
    "Candidates",
    "How pixels are decided",
    "Valid pixels",
    "Residual of the fit",
    "Points",
    "Skew of the cameras",
    "Motion of the phase",
    "Pose of the scanner",
    "Tracked clouds",
}


class Failure(Exception):
    """Reason why no more can be checked."""


def wait_for(what, condition, process=None):
    """Waits until the condition is true, and returns its value. On a timeout, reports its last `Failure`."""
    end = time.monotonic() + TIMEOUT_S
    reason = ""
    while time.monotonic() < end:
        if process is not None and process.poll() is not None:
            raise Failure(f"Prometheus ended with exit code {process.returncode}")
        try:
            if value := condition():
                return value
        except Failure as failure:
            reason = f": {failure}"
        time.sleep(0.1)
    raise Failure(f"{what}: not within {TIMEOUT_S} s{reason}")


class Prometheus:
    """The API of a running Prometheus."""

    def __init__(self, address):
        self.address = address
        # The address is on this machine: ignore proxy settings.
        self.opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))

    def get(self, path, **parameters):
        url = f"http://{self.address}/api/v1/{path}?{urllib.parse.urlencode(parameters)}"
        try:
            with self.opener.open(url, timeout=TIMEOUT_S) as answer:
                return json.load(answer)["data"]
        except urllib.error.HTTPError as error:
            raise Failure(f"{path}: {error.read().decode(errors='replace')}") from error
        except OSError as error:
            raise Failure(f"Prometheus does not answer: {error}") from error

    def instant(self, query, at):
        """Returns labels and value of each series."""
        result = self.get("query", query=query, time=at)["result"]
        return [(one["metric"], float(one["value"][1])) for one in result]

    def samples(self, metric):
        """Returns time and value of each sample of a metric that Prometheus records for every scrape of the monitor."""
        result = self.get("query", query=f'{metric}{{job="fringeflow"}}[1h]')["result"]
        if len(result) != 1:
            raise Failure(f"{metric}: {len(result)} series instead of one")
        return [(time_s, float(value)) for time_s, value in result[0]["values"]]

    def values(self, query, start, end):
        """Returns all values of all series in a range, step 2s."""
        result = self.get("query_range", query=query, start=start, end=end, step=2)["result"]
        return [float(value) for one in result for _, value in one["values"]]


def configure(folder, url, token):
    """Copies configuration and rules into the folder, with the address and the token of the monitor."""
    shutil.copy(CONFIGS / "alerts.yml", folder)
    text = (CONFIGS / "prometheus.yml").read_text(encoding="utf-8")
    text, found = re.subn(r'targets: \[".*"\]', f'targets: ["{url.netloc}"]', text)
    if found != 1:
        raise Failure("configs/prometheus.yml: there must be exactly one target")
    if token is not None:
        # Activate the lines that the comment in the file shows.
        text, found = re.subn(r"^( *)# (authorization:)\n *# ( *credentials_file: (.*))$", r"\1\2\n\1\3", text, flags=re.M)
        if found != 1:
            raise Failure("configs/prometheus.yml: no comment shows how to set a token")
        (folder / "fringeflow.token").write_text(token, encoding="utf-8")
    (folder / "prometheus.yml").write_text(text, encoding="utf-8")


def promtool(binaries, *arguments):
    done = subprocess.run([binaries / "promtool", *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failure(f"promtool {' '.join(map(str, arguments))}:\n{done.stdout}{done.stderr}")


def die_with_parent():
    """Ends Prometheus even if this process is killed."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


@contextlib.contextmanager
def running(binaries, folder):
    """Runs Prometheus on a free port of the loopback interface."""
    log = folder / "log.txt"
    command = [
        binaries / "prometheus",
        f"--config.file={folder / 'prometheus.yml'}",
        f"--storage.tsdb.path={folder / 'data'}",
        "--web.listen-address=127.0.0.1:0",
    ]
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, "GOMAXPROCS": "1"},
            preexec_fn=die_with_parent,
        )
    try:
        port = r'"Listening on".*address=(127\.0\.0\.1:\d+)'
        listening = wait_for("Prometheus listens", lambda: re.search(port, log.read_text(encoding="utf-8")), process)
        yield Prometheus(listening[1])
    except Failure as failure:
        last = "\n".join(log.read_text(encoding="utf-8").splitlines()[-5:])
        raise Failure(f"{failure}\nLast messages of Prometheus:\n{last}") from failure
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def target_up(server):
    (target,) = server.get("targets")["activeTargets"] or [None]
    if target is None or target["health"] == "unknown":
        return False
    if target["health"] != "up":
        raise Failure(f"{target['scrapeUrl']}: {target['lastError']}")
    return True


def evaluated_rules(server):
    rules = [rule for group in server.get("rules")["groups"] for rule in group["rules"]]
    return rules if rules and all(rule["health"] != "unknown" for rule in rules) else None


def rules(server, series):
    """Yields a sentence for each problem with the rules."""
    found = wait_for("every rule is evaluated", lambda: evaluated_rules(server))
    others = ["up", *(rule["name"] for rule in found if rule["type"] == "recording")]
    series = {**series, **{name: [labels for labels, _ in server.instant(name, time.time())] for name in others}}
    tests = ALERT_TESTS.read_text(encoding="utf-8")
    for rule in found:
        if rule["health"] != "ok":
            yield f"rule {rule['name']} is {rule['health']}: {rule['lastError']}"
        yield from (f"rule {rule['name']}: {problem}" for problem in promql.unknown_names(rule["query"], series))
        if rule["type"] == "alerting" and f'alertname="{rule["name"]}"' not in tests:
            yield f"rule {rule['name']} has no test in {ALERT_TESTS.name}"


def alerts(server):
    """Returns the pending and firing alerts by name, and problems with them."""
    found = collections.defaultdict(list)
    for alert in server.get("alerts")["alerts"]:
        labels = {k: v for k, v in alert["labels"].items() if k not in ("alertname", "job", "instance", "severity")}
        found[alert["labels"]["alertname"]].append({"state": alert["state"], **labels, **alert["annotations"]})
    problems = [f"{name} is {one['state']}: {one['summary']}" for name in NEVER & found.keys() for one in found[name]]
    unexpanded = [f"{name}: {one}" for name, many in found.items() for one in many if "error expanding" in str(one)]
    return dict(found), problems + unexpanded


def fill_in(query, variables):
    for name, value in variables.items():
        query = re.sub(rf"\$(?:{name}\b|{{{name}}})", lambda _, value=value: value, query)
    return query


def variables(server, dashboard, start, end):
    """Returns the values that Grafana would use for the variables."""
    found = {**GRAFANA_VARIABLES, "__range": f"{int(end - start)}s"}
    for variable in dashboard["templating"]["list"]:
        if variable["type"] != "query":
            continue
        metric, label = re.fullmatch(r"label_values\(([^,]+), *(\w+)\)", variable["query"]["query"]).groups()
        choices = server.get(f"label/{label}/values", **{"match[]": metric, "start": start, "end": end})
        if not choices:
            raise Failure(f"the variable {variable['name']} of the dashboard has no values")
        found[variable["name"]] = choices[0]
    return found


def panels(server, start, end, may_be_empty):
    """Yields a sentence for each problem with the queries of the dashboard."""
    dashboard = json.loads((CONFIGS / "grafana.json").read_text(encoding="utf-8"))
    known = variables(server, dashboard, start, end)
    titles = {panel["title"] for panel in dashboard["panels"]}
    yield from (f'panel "{title}", which may be empty, does not exist' for title in sorted(may_be_empty - titles))
    for panel in dashboard["panels"]:
        for target in panel.get("targets", []):
            where = f'panel "{panel["title"]}", query {target["refId"]}'
            query = fill_in(target["expr"], known)
            if "$" in query:
                yield f"{where}: unknown variable: {query}"
                continue
            try:
                values = server.values(query, start, end)
            except Failure as failure:
                yield f"{where}: {failure}"
                continue
            if panel["title"] not in may_be_empty and not any(map(math.isfinite, values)):
                yield f"{where}: {'only NaN' if values else 'no data'}: {query}"


def series_of(server, start, end):
    """Returns the label sets of each metric of the monitor by its name, and problems with their number."""
    selector = '{job="fringeflow",__name__=~"fringeflow_.+"}'
    ever = server.get("series", **{"match[]": selector, "start": start, "end": end})
    now = [labels for labels, _ in server.instant(selector, end)]
    # Failed scrapes have no samples.
    numbers = {int(number) for _, number in server.samples("scrape_samples_scraped") if number > 0}
    problems = []
    if len(numbers) != 1:
        problems.append(f"the number of series changes: {min(numbers)} to {max(numbers)}")
    if gone := [labels for labels in ever if labels not in now]:
        problems.append(f"{len(gone)} series appeared and disappeared, among them {gone[:3]}")
    found = collections.defaultdict(list)
    for labels in now:
        found[labels["__name__"]].append(labels)
    return found, problems


def quantile(value, quantile_of, buckets):
    """Returns the bucket that holds the quantile, by the rule of Prometheus. `buckets`: cumulative counts by bound."""
    above = 0.0
    for bound in sorted(buckets):
        if buckets[bound] >= quantile_of * buckets[math.inf]:
            return {"seconds": value, "above": above, "up_to": bound if math.isfinite(bound) else None}
        above = bound
    raise Failure(f"a histogram without the bucket +Inf: {buckets}")


def histograms(server, name, label, window, at):
    """Returns count, sum and percentiles by the value of the label, since the start or over a window; and problems."""
    over = (lambda metric: f"increase({metric}[{window}])") if window else (lambda metric: metric)
    by = f"by (le, {label})" if label else "by (le)"
    buckets = collections.defaultdict(dict)
    for labels, count in server.instant(f"sum {by} ({over(name + '_bucket')})", at):
        buckets[labels.get(label)][float(labels["le"])] = count
    counts, sums = (
        {labels.get(label): v for labels, v in server.instant(over(name + end), at)} for end in ("_count", "_sum")
    )
    values = {
        percentile: {
            labels.get(label): v
            for labels, v in server.instant(f"histogram_quantile({q}, sum {by} ({over(name + '_bucket')}))", at)
        }
        for percentile, q in QUANTILES.items()
    }
    found, problems = {}, []
    for key, own in buckets.items():
        which = f"{name} {key or ''}".rstrip()
        steps = [own[bound] for bound in sorted(own)]
        if steps != sorted(steps):
            problems.append(f"{which}: the cumulative counts of the buckets decrease: {own}")
        if not math.isclose(own.get(math.inf, -1), counts.get(key, -2), abs_tol=1e-6):
            problems.append(f"{which}: the bucket +Inf and the count differ: {own.get(math.inf)}, {counts.get(key)}")
        if not own.get(math.inf):
            found[key] = None
            continue
        found[key] = {"count": counts.get(key), "sum": sums.get(key)}
        for percentile, q in QUANTILES.items():
            one = quantile(values[percentile][key], q, own)
            found[key][percentile] = one
            # For the last bucket, Prometheus returns its lower bound.
            if not one["above"] <= one["seconds"] <= (one["up_to"] or one["above"]):
                problems.append(f"{which}: {percentile} is not within its bucket: {one}")
    return found, problems


def latencies(server, window, at):
    total, a = histograms(server, "fringeflow_exposure_to_cloud_seconds", None, window, at)
    stages, b = histograms(server, "fringeflow_stage_latency_seconds", "stage", window, at)
    segments, c = histograms(server, "fringeflow_segment_seconds", "segment", window, at)
    total = total.get(None)
    problems = a + b + c
    if total is not None and window is None:
        counts = {s["count"] if s else 0 for s in segments.values()}
        # A window has segments only after three processes have reported it. If one report is missed, it has none.
        least = total["count"] * (1 - SEGMENTS_TOLERANCE) - 2
        if len(counts) != 1 or not least <= min(counts) <= total["count"]:
            problems.append(f"the segments count {sorted(counts)} of {total['count']} windows")
        sums = sum(s["sum"] for s in segments.values() if s)
        if counts == {total["count"]} and not math.isclose(sums, total["sum"], rel_tol=SEGMENTS_TOLERANCE):
            problems.append("the segments do not add up to exposure to cloud")
    return {"exposure_to_cloud": total, "stages": stages, "segments": segments}, problems


def observe(server, seconds, idle):
    """Returns what Prometheus computes, and problems."""
    wait_for("the monitor is up", lambda: target_up(server))
    time.sleep(seconds)
    scrapes = server.samples("up")
    successful = [time_s for time_s, up in scrapes if up == 1]
    if len(successful) < LEAST_SCRAPES or len(successful) < (1 - MAX_FAILED_SHARE) * len(scrapes):
        raise Failure(f"{len(successful)} of {len(scrapes)} scrapes succeeded")
    start, end = successful[0], successful[-1]
    window = f"{math.ceil(end - start)}s"
    problems = []

    def keep(result_and_problems):
        result, new_problems = result_and_problems
        problems.extend(new_problems)
        return result

    series = keep(series_of(server, start, end))
    problems.extend(rules(server, series))
    problems.extend(panels(server, start, end, MAY_BE_EMPTY.keys() | (NEED_A_SCAN if idle else set())))
    seen = {
        "scrapes": len(successful),
        "series": sum(map(len, series.values())),
        "alerts": keep(alerts(server)),
        "since_start": keep(latencies(server, None, end)),
        "observed": keep(latencies(server, window, end)),
    }
    if not idle and seen["observed"]["exposure_to_cloud"] is None:
        problems.append("no cloud was made while Prometheus was running")
    return seen, problems


def main():
    parser = argparse.ArgumentParser(description="Scrapes a running monitor with a real Prometheus, checks the result.")
    parser.add_argument("url", type=urllib.parse.urlsplit, help="URL of the monitor, such as http://127.0.0.1:8780")
    parser.add_argument("binaries", type=pathlib.Path, help="folder with prometheus and promtool")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long Prometheus runs")
    parser.add_argument("--token", help="token of the monitor")
    parser.add_argument("--idle", action="store_true", help="the instance does not scan")
    arguments = parser.parse_args()
    if arguments.url.scheme != "http" or not arguments.url.netloc:
        parser.error("the URL must be http://ADDRESS:PORT")
    # Exit normally on SIGTERM, so that Prometheus is stopped and files are removed.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    try:
        with tempfile.TemporaryDirectory(prefix="fringeflow-prometheus-") as name:
            folder = pathlib.Path(name)
            configure(folder, arguments.url, arguments.token)
            promtool(arguments.binaries, "check", "config", folder / "prometheus.yml")
            promtool(arguments.binaries, "check", "rules", folder / "alerts.yml")
            with running(arguments.binaries, folder) as server:
                seen, problems = observe(server, arguments.seconds, arguments.idle)
    except Failure as failure:
        sys.exit(f"prometheus.py: {failure}")
    json.dump(seen, sys.stdout, indent=1, allow_nan=False)
    print()
    for problem in problems:
        print(f"prometheus.py: {problem}", file=sys.stderr)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
