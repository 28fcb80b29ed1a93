"""Drives one page in a headless Chromium through the DevTools protocol.

The protocol uses a pipe that Chromium inherits (--remote-debugging-pipe): no port is opened, no driver program or
package is needed, and the browser ends with this process.
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

# Longest wait, seconds; the machine may be very slow.
TIMEOUT_S = 60
# Interval between checks while waiting, seconds.
POLL_S = 0.1

PROBE = (pathlib.Path(__file__).parent / "probe.js").read_text(encoding="utf-8")
WORLD = "probe"

SWITCHES = [
    "--headless",
    "--remote-debugging-pipe",
    # Only the page under test is loaded, and in containers Chromium cannot create its sandbox.
    "--no-sandbox",
    "--disable-dev-shm-usage",
    # WebGL in software, for machines without a graphics card. Compositing does not use it: that is ten times as fast.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    # Disable everything except the page.
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

# Keys that need more than their character: code, virtual key code, text.
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
    """A check that failed, with its reason."""


def wait_for(what, condition):
    """Waits until the condition is true, and returns its value. On a timeout, reports its last `Failure`."""
    end = time.monotonic() + TIMEOUT_S
    while True:
        reason = ""
        try:
            if value := condition():
                return value
        except Failure as failure:
            reason = f": {failure}"
        if time.monotonic() > end:
            raise Failure(f"{what}: not within {TIMEOUT_S} s{reason}")
        time.sleep(POLL_S)


def in_child(commands, answers):
    """Returns a function that prepares the child process.

    Its pipe gets the expected file descriptors 3 and 4, and the child ends with this process.
    """

    def prepare():
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
        # Duplicate to higher numbers first: one end may have the number of the other. On exec, only 3 and 4 stay open.
        reads, writes = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in (commands, answers))
        os.dup2(reads, 3)
        os.dup2(writes, 4)

    return prepare


@contextlib.contextmanager
def chromium(program):
    """Runs Chromium with one empty page, and yields a `Page`. Always ends Chromium."""
    if shutil.which(program) is None:
        raise Failure(f"{program} is missing: install the Debian package chromium, or use --chromium PATH")
    with tempfile.TemporaryDirectory(prefix="fringeflow-chromium-", ignore_cleanup_errors=True) as name:
        folder = pathlib.Path(name)
        log = folder / "log.txt"
        commands, command_end = os.pipe()
        answer_end, answers = os.pipe()
        with open(log, "wb") as output:
            process = subprocess.Popen(
                [program, *SWITCHES, f"--user-data-dir={folder / 'profile'}", "about:blank"],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                # Keep caches and settings out of the user's home.
                env={**os.environ, "HOME": name, "XDG_CONFIG_HOME": name, "XDG_CACHE_HOME": name},
                close_fds=False,
                start_new_session=True,
                preexec_fn=in_child(commands, answers),
            )
        os.close(commands)
        os.close(answers)
        try:
            yield Page(Pipe(command_end, answer_end))
        except Gone as gone:
            last = "\n".join(log.read_text(errors="replace").splitlines()[-5:])
            raise Failure(f"{gone}\nLast messages of Chromium:\n{last}") from gone
        finally:
            # All processes of Chromium are in one group.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            os.close(command_end)
            os.close(answer_end)


class Gone(Failure):
    """Chromium ended or does not answer."""


class Pipe:
    """Sends commands and receives messages, each terminated by a zero byte."""

    def __init__(self, command_end, answer_end):
        self.command_end = command_end
        self.answer_end = answer_end
        self.rest = b""
        self.messages = collections.deque()

    def send(self, message):
        data = json.dumps(message).encode() + b"\0"
        try:
            while data:
                data = data[os.write(self.command_end, data) :]
        except BrokenPipeError as error:
            raise Gone("Chromium has ended") from error

    def receive(self, within_s):
        """Returns the next message, or None on a timeout."""
        end = time.monotonic() + within_s
        while not self.messages:
            if not select.select([self.answer_end], [], [], max(0, end - time.monotonic()))[0]:
                return None
            data = os.read(self.answer_end, 1 << 20)
            if not data:
                raise Gone("Chromium has ended")
            *whole, self.rest = (self.rest + data).split(b"\0")
            self.messages.extend(map(json.loads, whole))
        return self.messages.popleft()


class Page:
    """The page in Chromium. Test scripts run in an isolated world with the functions of probe.js."""

    def __init__(self, pipe):
        self.pipe = pipe
        self.last_id = 0
        self.session = None
        # Execution context of probe.js.
        self.context = None
        # Errors of the console, the network and exceptions: `(text, url)`.
        self.errors = []
        # Texts of dialogs that the page opened.
        self.dialogs = []
        (target,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Inspector"):
            self.call(f"{domain}.enable")
        self.call("Page.addScriptToEvaluateOnNewDocument", source=PROBE, worldName=WORLD, runImmediately=True)

    def call(self, method, **parameters):
        """Sends a command and returns its answer. Handles events that arrive before it."""
        self.last_id += 1
        message = {"id": self.last_id, "method": method, "params": parameters}
        self.pipe.send(message if self.session is None else {**message, "sessionId": self.session})
        end = time.monotonic() + TIMEOUT_S
        while (answer := self.pipe.receive(end - time.monotonic())) is not None:
            if answer.get("id") == self.last_id:
                if "error" in answer:
                    raise Failure(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.handle_event(answer)
        raise Gone(f"{method}: Chromium did not answer within {TIMEOUT_S} s")

    def handle_event(self, event):
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
                # Do not wait for the answer: `call` may already be waiting for another one.
                self.last_id += 1
                answer = {"method": "Page.handleJavaScriptDialog", "params": {"accept": False}}
                self.pipe.send({"id": -self.last_id, "sessionId": self.session, **answer})
            case "Inspector.targetCrashed":
                raise Gone("the page crashed")

    def open(self, url):
        self.context = None
        if error := self.call("Page.navigate", url=url).get("errorText"):
            raise Failure(f"{url}: {error}")
        wait_for(f"{url} is loaded", lambda: self.run("document.readyState") == "complete")

    def run(self, expression):
        """Returns the value of a JavaScript expression. Waits for promises."""
        if self.context is None:
            # Let the event arrive that names the context.
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
            # Leave out the stack trace in probe.js.
            raise Failure((details.get("exception", {}).get("description") or details["text"]).splitlines()[0])
        return answer["result"].get("value")

    def ask(self, function, *arguments):
        """Calls a function of probe.js."""
        return self.run(f"{function}({', '.join(map(json.dumps, arguments))})")

    def text(self, selector):
        return self.ask("textOf", selector)

    # Screenshots.

    def capture(self, selector, inset=0):
        """Scrolls to an element and returns its pixels as `Capture`, without `inset` pixels at each edge."""
        box = self.ask("pageBox", selector, inset)
        shot = self.call("Page.captureScreenshot", format="png", clip={**box, "scale": 1})
        return Capture(self, self.ask("storeCapture", shot["data"]))

    def photograph(self, path, width, height):
        """Writes a screenshot of the page. A height of None captures the whole page."""
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

    # Keyboard and mouse.

    def press(self, key, shift=False):
        code, number, text = KEYS.get(key) or (f"Key{key.upper()}", ord(key.upper()), key)
        both = {"key": key, "code": code, "windowsVirtualKeyCode": number, "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", **both, **({"text": text} if text else {}))
        self.call("Input.dispatchKeyEvent", type="keyUp", **both)
        self.ask("settled")

    def type(self, text):
        self.call("Input.insertText", text=text)

    def click(self, selector):
        x, y = self.ask("clickPoint", selector)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def drag(self, selector, right, down):
        x, y = self.ask("clickPoint", selector)
        self.mouse("mousePressed", x, y)
        for step in (0.25, 0.5, 0.75, 1):
            self.mouse("mouseMoved", x + step * right, y + step * down)
        self.mouse("mouseReleased", x + right, y + down)
        self.ask("settled")

    def mouse(self, kind, x, y):
        held = {"button": "left", "buttons": 1, "clickCount": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)


class Capture:
    """Screenshot of an element. The page stores the pixels; this object holds their statistics.

    width, height: size, pixels
    colours: number of different colours, with 16 steps per channel
    foreground: share of the pixels that have not the most frequent colour
    vivid: number of pixels that are not grey
    hues: how many of 24 hues occur among the vivid pixels
    lightness, scatter: mean and standard deviation of the lightness, 0..255
    """

    def __init__(self, page, statistics):
        self.page = page
        self.number = statistics.pop("number")
        self.__dict__.update(statistics)

    def differs(self, other):
        """Returns the share of the pixels that differ visibly. The page stores only the captures used last."""
        return self.page.ask("difference", self.number, other.number)
