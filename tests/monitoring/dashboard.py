"""Checks the monitor's page in a headless Chromium: dashboard.py URL

URL is that of the monitor; with a token: ADDRESS/?token=.... The instance must scan with virtual images, must not
record, and must accept commands. Prints one line for each check; exit code 0 means that all succeeded.
"""

import argparse
import os
import pathlib
import re
import signal
import sys
import time

from browser import Failure, Gone, chromium, wait_for
from layout import SIZES, describe, misfits

PANELS = {
    "panel-cloud",
    "panel-pictures",
    "panel-latency",
    "panel-shares",
    "panel-rates",
    "panel-drops",
    "panel-health",
    "panel-services",
    "panel-delta",
    "panel-quality",
    "panel-events",
    "panel-key-figures",
    "panel-flow",
}
PICTURES = ["camera1", "camera2", "phase", "modulation", "depth"]
# Panels with plots, and how many each has.
PLOTS = {"panel-latency": 1, "panel-shares": 1, "panel-rates": 1, "panel-delta": 1, "panel-quality": 10}

DESKTOP = (1440, 900)
TABLET = (820, 1180)

# A text that acts as markup, script, URL or attribute if the page does not escape it.
HOSTILE = "<img src=x onerror=alert(1)>\"'&"

# Shares of the pixels of a canvas: a cloud fills at least LEAST_CLOUD; a turned view differs by at least LEAST_TURN;
# two drawings of the same view differ by less than SAME.
LEAST_CLOUD = 0.05
LEAST_TURN = 0.02
SAME = 0.002

# After this number of failures, the other checks are left out: each may take a minute to fail.
MAX_FAILURES = 4


class Checks:
    """All checks, with the number of failures."""

    def __init__(self, page, arguments):
        self.page = page
        self.url = arguments.url
        self.pictures = arguments.pictures
        self.recordings = arguments.recordings
        self.monitor_pid = arguments.restart_pid
        self.is_tracked = arguments.tracked
        self.failed = 0
        # What the page showed as the result of the command before.
        self.previous_result = ""

    def run(self, check):
        """Runs a check and prints its result. Returns whether it succeeded."""
        name = check.__name__.replace("_", " ")
        begin = time.monotonic()
        try:
            found = check()
        except Gone:
            raise
        except Failure as failure:
            self.failed += 1
            print(f"FAILED  {name}: {failure}", flush=True)
            expect(self.failed < MAX_FAILURES, f"{self.failed} checks failed, the others are left out")
            return False
        print(f"ok      {name}: {found} ({time.monotonic() - begin:.0f} s)", flush=True)
        return True

    # Loading and live data.

    def the_page_becomes_live(self):
        self.page.resize(*DESKTOP)
        self.page.theme("light")
        self.page.open(self.url)
        wait_for("the page shows that it is live", lambda: self.page.text("#connection") == "Live")
        expect(self.page.run("document.body.dataset.connection") == "live", "the body has no data-connection=live")
        expect(instance := self.page.text("#instance"), "the page does not show the name of the instance")
        expect(instance in self.page.run("document.title"), "the title does not contain the name of the instance")
        return f"instance {instance}"

    def the_page_begins_with_what_the_scan_makes(self):
        expected = "model" if self.is_tracked else "cloud"
        shown = self.page.run("one('#cloud-source').value")
        expect(shown == expected, f"the page shows the {shown} first, not the {expected}")
        expect(self.page.run("one('#virtual-images').checkVisibility()"), "the page does not say that images are virtual")
        self.wait_for_cloud()
        return f"the {expected}, of virtual images"

    def all_panels_become_live(self):
        found = self.page.ask("livePanels")
        expect(found.keys() == PANELS, f"unknown or missing panels: {sorted(found.keys() ^ PANELS)}")
        self.wait_until_all_live()
        return f"{len(PANELS)} panels"

    def wait_until_all_live(self):
        def all_live():
            dead = sorted(name for name, live in self.page.ask("livePanels").items() if not live)
            expect(not dead, f"no data-live=true on {', '.join(dead)}")
            return True

        wait_for("all panels are live", all_live)

    def key_figures_change(self):
        names = ["cloud-rate", "latency-p50", "latency-p99", "points", "lost", "efc", "drift"]
        shown = wait_for("every key figure has a number", lambda: self.numbers([f"#figure-{name}" for name in names]))
        for name in ("cloud-rate", "latency-p50", "latency-p99", "points"):
            expect(shown[f"#figure-{name}"] > 0, f"the key figure {name} is {shown[f'#figure-{name}']}")
        self.wait_for_change("#panel-key-figures")
        return ", ".join(f"{name} {shown[f'#figure-{name}']:g}" for name in names)

    def numbers(self, selectors):
        return {selector: number(self.page.text(selector), selector) for selector in selectors}

    def wait_for_change(self, selector):
        before = self.page.text(selector)
        wait_for(f"the text of {selector} changes", lambda: self.page.text(selector) != before)

    def plots_have_lines_that_change(self):
        for panel, count in PLOTS.items():
            canvases = self.page.ask("numberCanvases", f"#{panel} canvas")
            expect(len(canvases) == count, f"{panel} has {len(canvases)} plots instead of {count}")
            for canvas in canvases:
                # Axes and their labels are grey; only data are coloured.
                wait_for(f"{canvas} shows coloured lines", lambda c=canvas: self.page.capture(c).vivid > 50)
            self.wait_for_other_pixels(canvases[0])
        return f"{sum(PLOTS.values())} plots in {len(PLOTS)} panels"

    def wait_for_other_pixels(self, selector):
        before = self.page.capture(selector)
        wait_for(f"the pixels of {selector} change", lambda: self.page.capture(selector).differs(before) > SAME)

    def tables_agree_with_the_monitor(self):
        services = self.wait_until_monitor_agrees("services", self.services_differ)
        stages = self.wait_until_monitor_agrees("stages", self.flow_differs)
        self.wait_until_monitor_agrees("drops", self.drops_differ, "losses")
        self.wait_until_monitor_agrees("capacity", self.capacity_differs)
        quantities = self.wait_until_monitor_agrees("window", self.health_differs)["health"]["quantities"]
        self.wait_for_change("#services-rows")
        self.wait_for_change("#flow-rows")
        self.wait_until_monitor_agrees("recorder", self.recorder_differs)
        for selector in ("#skew", "#disk-free", "#memory-free"):
            number(self.page.text(selector), selector)
        return f"{len(services)} services, {len(stages)} stages, {len(quantities)} quantities of health"

    def wait_until_monitor_agrees(self, key, differs, *more):
        """Compares page and monitor until they agree, because figures arrive only once a second."""

        def same():
            figures = self.page.ask("figures")
            expect(not (difference := differs(*(figures[name] for name in (key, *more)))), difference)
            return figures[key]

        return wait_for(f"the page shows the {key} that /figures has", same)

    def services_differ(self, services):
        rows = {row[0]: row for row in self.page.ask("tableOf", "#services-rows")}
        if rows.keys() != {service["name"] for service in services}:
            return f"other services are shown: {', '.join(rows) or 'none'}"
        for service in services:
            _, state, why, restarts, *_ = rows[service["name"]]
            expected = (service["state"], service["why"], f"{service['restarts']}")
            if (state, why, restarts) != expected:
                return f"{service['name']} is shown as {(state, why, restarts)}, but is {expected}"
        return None

    def health_differs(self, window):
        health = window["health"]
        if self.page.text("#health-state") != health["state"]:
            return f"the health is shown as {self.page.text('#health-state')}, but is {health['state']}"
        if self.page.text("#figure-health") != health["state"]:
            return f"the key figure of health is {self.page.text('#figure-health')}, but it is {health['state']}"
        rows = self.page.ask("tableOf", "#health-rows")
        if len(rows) != len(health["quantities"]):
            return f"{len(rows)} quantities of health are shown, but there are {len(health['quantities'])}"
        for row, gauge in zip(rows, health["quantities"]):
            shown = (row[0].lower(), row[1])
            if shown != (gauge["title"].lower(), gauge["state"]):
                return f"{gauge['quantity']} is shown as {shown}, but is {gauge['title']}, {gauge['state']}"
            if gauge["level"] is not None:
                scale = 1 if gauge["unit"] else 100
                if abs(number(row[2], f"level of {gauge['quantity']}") - scale * gauge["level"]) > 0.051:
                    return f"{gauge['quantity']} is shown as {row[2]}, but is {gauge['level']}"
        return None

    def flow_differs(self, stages):
        rows = self.page.ask("tableOf", "#flow-rows")
        if len(rows) != len(stages):
            return f"{len(rows)} stages are shown, but there are {len(stages)}"
        for row, stage in zip(rows, stages):
            if row[0].lower().replace(" ", "") != stage["stage"].lower():
                return f"the row of {stage['stage']} is named {row[0]}"
            if stage["rate_hz"] > 0 and number(row[1], f"rate of {row[0]}") == 0:
                return f"{row[0]} is shown with rate {row[1]}, but has {stage['rate_hz']:.1f} /s"
        return None

    def drops_differ(self, drops, losses):
        rows = self.page.ask("tableOf", "#drops-rows")
        if len(rows) != len(drops):
            return f"{len(rows)} rows of drops and incidents are shown, but there are {len(drops)}"
        lost = sum(drop["count"] for drop in drops if drop["kind"] == "loss")
        shown = sum(number(row[3], "count of a loss") for row in rows if row[0] == "Loss")
        if shown != lost:
            return f"{shown:g} losses are shown, but there are {lost}"
        summary = self.page.text("#drops-summary")
        expected = f"Since the start: {losses}."
        if not summary.startswith(expected):
            return f"the summary of drops is “{summary}” for {lost} losses, but the monitor states “{losses}”"
        return None

    def recorder_differs(self, recorder):
        shown = self.page.text("#disk-note")
        is_same = shown.lower() == recorder["text"].lower()
        return None if is_same else f"the disk is described as “{shown}”, but the recorder says “{recorder['text']}”"

    def capacity_differs(self, capacity):
        shown = self.page.text("#capacity")
        expected = f"{capacity}." if capacity else ""
        return None if shown == expected else f"the capacity is shown as “{shown}”, but is “{capacity}”"

    def pictures_show_the_object(self):
        hues = 0
        for name in PICTURES:
            captured = self.wait_for_picture(f"#picture-{name}")
            if name == "phase":
                hues = captured.hues
                expect(hues >= 12, f"the phase has only {hues} of 24 hues; a whole turn has all")
        self.wait_for_other_pixels("#picture-camera1")
        return f"{len(PICTURES)} pictures, phase with {hues} of 24 hues"

    def wait_for_picture(self, selector):
        def plausible():
            captured = self.page.capture(selector)
            expect(captured.scatter > 5, f"lightness {captured.lightness:.0f} ± {captured.scatter:.1f} is one grey")
            expect(captured.foreground > LEAST_CLOUD, f"{captured.foreground:.1%} of its pixels are not background")
            return captured

        return wait_for(f"{selector} shows a picture", plausible)

    # The cloud.

    def the_cloud_is_drawn_and_changes(self):
        captured = self.wait_for_cloud()
        self.wait_for_other_pixels("#cloud-canvas")
        points = number(self.page.text("#cloud-points"), "#cloud-points")
        expect(points > 0, "the cloud has no points")
        return f"{points:g} points, {captured.foreground:.0%} of the pixels, {captured.colours} colours"

    def view(self):
        """Captures the cloud without the outline that marks the focus."""
        return self.page.capture("#cloud-canvas", inset=8)

    def wait_for_cloud(self):
        def plausible():
            captured = self.view()
            expect(captured.foreground > LEAST_CLOUD, f"{captured.foreground:.1%} of its pixels are not background")
            expect(captured.colours >= 30, f"it has only {captured.colours} colours")
            expect(captured.hues >= 4, f"it has only {captured.hues} of 24 hues; depth is shown in several")
            return captured

        return wait_for("the cloud fills its canvas", plausible)

    def the_cloud_turns_by_keys_and_mouse(self):
        # The scan must be stopped: then a change can only come from turning.
        self.page.click("#cloud-canvas")
        self.page.press("r")
        first = self.view()
        again = self.view().differs(first)
        expect(again < SAME, f"{again:.1%} of the cloud changes although the scan is stopped")
        turned = []
        for key in ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"):
            for _ in range(3):
                self.page.press(key)
            turned.append((key, self.view().differs(first)))
            self.page.press("r")
        self.page.drag("#cloud-canvas", 120, 60)
        turned.append(("a drag of the mouse", self.view().differs(first)))
        for how, share in turned:
            expect(share > LEAST_TURN, f"{how} changes only {share:.1%} of the cloud")
        self.page.press("r")
        back = self.view().differs(first)
        expect(back < SAME, f"after R {back:.1%} of the view differs from the first")
        self.page.press("+")
        zoomed = self.view().differs(first)
        expect(zoomed > LEAST_TURN, f"+ changes only {zoomed:.1%} of the cloud")
        self.page.click("#cloud-reset")
        back = self.view().differs(first)
        expect(back < SAME, f"after “Reset view” {back:.1%} of the view differs from the first")
        return ", ".join(f"{how} {share:.0%}" for how, share in turned) + " other pixels; R and the button reset"

    def the_histogram_can_show_the_whole_turn(self):
        # The scan must be stopped here too.
        first = self.page.capture("#delta-plot")
        again = self.page.capture("#delta-plot")
        expect(again.differs(first) < SAME, "the histogram changes although the scan is stopped")
        self.page.click("#delta-whole")
        wait_for(
            "“Whole turn” changes the histogram",
            lambda: self.page.capture("#delta-plot").differs(first) > LEAST_TURN,
        )
        self.page.click("#delta-whole")
        wait_for(
            "the histogram is as before without “Whole turn”",
            lambda: self.page.capture("#delta-plot").differs(first) < SAME,
        )
        return "from near zero to the whole turn and back"

    # Commands.

    def a_refused_command_shows_the_reason(self):
        expect(self.page.text("#recording") == "Not recording", "a recording is already running")
        self.page.click("#mark-text")
        self.page.type("too early")
        self.page.click("#button-mark")
        wait_for(
            "the page shows that a mark without a recording is refused",
            lambda: self.page.text("#command-result").startswith("Not done: "),
        )
        is_visible = self.page.run("one('#command-result').checkVisibility({ opacityProperty: true })")
        expect(is_visible, "the reason is not visible")
        reason = self.page.text("#command-result")
        expect(self.page.run("one('#mark-text').value") == "too early", "the text of the refused mark is gone")
        self.page.run("one('#mark-text').value = ''")
        return reason

    def command(self, give):
        self.previous_result = self.page.text("#command-result")
        give()

    def fail_if_refused(self):
        """Fails if the last command was refused, with the reason that the page shows."""
        result = self.page.text("#command-result")
        refused = result != self.previous_result and self.page.run("one('#command-result').dataset.level") == "error"
        expect(not refused, f"the page shows “{result}”")

    def a_recording_with_a_hostile_mark(self):
        before = self.recorded("*")
        self.command(lambda: self.page.click("#button-record"))
        self.wait_for_state("#recording", "Recording ", "the recording begins")
        expect(self.page.text("#button-record") == "End recording", "the button does not offer to end the recording")
        name = self.page.run("one('#recording').title")
        if self.recordings:
            wait_for(f"a file .mcap.part is in {self.recordings}", lambda: self.recorded("*.mcap.part") - before)
        self.mark(HOSTILE)
        # Wait until the recording has some messages.
        self.wait_for_change("#panel-key-figures")
        self.command(lambda: self.page.click("#button-record"))
        self.wait_for_state("#recording", "Not recording", "the recording ends")
        if not self.recordings:
            return f"{name}, with the mark {HOSTILE}"
        (path,) = wait_for("the recording gets its final name", lambda: self.recorded("*.mcap") - before)
        expect(path.stat().st_size > 0, f"{path} is empty")
        expect(not (left := self.recorded("*.part") - before), f"left over: {sorted(map(str, left))}")
        return f"{path.name}, {path.stat().st_size} bytes, with the mark {HOSTILE}"

    def recorded(self, pattern):
        return set(self.recordings.glob(pattern)) if self.recordings else set()

    def wait_for_state(self, selector, text, what):
        def is_shown():
            self.fail_if_refused()
            expect((shown := self.page.text(selector)).startswith(text), f"{selector} shows “{shown}”")
            return True

        wait_for(what, is_shown)

    def mark(self, text):
        """Sets a mark by keyboard. It must become an event with exactly this text, and nothing else."""
        self.page.run("one('#mark-text').focus()")
        self.page.type(text)
        self.command(lambda: self.page.press("Enter"))

        def is_listed():
            self.fail_if_refused()
            expect(not self.page.dialogs, f"the text of the mark was executed: dialog {self.page.dialogs}")
            injected = self.page.ask("injectedElements")
            expect(not injected, f"the text of the mark created {injected} elements")
            return any(text in event for event in self.page.ask("eventTexts"))

        wait_for(f"the mark {text} is an event with exactly this text", is_listed)
        wait_for("the page confirms the mark with its text", lambda: text in self.page.text("#command-result"))
        wait_for("the text field is empty once the mark is set", lambda: self.page.run("one('#mark-text').value") == "")

    def stop_scan_stops_the_clouds(self):
        self.command(lambda: self.page.click("#button-scan"))
        self.wait_for_state("#scanning", "Not scanning", "the scan stops")
        selectors = ["#figure-cloud-rate", *RATES]
        wait_for(
            "images and clouds go to zero a second",
            lambda: all(value == 0 for value in self.numbers_or_zero(selectors).values()),
        )
        expect(self.page.text("#button-scan") == "Start scan", "the button does not offer to start the scan")
        return "no images and no clouds"

    def numbers_or_zero(self, selectors):
        """Like `numbers`; a dash counts as 0."""
        texts = {selector: self.page.text(selector) for selector in selectors}
        return {selector: 0 if text.startswith("–") else number(text, selector) for selector, text in texts.items()}

    def start_scan_starts_the_clouds_again(self):
        self.command(lambda: self.page.click("#button-scan"))
        self.wait_for_state("#scanning", "Scanning", "the scan starts")
        selectors = ["#figure-cloud-rate", *RATES]
        wait_for(
            "images and clouds arrive again",
            lambda: all(value > 0 for value in self.numbers_or_zero(selectors).values()),
        )
        self.wait_for_other_pixels("#cloud-canvas")
        return "images and clouds arrive, and the cloud changes"

    # Controls and layout.

    def the_keyboard_reaches_every_control(self):
        self.page.ask("unfocus")
        names = {int(index): name for index, name in self.page.ask("controlNames").items()}
        reached, wrong = [], []
        for _ in range(2 * len(names)):
            self.page.press("Tab")
            focused = self.page.ask("focused")
            if focused is None or focused["index"] in reached:
                break
            reached.append(focused["index"])
            if focused["wrong"]:
                wrong.append(f"{names.get(focused['index'])} {focused['wrong']}")
        missing = [name for index, name in names.items() if index not in reached]
        expect(not missing, f"Tab does not reach {some(missing)}")
        expect(not wrong, some(wrong))
        jumps = [names.get(index) for before, index in zip(reached, reached[1:]) if index < before]
        expect(not jumps, f"Tab jumps back in the page to {some(jumps)}")
        return f"{len(reached)} controls, each with a visible focus"

    def explanations_open_and_close_by_keys(self):
        self.page.run("one('#panel-cloud summary').focus()")
        self.page.press("Enter")
        expect(self.page.run("one('#panel-cloud .help').open"), "Enter does not open the explanation of the cloud")
        self.page.press("Escape")
        is_open = self.page.run("one('#panel-cloud .help').open")
        expect(not is_open, "Escape does not close the explanation of the cloud")
        return "opened by Enter, closed by Escape"

    def everything_fits_and_health_is_on_the_first_screen(self):
        wrong = misfits(self.page)
        for width, height in SIZES:
            self.page.resize(width, height)
            if not self.page.ask("isOnFirstScreen", "#tile-health"):
                wrong.append(f"at {width}×{height}: the health is below the first screen")
        self.page.resize(*DESKTOP)
        expect(not wrong, some(wrong))
        return describe()

    def light_and_dark_differ(self):
        lightness = {}
        for name in ("dark", "light"):
            self.page.theme(name)
            lightness[name] = self.page.capture("#panel-rates").lightness
        expect(lightness["light"] > 150, f"light colours have lightness {lightness['light']:.0f}")
        expect(lightness["dark"] < 80, f"dark colours have lightness {lightness['dark']:.0f}")
        return f"lightness {lightness['light']:.0f} and {lightness['dark']:.0f} of 255"

    def pictures_of_the_page(self):
        self.pictures.mkdir(parents=True, exist_ok=True)
        self.page.photograph(self.pictures / "dashboard-light.png", DESKTOP[0], None)
        self.page.photograph(self.pictures / "dashboard-tablet.png", *TABLET)
        self.page.theme("dark")
        self.page.photograph(self.pictures / "dashboard-dark.png", DESKTOP[0], None)
        self.page.theme("light")
        self.page.resize(*DESKTOP)
        return f"in {self.pictures}"

    # Connection and errors.

    def it_becomes_live_again_after_the_monitor_was_killed(self):
        before = self.monitor()
        expect(before["pid"] == self.monitor_pid, f"the monitor is process {before['pid']}, not {self.monitor_pid}")
        self.page.ask("recordConnections")
        os.kill(self.monitor_pid, signal.SIGKILL)

        def lost_connection_state():
            recorded = self.page.ask("recordedConnections")
            return next((one for one in recorded if one["state"] != "live" and one["banner"]), None)

        shown = wait_for("the page shows that the connection is lost", lost_connection_state)
        expect(shown["pill"] != "Live", "the page shows Live and a lost connection at once")
        expect(shown["live"] == 0, f"{shown['live']} panels have data-live=true although the connection is lost")
        wait_for("the page shows that it is live again", lambda: self.page.text("#connection") == "Live")
        expect(self.page.run("one('#connection-banner').hidden"), "the warning stays although the connection is back")
        self.wait_until_all_live()
        self.wait_for_change("#panel-key-figures")
        after = self.monitor()
        expect(after["pid"] != before["pid"], "the monitor is the same process: it was not restarted")
        self.wait_for_other_pixels("#cloud-canvas")
        return f"“{shown['banner']}”, then live with process {after['pid']}"

    def monitor(self):
        (found,) = [one for one in self.page.ask("figures")["services"] if one["name"] == "monitor"]
        return found

    def no_errors(self, provoked):
        """Checks that there were no errors except those that the test provoked: `provoked(text, url)`."""

        def the_console_has_no_errors():
            # Let the last exceptions arrive.
            self.page.ask("settled")
            errors = [f"{text} {url}".strip() for text, url in self.page.errors if not provoked(text, url)]
            self.page.errors.clear()
            expect(not self.page.dialogs, f"dialogs were opened: {self.page.dialogs}")
            unreadable = [text for text in self.page.ask("eventTexts") if text.startswith("cannot show a message")]
            expect(not errors + unreadable, some(list(dict.fromkeys(errors + unreadable))))
            return "no error, no uncaught exception, no dialog"

        self.run(the_console_has_no_errors)


RATES = [f"#rates-legend li:nth-child({place}) .legend-value" for place in (1, 2, 4)]


def expect(condition, failure):
    if not condition:
        raise Failure(failure)


def some(problems):
    """Lists the first five problems, and counts the others."""
    more = f"; and {len(problems) - 5} more" if len(problems) > 5 else ""
    return "; ".join(map(str, problems[:5])) + more


def number(text, what):
    found = re.match(r"−?[\d,]+(\.\d+)?", text)
    expect(found, f"{what} shows “{text}”, not a number")
    return float(found[0].replace(",", "").replace("−", "-"))


def refused_command(text, url):
    return url.endswith("/control") and re.search(r"status of 4\d\d", text)


def lost_connection(text, url):
    return "WebSocket connection" in text or (url.endswith("/live") and "ERR_CONNECTION" in text)


def check_all(checks):
    if not checks.run(checks.the_page_becomes_live):
        # The errors may explain it.
        checks.no_errors(lambda text, url: False)
        return
    checks.run(checks.the_page_begins_with_what_the_scan_makes)
    if checks.is_tracked:
        if checks.pictures:
            checks.run(checks.pictures_of_the_page)
        checks.no_errors(lambda text, url: False)
        return
    for check in (
        checks.all_panels_become_live,
        checks.key_figures_change,
        checks.plots_have_lines_that_change,
        checks.tables_agree_with_the_monitor,
        checks.pictures_show_the_object,
        checks.the_cloud_is_drawn_and_changes,
        checks.light_and_dark_differ,
        checks.the_keyboard_reaches_every_control,
        checks.explanations_open_and_close_by_keys,
        checks.everything_fits_and_health_is_on_the_first_screen,
    ):
        checks.run(check)
    if checks.pictures:
        checks.run(checks.pictures_of_the_page)
    checks.run(checks.a_refused_command_shows_the_reason)
    checks.run(checks.a_recording_with_a_hostile_mark)
    if checks.run(checks.stop_scan_stops_the_clouds):
        checks.run(checks.the_cloud_turns_by_keys_and_mouse)
        checks.run(checks.the_histogram_can_show_the_whole_turn)
        checks.run(checks.start_scan_starts_the_clouds_again)
    checks.no_errors(refused_command)
    if checks.monitor_pid:
        checks.run(checks.it_becomes_live_again_after_the_monitor_was_killed)
        checks.no_errors(lost_connection)


def main():
    parser = argparse.ArgumentParser(description="Checks the monitor's page in a headless Chromium.")
    parser.add_argument("url", help="URL of the monitor, such as http://127.0.0.1:8780")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for screenshots of the page")
    parser.add_argument("--recordings", type=pathlib.Path, help="folder of the recordings, to check their files")
    parser.add_argument("--chromium", default="chromium", help="the Chromium program")
    parser.add_argument("--tracked", action="store_true", help="check only that the page begins with the model, and take pictures")
    parser.add_argument("--restart-pid", type=int, help="process of the monitor, to kill it; its port must be fixed")
    arguments = parser.parse_args()
    # Exit normally on SIGTERM, so that Chromium is ended.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    try:
        with chromium(arguments.chromium) as page:
            checks = Checks(page, arguments)
            check_all(checks)
    except Failure as failure:
        sys.exit(f"dashboard.py: {failure}")
    if checks.failed:
        sys.exit(f"dashboard.py: {checks.failed} checks failed")


if __name__ == "__main__":
    main()
