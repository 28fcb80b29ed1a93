"""A headless Chromium and one page in it, driven through the DevTools protocol.

The protocol goes over a pipe that Chromium inherits (--remote-debugging-pipe): no port is opened, no driver program or
package is needed, and the browser ends when this process does.
"""

import base64
import collections
import contextlib
import ctypes
import fcntl
import json
import os
import pathlib
import select
import shutil
import signal
import subprocess
import tempfile
import time

# How long anything may take, seconds; the machine may be very slow.
PATIENCE_S = 60
# Looked at so often while waiting, seconds.
PAUSE_S = 0.1

PROBE = (pathlib.Path(__file__).parent / "probe.js").read_text(encoding="utf-8")
WORLD = "probe"

SWITCHES = [
    "--headless",
    "--remote-debugging-pipe",
    # It loads nothing but the page under test; containers let neither root nor users make its sandbox.
    "--no-sandbox",
    "--disable-dev-shm-usage",
    # WebGL without a graphics card; all else is drawn without it, which is ten times as fast then.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    # Nothing but the page.
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-extensions",
    "--disable-sync",
    "--no-first-run",
    "--no-proxy-server",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
]

# Keys that are not a character: code, virtual key code, text.
KEYS = {
    "Tab": ("Tab", 9, None),
    "Enter": ("Enter", 13, "\r"),
    " ": ("Space", 32, " "),
    "Escape": ("Escape", 27, None),
    "ArrowLeft": ("ArrowLeft", 37, None),
    "ArrowUp": ("ArrowUp", 38, None),
    "ArrowRight": ("ArrowRight", 39, None),
    "ArrowDown": ("ArrowDown", 40, None),
}


class Failure(Exception):
    """What is not as it should be."""


def wait_for(what, condition):
    """The first true value of the condition; it may fail with `Failure`, which then is why the time ran out."""
    end = time.monotonic() + PATIENCE_S
    while True:
        reason = ""
        try:
            if value := condition():
                return value
        except Failure as failure:
            reason = f": {failure}"
        if time.monotonic() > end:
            raise Failure(f"{what}: not within {PATIENCE_S} s{reason}")
        time.sleep(PAUSE_S)


def in_child(commands, answers):
    """Gives Chromium the pipe at the numbers it looks for, and lets it not outlive this process."""

    def prepare():
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
        # Moved away first: one may have the number that the other is to get. All but 3 and 4 are closed when it starts.
        reads, writes = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (commands, answers))
        os.dup2(reads, 3)
        os.dup2(writes, 4)

    return prepare


@contextlib.contextmanager
def chromium(program):
    """A running Chromium with one empty page, as `Page`; gone at the end in every case."""
    if shutil.which(program) is None:
        raise Failure(f"there is no {program}: install Debian's package chromium, or say --chromium PATH")
    with tempfile.TemporaryDirectory(prefix="fringeflow-chromium-", ignore_cleanup_errors=True) as name:
        folder = pathlib.Path(name)
        log = folder / "log.txt"
        commands, to_it = os.pipe()
        from_it, answers = os.pipe()
        with open(log, "wb") as output:
            process = subprocess.Popen(
                [program, *SWITCHES, f"--user-data-dir={folder / 'profile'}", "about:blank"],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # Its caches and settings stay out of the user's home.
                env={**os.environ, "HOME": name, "XDG_CONFIG_HOME": name, "XDG_CACHE_HOME": name},
                close_fds=False,
                start_new_session=True,
                preexec_fn=in_child(commands, answers),
            )
        os.close(commands)
        os.close(answers)
        try:
            yield Page(Pipe(to_it, from_it))
        except Gone as gone:
            last = "\n".join(log.read_text(errors="replace").splitlines()[-5:])
            raise Failure(f"{gone}\nChromium said last:\n{last}") from gone
        finally:
            # All its processes are of one group.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            os.close(to_it)
            os.close(from_it)


class Gone(Failure):
    """Chromium ended or says nothing more."""


class Pipe:
    """Commands and answers, each ended by a zero byte."""

    def __init__(self, to_it, from_it):
        self.to_it = to_it
        self.from_it = from_it
        self.rest = b""
        self.messages = collections.deque()

    def send(self, message):
        data = json.dumps(message).encode() + b"\0"
        try:
            while data:
                data = data[os.write(self.to_it, data) :]
        except BrokenPipeError as error:
            raise Gone("Chromium has ended") from error

    def receive(self, within_s):
        """The next message, or None when none comes in time."""
        end = time.monotonic() + within_s
        while not self.messages:
            if not select.select([self.from_it], [], [], max(0, end - time.monotonic()))[0]:
                return None
            data = os.read(self.from_it, 1 << 20)
            if not data:
                raise Gone("Chromium has ended")
            *whole, self.rest = (self.rest + data).split(b"\0")
            self.messages.extend(map(json.loads, whole))
        return self.messages.popleft()


class Page:
    """The page in Chromium. Scripts run in a world of their own, with the functions of probe.js."""

    def __init__(self, pipe):
        self.pipe = pipe
        self.last_id = 0
        self.session = None
        # The one in which probe.js is.
        self.context = None
        # What the console, the network and exceptions said that is an error: `(text, url)`.
        self.errors = []
        # Texts of the dialogs that were opened.
        self.dialogs = []
        (target,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Inspector"):
            self.call(f"{domain}.enable")
        self.call("Page.addScriptToEvaluateOnNewDocument", source=PROBE, worldName=WORLD, runImmediately=True)

    def call(self, method, **parameters):
        """The answer to a command; events that come before it are taken on the way."""
        self.last_id += 1
        message = {"id": self.last_id, "method": method, "params": parameters}
        self.pipe.send(message if self.session is None else {**message, "sessionId": self.session})
        end = time.monotonic() + PATIENCE_S
        while (answer := self.pipe.receive(end - time.monotonic())) is not None:
            if answer.get("id") == self.last_id:
                if "error" in answer:
                    raise Failure(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.take(answer)
        raise Gone(f"{method}: Chromium did not answer within {PATIENCE_S} s")

    def take(self, event):
        parameters = event.get("params", {})
        match event.get("method"):
            case "Runtime.executionContextCreated" if parameters["context"]["name"] == WORLD:
                self.context = parameters["context"]["id"]
            case "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                text = details.get("exception", {}).get("description") or details["text"]
                self.errors.append((f"uncaught: {text}", details.get("url", "")))
            case "Runtime.consoleAPICalled" if parameters["type"] in ("error", "assert"):
                text = " ".join(str(a.get("value", a.get("description", ""))) for a in parameters["args"])
                self.errors.append((f"console: {text}", ""))
            case "Log.entryAdded" if parameters["entry"]["level"] == "error":
                entry = parameters["entry"]
                self.errors.append((f"{entry['source']}: {entry['text']}", entry.get("url", "")))
            case "Page.javascriptDialogOpening":
                self.dialogs.append(parameters["message"])
                # Its answer is not waited for: this may be on the way to another answer.
                self.last_id += 1
                answer = {"method": "Page.handleJavaScriptDialog", "params": {"accept": False}}
                self.pipe.send({"id": -self.last_id, "sessionId": self.session, **answer})
            case "Inspector.targetCrashed":
                raise Gone("the page crashed")

    def open(self, url):
        self.context = None
        if error := self.call("Page.navigate", url=url).get("errorText"):
            raise Failure(f"{url}: {error}")
        wait_for(f"{url} is there", lambda: self.run("document.readyState") == "complete")

    def run(self, expression):
        """The value of a JavaScript expression; promises are waited for."""
        if self.context is None:
            # Lets the event come that says which one it is.
            self.call("Runtime.evaluate", expression="0")
        if self.context is None:
            raise Failure("the page does not load")
        answer = self.call(
            "Runtime.evaluate",
            expression=expression,
            contextId=self.context,
            returnByValue=True,
            awaitPromise=True,
            userGesture=True,
        )
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            # Without the places in probe.js.
            raise Failure((details.get("exception", {}).get("description") or details["text"]).splitlines()[0])
        return answer["result"].get("value")

    def ask(self, function, *arguments):
        """Calls a function of probe.js."""
        return self.run(f"{function}({', '.join(map(json.dumps, arguments))})")

    def text(self, selector):
        return self.ask("textOf", selector)

    # Looks.

    def look(self, selector, inset=0):
        """What is to be seen at an element, as `Look`, without so many pixels at each edge; it is scrolled to before."""
        place = self.ask("placeOf", selector, inset)
        shot = self.call("Page.captureScreenshot", format="png", clip={**place, "scale": 1})
        return Look(self, self.ask("keepLook", shot["data"]))

    def photograph(self, path, width, height):
        """Writes a picture of the page; a height of None: of all of it."""
        self.resize(width, height or 900)
        if height is None:
            self.resize(width, self.run("Math.ceil(document.documentElement.scrollHeight)"))
        self.ask("unfocus")
        shot = self.call("Page.captureScreenshot", format="png")
        path.write_bytes(base64.b64decode(shot["data"]))

    def resize(self, width, height):
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.ask("settled")

    def theme(self, name):
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])
        self.ask("settled")

    # Hands.

    def press(self, key, shift=False):
        code, number, text = KEYS.get(key) or (f"Key{key.upper()}", ord(key.upper()), key)
        both = {"key": key, "code": code, "windowsVirtualKeyCode": number, "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", **both, **({"text": text} if text else {}))
        self.call("Input.dispatchKeyEvent", type="keyUp", **both)
        self.ask("settled")

    def type(self, text):
        self.call("Input.insertText", text=text)

    def click(self, selector):
        x, y = self.ask("middleOf", selector)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def drag(self, selector, right, down):
        x, y = self.ask("middleOf", selector)
        self.mouse("mousePressed", x, y)
        for step in (0.25, 0.5, 0.75, 1):
            self.mouse("mouseMoved", x + step * right, y + step * down)
        self.mouse("mouseReleased", x + right, y + down)
        self.ask("settled")

    def mouse(self, kind, x, y):
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)


class Look:
    """Pixels of an element, kept in the page and told about in numbers.

    width, height; colours: how many differ, told apart by 16 steps a channel; foreground: share of the pixels that are not
    of the most frequent colour; vivid: number of pixels that are no grey; hues: how many of 24 have some part of the
    vivid ones; lightness, scatter: mean and standard deviation of the lightness, 0..255.
    """

    def __init__(self, page, facts):
        self.page = page
        self.number = facts.pop("number")
        self.__dict__.update(facts)

    def differs(self, other):
        """Share of the pixels that are visibly others. Only the looks last made or compared with keep their pixels."""
        return self.page.ask("difference", self.number, other.number)
