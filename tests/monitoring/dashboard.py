"""Drives the monitor's page in a headless Chromium, and checks that it shows and does what it should: dashboard.py URL

URL is that of the monitor of an instance that scans, does not record, and takes commands; with a token: ADDRESS/?token=....
Prints one line for each thing that was checked; exit code 0: all is well.
"""

import argparse
import os
import pathlib
import re
import signal
import sys
import time

from browser import Failure, Gone, chromium, wait_for

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
SIZES = [DESKTOP, TABLET, (1180, 820), (1366, 768)]

# Takes shape as markup, as JavaScript, as a URL and as an attribute, if anything lets it.
HOSTILE = "<img src=x onerror=alert(1)>\"'&"

# Of the pixels of a canvas: a cloud fills more; a view of it that was turned differs by more; the same view, which may be
# drawn a little otherwise, by less.
LEAST_CLOUD = 0.05
LEAST_TURN = 0.02
SAME = 0.002


# More checks than this do not fail one by one: each may take its minute.
ENOUGH = 4


class Checks:
    """What is checked, and what of it failed."""

    def __init__(self, page, arguments):
        self.page = page
        self.url = arguments.url
        self.pictures = arguments.pictures
        self.recordings = arguments.recordings
        self.monitor_pid = arguments.restart_pid
        self.failed = 0
        # What the page said of the command before.
        self.said = ""

    def run(self, check):
        """Runs a check, which returns what it found; true where it did not fail."""
        name = check.__name__.replace("_", " ")
        begin = time.monotonic()
        try:
            found = check()
        except Gone:
            raise
        except Failure as failure:
            self.failed += 1
            print(f"FAILED  {name}: {failure}", flush=True)
            expect(self.failed < ENOUGH, f"{self.failed} checks failed, the others are left out")
            return False
        print(f"ok      {name}: {found} ({time.monotonic() - begin:.0f} s)", flush=True)
        return True

    # Loading and live data.

    def the_page_gets_live(self):
        self.page.resize(*DESKTOP)
        self.page.theme("light")
        self.page.open(self.url)
        wait_for("the page says that it is live", lambda: self.page.text("#connection") == "Live")
        expect(self.page.run("document.body.dataset.connection") == "live", "the body has no data-connection=live")
        expect(instance := self.page.text("#instance"), "the page does not name the instance")
        expect(instance in self.page.run("document.title"), "the title does not name the instance")
        return f"instance {instance}"

    def all_panels_get_live(self):
        found = self.page.ask("livePanels")
        expect(found.keys() == PANELS, f"the panels differ from those known: {sorted(found.keys() ^ PANELS)}")
        self.wait_until_all_live()
        return f"{len(PANELS)} panels"

    def wait_until_all_live(self):
        def all_live():
            dead = sorted(name for name, live in self.page.ask("livePanels").items() if not live)
            expect(not dead, f"no data-live=true at {', '.join(dead)}")
            return True

        wait_for("all panels are live", all_live)

    def key_figures_move(self):
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

    def plots_have_lines_that_move(self):
        for panel, count in PLOTS.items():
            canvases = self.page.ask("numberCanvases", f"#{panel} canvas")
            expect(len(canvases) == count, f"{panel} has {len(canvases)} plots instead of {count}")
            for canvas in canvases:
                # Axes and their labels are grey; only data are of colours.
                wait_for(f"{canvas} shows coloured lines", lambda c=canvas: self.page.look(c).vivid > 50)
            self.wait_for_other_pixels(canvases[0])
        return f"{sum(PLOTS.values())} plots in {len(PLOTS)} panels"

    def wait_for_other_pixels(self, selector):
        before = self.page.look(selector)
        wait_for(f"what {selector} shows changes", lambda: self.page.look(selector).differs(before) > SAME)

    def tables_hold_what_the_monitor_says(self):
        services = self.as_the_monitor_says("services", self.services_differ)
        stages = self.as_the_monitor_says("stages", self.flow_differs)
        self.as_the_monitor_says("drops", self.drops_differ, "losses")
        self.as_the_monitor_says("pace", self.pace_differs)
        quantities = self.as_the_monitor_says("window", self.health_differs)["health"]["quantities"]
        self.wait_for_change("#services-rows")
        self.wait_for_change("#flow-rows")
        for selector in ("#skew", "#disk-free", "#memory-free"):
            number(self.page.text(selector), selector)
        return f"{len(services)} services, {len(stages)} stages, {len(quantities)} quantities of health"

    def as_the_monitor_says(self, key, differs, *more):
        """Figures come once a second, so page and monitor are compared until they agree."""

        def same():
            figures = self.page.ask("figures")
            expect(not (difference := differs(*(figures[name] for name in (key, *more)))), difference)
            return figures[key]

        return wait_for(f"the page shows the {key} that /figures has", same)

    def services_differ(self, services):
        rows = {row[0]: row for row in self.page.ask("tableOf", "#services-rows")}
        if rows.keys() != {service["name"] for service in services}:
            return f"the services differ: shown are {', '.join(rows) or 'none'}"
        for service in services:
            _, state, why, restarts, *_ = rows[service["name"]]
            expected = (service["state"], service["why"], f"{service['restarts']}")
            if (state, why, restarts) != expected:
                return f"{service['name']} is shown as {(state, why, restarts)}, and is {expected}"
        return None

    def health_differs(self, window):
        health = window["health"]
        if self.page.text("#health-state") != health["state"]:
            return f"the health is shown as {self.page.text('#health-state')}, and is {health['state']}"
        rows = self.page.ask("tableOf", "#health-rows")
        if len(rows) != len(health["quantities"]):
            return f"{len(rows)} quantities of health are shown, and there are {len(health['quantities'])}"
        for row, gauge in zip(rows, health["quantities"]):
            shown = (row[0].lower(), row[1])
            if shown != (gauge["title"].lower(), gauge["state"]):
                return f"{gauge['quantity']} is shown as {shown}, and is {gauge['title']}, {gauge['state']}"
            if gauge["level"] is not None:
                scale = 1 if gauge["unit"] else 100
                if abs(number(row[2], f"level of {gauge['quantity']}") - scale * gauge["level"]) > 0.051:
                    return f"{gauge['quantity']} is shown as {row[2]}, and is {gauge['level']}"
        return None

    def flow_differs(self, stages):
        rows = self.page.ask("tableOf", "#flow-rows")
        if len(rows) != len(stages):
            return f"{len(rows)} stages are shown, and there are {len(stages)}"
        for row, stage in zip(rows, stages):
            if row[0].lower().replace(" ", "") != stage["stage"].lower():
                return f"the row of {stage['stage']} is named {row[0]}"
            if stage["rate_hz"] > 0 and number(row[1], f"rate of {row[0]}") == 0:
                return f"{row[0]} has rate {row[1]} and not {stage['rate_hz']:.1f} /s"
        return None

    def drops_differ(self, drops, losses):
        rows = self.page.ask("tableOf", "#drops-rows")
        if len(rows) != len(drops):
            return f"{len(rows)} rows of drops and incidents are shown, and there are {len(drops)}"
        lost = sum(drop["count"] for drop in drops if drop["kind"] == "loss")
        shown = sum(number(row[3], "count of a loss") for row in rows if row[0] == "Loss")
        if shown != lost:
            return f"{shown:g} losses are shown, and there are {lost}"
        summary = self.page.text("#drops-summary")
        expected = f"Since the start: {losses}." if lost else "Nothing lost"
        if not summary.startswith(expected):
            return f"the summary of drops says “{summary}” with {lost} losses, and the monitor says “{losses}”"
        return None

    def pace_differs(self, pace):
        shown = self.page.text("#pace")
        return None if shown == (f"{pace}." if pace else "") else f"the pace is shown as “{shown}”, and is “{pace}”"

    def pictures_show_the_object(self):
        hues = 0
        for name in PICTURES:
            look = self.wait_for_picture(f"#picture-{name}")
            if name == "phase":
                hues = look.hues
                expect(hues >= 12, f"the phase has only {hues} of 24 hues, and a turn has all")
        self.wait_for_other_pixels("#picture-camera1")
        return f"{len(PICTURES)} pictures, phase with {hues} of 24 hues"

    def wait_for_picture(self, selector):
        def plausible():
            look = self.page.look(selector)
            expect(look.scatter > 5, f"lightness {look.lightness:.0f} ± {look.scatter:.1f} is one grey")
            expect(look.foreground > LEAST_CLOUD, f"{look.foreground:.1%} of its pixels are not background")
            return look

        return wait_for(f"{selector} shows something", plausible)

    # The cloud.

    def the_cloud_is_drawn_and_moves(self):
        look = self.wait_for_cloud()
        self.wait_for_other_pixels("#cloud-canvas")
        points = number(self.page.text("#cloud-points"), "#cloud-points")
        expect(points > 0, "the cloud has no points")
        return f"{points:g} points, {look.foreground:.0%} of the pixels, {look.colours} colours"

    def view(self):
        """The cloud without the outline that tells that it has the focus."""
        return self.page.look("#cloud-canvas", inset=8)

    def wait_for_cloud(self):
        def plausible():
            look = self.view()
            expect(look.foreground > LEAST_CLOUD, f"{look.foreground:.1%} of its pixels are not background")
            expect(look.colours >= 30, f"it has only {look.colours} colours")
            expect(look.hues >= 4, f"it has only {look.hues} of 24 hues; depth has several")
            return look

        return wait_for("the cloud fills its canvas", plausible)

    def the_cloud_turns_by_keys_and_mouse(self):
        # Needs a cloud that stays, so that what changes was turned.
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

    def the_histogram_shows_the_whole_turn_on_demand(self):
        # Needs one that stays, too.
        first = self.page.look("#delta-plot")
        expect(self.page.look("#delta-plot").differs(first) < SAME, "the histogram changes although the scan is stopped")
        self.page.click("#delta-whole")
        wait_for(
            "“Whole turn” changes the histogram",
            lambda: self.page.look("#delta-plot").differs(first) > LEAST_TURN,
        )
        self.page.click("#delta-whole")
        wait_for(
            "the histogram is as before without “Whole turn”",
            lambda: self.page.look("#delta-plot").differs(first) < SAME,
        )
        return "from the neighbourhood of zero to the whole turn and back"

    # Commands.

    def a_refused_command_says_why(self):
        expect(self.page.text("#recording") == "Not recording", "a recording runs already")
        self.page.click("#mark-text")
        self.page.type("too early")
        self.page.click("#button-mark")
        wait_for(
            "the page says that a mark without a recording is refused",
            lambda: self.page.text("#command-result").startswith("Not done: "),
        )
        expect(self.page.run("one('#command-result').checkVisibility({ opacityProperty: true })"), "nobody sees the reason")
        reason = self.page.text("#command-result")
        expect(self.page.run("one('#mark-text').value") == "too early", "the remark that was refused is gone")
        self.page.run("one('#mark-text').value = ''")
        return reason

    def command(self, give):
        self.said = self.page.text("#command-result")
        give()

    def fail_if_refused(self):
        """With what the page says of the last command."""
        said = self.page.text("#command-result")
        refused = said != self.said and self.page.run("one('#command-result').dataset.level") == "error"
        expect(not refused, f"the page says “{said}”")

    def a_recording_with_a_hostile_mark(self):
        before = self.recorded("*")
        self.command(lambda: self.page.click("#button-record"))
        self.wait_for_state("#recording", "Recording ", "the recording begins")
        expect(self.page.text("#button-record") == "End recording", "the button does not offer to end the recording")
        name = self.page.run("one('#recording').title")
        if self.recordings:
            wait_for(f"a file .mcap.part is in {self.recordings}", lambda: self.recorded("*.mcap.part") - before)
        self.mark(HOSTILE)
        # Long enough for something to be in it.
        self.wait_for_change("#panel-key-figures")
        self.command(lambda: self.page.click("#button-record"))
        self.wait_for_state("#recording", "Not recording", "the recording ends")
        if not self.recordings:
            return f"{name}, marked with {HOSTILE}"
        (path,) = wait_for("the recording gets its final name", lambda: self.recorded("*.mcap") - before)
        expect(path.stat().st_size > 0, f"{path} is empty")
        expect(not (left := self.recorded("*.part") - before), f"left over: {sorted(map(str, left))}")
        return f"{path.name}, {path.stat().st_size} bytes, marked with {HOSTILE}"

    def recorded(self, pattern):
        return set(self.recordings.glob(pattern)) if self.recordings else set()

    def wait_for_state(self, selector, text, what):
        def said():
            self.fail_if_refused()
            expect((shown := self.page.text(selector)).startswith(text), f"{selector} says “{shown}”")
            return True

        wait_for(what, said)

    def mark(self, text):
        """Sets a mark by keyboard; it becomes an event with this very text, and nothing else."""
        self.page.run("one('#mark-text').focus()")
        self.page.type(text)
        self.command(lambda: self.page.press("Enter"))

        def told():
            self.fail_if_refused()
            expect(not self.page.dialogs, f"a text of the mark was run: dialog {self.page.dialogs}")
            intruders = self.page.ask("intruders")
            expect(not intruders, f"{intruders} elements were made of the text of a mark")
            return any(text in event for event in self.page.ask("eventTexts"))

        wait_for(f"the mark {text} is an event with this very text", told)
        wait_for("the page confirms the mark with its text", lambda: text in self.page.text("#command-result"))
        wait_for("the remark is gone once the mark is set", lambda: self.page.run("one('#mark-text').value") == "")

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
        """A dash says that nothing came."""
        texts = {selector: self.page.text(selector) for selector in selectors}
        return {selector: 0 if text.startswith("–") else number(text, selector) for selector, text in texts.items()}

    def start_scan_brings_them_again(self):
        self.command(lambda: self.page.click("#button-scan"))
        self.wait_for_state("#scanning", "Scanning", "the scan starts")
        selectors = ["#figure-cloud-rate", *RATES]
        wait_for(
            "images and clouds come again",
            lambda: all(value > 0 for value in self.numbers_or_zero(selectors).values()),
        )
        self.wait_for_other_pixels("#cloud-canvas")
        return "images and clouds come, and the cloud moves"

    # Controls and layout.

    def the_keyboard_reaches_every_control(self):
        self.page.ask("unfocus")
        names = {int(place): name for place, name in self.page.ask("controlNames").items()}
        reached, wrong = [], []
        for _ in range(2 * len(names)):
            self.page.press("Tab")
            focused = self.page.ask("focused")
            if focused is None or focused["place"] in reached:
                break
            reached.append(focused["place"])
            if focused["wrong"]:
                wrong.append(f"{names.get(focused['place'])} {focused['wrong']}")
        missing = [name for place, name in names.items() if place not in reached]
        expect(not missing, f"Tab does not get to {some(missing)}")
        expect(not wrong, some(wrong))
        jumps = [names.get(place) for before, place in zip(reached, reached[1:]) if place < before]
        expect(not jumps, f"Tab jumps back in the page to {some(jumps)}")
        return f"{len(reached)} controls, each with a visible focus"

    def explanations_open_and_close_by_keys(self):
        self.page.run("one('#panel-cloud summary').focus()")
        self.page.press("Enter")
        expect(self.page.run("one('#panel-cloud .help').open"), "Enter does not open the explanation of the cloud")
        self.page.press("Escape")
        expect(not self.page.run("one('#panel-cloud .help').open"), "Escape does not close the explanation of the cloud")
        return "opened by Enter, closed by Escape"

    def nothing_overflows(self):
        wrong = []
        for width, height in SIZES:
            self.page.resize(width, height)
            wrong += [f"at {width}×{height}: {what}" for what in self.page.ask("overflows")]
            wrong += [f"at {width}×{height}: {what} is cut or covered" for what in self.page.ask("cutTexts")]
        self.page.resize(*DESKTOP)
        expect(not wrong, some(wrong))
        return ", ".join(f"{width}×{height}" for width, height in SIZES)

    def light_and_dark_differ(self):
        lightness = {}
        for name in ("dark", "light"):
            self.page.theme(name)
            lightness[name] = self.page.look("#panel-rates").lightness
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

    def it_gets_live_again_after_the_monitor_was_killed(self):
        before = self.monitor()
        expect(before["pid"] == self.monitor_pid, f"process {self.monitor_pid} is not the monitor, which is {before['pid']}")
        self.page.ask("noteConnections")
        os.kill(self.monitor_pid, signal.SIGKILL)

        def lost():
            noted = self.page.ask("notedConnections")
            return next((one for one in noted if one["state"] != "live" and one["banner"]), None)

        shown = wait_for("the page shows that the connection is dead", lost)
        expect(shown["pill"] != "Live", "the page says Live while it says that the connection is lost")
        expect(shown["live"] == 0, f"{shown['live']} panels have data-live=true although the connection is lost")
        wait_for("the page says that it is live again", lambda: self.page.text("#connection") == "Live")
        expect(self.page.run("one('#connection-banner').hidden"), "the warning stays although the connection is back")
        self.wait_until_all_live()
        self.wait_for_change("#panel-key-figures")
        after = self.monitor()
        expect(after["pid"] != before["pid"], "the monitor is the same process: it was not restarted")
        self.wait_for_other_pixels("#cloud-canvas")
        return f"“{shown['banner']}”, then live by process {after['pid']}"

    def monitor(self):
        (found,) = [one for one in self.page.ask("figures")["services"] if one["name"] == "monitor"]
        return found

    def no_errors(self, provoked):
        """`provoked(text, url)`: what the browser prints about what was done to the page on purpose."""

        def the_console_has_no_errors():
            # Lets what was thrown last come.
            self.page.ask("settled")
            alien = [f"{text} {url}".strip() for text, url in self.page.errors if not provoked(text, url)]
            self.page.errors.clear()
            expect(not self.page.dialogs, f"dialogs were opened: {self.page.dialogs}")
            unreadable = [text for text in self.page.ask("eventTexts") if text.startswith("cannot show a message")]
            expect(not alien + unreadable, some(list(dict.fromkeys(alien + unreadable))))
            return "no error, no uncaught exception, no dialog"

        self.run(the_console_has_no_errors)


RATES = [f"#rates-legend li:nth-child({place}) .legend-value" for place in (1, 2, 4)]


def expect(condition, failure):
    if not condition:
        raise Failure(failure)


def some(problems):
    """The first of them, and how many more there are."""
    more = f"; and {len(problems) - 5} more" if len(problems) > 5 else ""
    return "; ".join(map(str, problems[:5])) + more


def number(text, what):
    found = re.match(r"−?[\d,]+(\.\d+)?", text)
    expect(found, f"{what} shows “{text}” and no number")
    return float(found[0].replace(",", "").replace("−", "-"))


def refused_command(text, url):
    return url.endswith("/control") and re.search(r"status of 4\d\d", text)


def lost_connection(text, url):
    return "WebSocket connection" in text or (url.endswith("/live") and "ERR_CONNECTION" in text)


def check_all(checks):
    if not checks.run(checks.the_page_gets_live):
        # They may say why.
        checks.no_errors(lambda text, url: False)
        return
    for check in (
        checks.all_panels_get_live,
        checks.key_figures_move,
        checks.plots_have_lines_that_move,
        checks.tables_hold_what_the_monitor_says,
        checks.pictures_show_the_object,
        checks.the_cloud_is_drawn_and_moves,
        checks.light_and_dark_differ,
        checks.the_keyboard_reaches_every_control,
        checks.explanations_open_and_close_by_keys,
        checks.nothing_overflows,
    ):
        checks.run(check)
    if checks.pictures:
        checks.run(checks.pictures_of_the_page)
    checks.run(checks.a_refused_command_says_why)
    checks.run(checks.a_recording_with_a_hostile_mark)
    if checks.run(checks.stop_scan_stops_the_clouds):
        checks.run(checks.the_cloud_turns_by_keys_and_mouse)
        checks.run(checks.the_histogram_shows_the_whole_turn_on_demand)
        checks.run(checks.start_scan_brings_them_again)
    checks.no_errors(refused_command)
    if checks.monitor_pid:
        checks.run(checks.it_gets_live_again_after_the_monitor_was_killed)
        checks.no_errors(lost_connection)


def main():
    parser = argparse.ArgumentParser(description="Drives the monitor's page in a headless Chromium, and checks it.")
    parser.add_argument("url", help="of the monitor, such as http://127.0.0.1:8780")
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for pictures of the page")
    parser.add_argument("--recordings", type=pathlib.Path, help="folder that the instance records to, to look for files")
    parser.add_argument("--chromium", default="chromium", help="the program")
    parser.add_argument("--restart-pid", type=int, help="process of the monitor, to be killed; its port must be fixed")
    arguments = parser.parse_args()
    # So that what is begun is ended.
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
