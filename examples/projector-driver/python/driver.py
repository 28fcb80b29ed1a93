#!/usr/bin/env python3
"""Announces phase-shifted fringes to Fringeflow, like the driver of a projector.

    pip install iceoryx2==0.10.0
    python driver.py demo --steps 4 --period-px 16 --rate-hz 30

It follows the channel `control/state` and shows patterns while the instance should scan. --start, --record FILE and
--mark TEXT send these requests at the start, --stop at the end. docs/projector-driver.md is the contract. A real driver
would show pattern `step` in `Driver.announce`.
"""

import argparse
import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import iceoryx2 as iox2

# --- Messages: the structs of include/fringeflow.h. -------------------------------------------------------------------


class PatternEvent(ctypes.Structure):
    """One pattern. Times are nanoseconds of CLOCK_MONOTONIC."""

    _fields_ = [
        ("session", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("exposure_start_ns", ctypes.c_uint64),
        ("duration_ns", ctypes.c_uint64),
        ("period_px", ctypes.c_double),
        ("step", ctypes.c_uint32),
        ("steps", ctypes.c_uint32),
        ("kind", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "fringeflow.PatternEvent.1"


class Text(ctypes.Structure):
    """A short UTF-8 text, padded with zeros."""

    _fields_ = [("bytes", ctypes.c_char * 256)]


class ScanState(ctypes.Structure):
    """The state that the instance should have."""

    _fields_ = [
        ("revision", ctypes.c_uint64),
        ("scanning", ctypes.c_uint32),
        ("recording", ctypes.c_uint32),
        ("recordings", ctypes.c_uint64),
        ("marks", ctypes.c_uint64),
        ("recording_file", Text),
        ("mark", Text),
    ]

    @staticmethod
    def type_name() -> str:
        return "fringeflow.ScanState.1"


class ControlRequest(ctypes.Structure):
    """A request to the instance."""

    _fields_ = [("command", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("text", Text)]

    @staticmethod
    def type_name() -> str:
        return "fringeflow.ControlRequest.1"


class ControlResponse(ctypes.Structure):
    """The answer to a request."""

    _fields_ = [("refused", ctypes.c_uint32), ("reserved", ctypes.c_uint32), ("state", ScanState), ("text", Text)]

    @staticmethod
    def type_name() -> str:
        return "fringeflow.ControlResponse.1"


PATTERN_FRINGES = 1
COMMAND_START, COMMAND_STOP, COMMAND_RECORD_START, COMMAND_MARK = 1, 2, 3, 5


# --- Channels. --------------------------------------------------------------------------------------------------------


class Instance:
    """A running instance. Opens its channels with its own iceoryx2 configuration."""

    def __init__(self, config_file: Path):
        config = iox2.config.from_file(iox2.FilePath.new(str(config_file)))
        # This program handles signals itself.
        builder = iox2.NodeBuilder.new().config(config).name(iox2.NodeName.new("projector-driver"))
        builder = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self.node = builder.create(iox2.ServiceType.Ipc)

    def _service(self, name: str):
        return self.node.service_builder(iox2.ServiceName.new(name))

    def publisher(self, name: str, message: type):
        """Returns a publisher of a channel, and the notifier that wakes its readers."""
        # The instance created the channel and set its limits. `open` accepts them.
        publisher = self._service(name).publish_subscribe(message).open().publisher_builder().create()
        return publisher, self._service(name).event().open_or_create().notifier_builder().create()

    def subscriber(self, name: str, message: type):
        """Returns a subscriber of a channel."""
        return self._service(name).publish_subscribe(message).open().subscriber_builder().create()

    def request(self, command: int, text: str = "", timeout_s: float = 5.0) -> ControlResponse:
        """Sends a request to `control` and returns the answer. Exits if it is refused or not answered in time."""
        service = self._service("control").request_response(ControlRequest, ControlResponse).open()
        client = service.client_builder().create()
        pending = client.send_copy(ControlRequest(command=command, text=Text(text.encode())))
        self._service("control").event().open_or_create().notifier_builder().create().notify()
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            answer = pending.receive()
            if answer is not None:
                response = ControlResponse.from_buffer_copy(answer.payload().contents)
                if response.refused:
                    sys.exit(f"refused: {response.text.bytes.decode(errors='replace')}")
                return response
            time.sleep(0.002)
        sys.exit("control did not answer; is the instance running?")


# --- The driver. ------------------------------------------------------------------------------------------------------


class Driver:
    """Repeats N patterns, and announces each when its exposure starts."""

    def __init__(self, instance: Instance, steps: int, period_px: float, rate_hz: float):
        self.events, self.wake = instance.publisher("projector/pattern", PatternEvent)
        self.states = instance.subscriber("control/state", ScanState)
        self.steps, self.period_px, self.rate_hz = steps, period_px, rate_hz
        self.session = time.monotonic_ns()  # new after a restart of the driver
        self.sequence = 0  # continues when the scan stops and starts again
        self.scanning = False

    def follow_state(self) -> None:
        """Receives the newest state. A new subscriber receives the last one."""
        while (sample := self.states.receive()) is not None:
            self.scanning = sample.payload().contents.scanning != 0

    def run(self, stop, patterns: int | None) -> None:
        """Announces patterns until `stop` returns true, or until `patterns` were announced."""
        start_ns, shown = 0, 0
        while not stop() and self.sequence != patterns:
            self.follow_state()
            if not self.scanning:
                start_ns = 0
                time.sleep(0.02)
                continue
            if start_ns == 0:
                start_ns, shown = time.monotonic_ns(), 0
            # Computed from the start of the scan, so the schedule does not drift.
            exposure_start_ns = start_ns + round(shown * 1e9 / self.rate_hz)
            time.sleep(max(0.0, (exposure_start_ns - time.monotonic_ns()) / 1e9))
            self.announce(exposure_start_ns)
            shown += 1

    def announce(self, exposure_start_ns: int) -> None:
        """Announces the pattern. A real driver would show pattern `step` here."""
        event = PatternEvent(
            session=self.session,
            sequence=self.sequence,
            exposure_start_ns=exposure_start_ns,
            duration_ns=int(1e9 / self.rate_hz),
            period_px=self.period_px,
            step=self.sequence % self.steps,
            steps=self.steps,
            kind=PATTERN_FRINGES,
        )
        self.events.send_copy(event)
        self.wake.notify()
        self.sequence += 1


def runtime_dir() -> Path:
    """Returns the runtime folder of instances, by the same rule as Fringeflow."""
    if folder := os.environ.get("FRINGEFLOW_RUNTIME_DIR"):
        return Path(folder)
    if folder := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(folder) / "fringeflow"
    return Path(f"/tmp/fringeflow-{os.geteuid()}")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Announces phase-shifted fringes to Fringeflow.")
    parser.add_argument("name", nargs="?", default="fringeflow", metavar="NAME", help="name of the instance")
    parser.add_argument("--config-file", type=Path, help="its iceoryx2 configuration, if not in the default folder")
    parser.add_argument("--steps", type=int, default=4, help="patterns per cycle")
    parser.add_argument("--period-px", type=float, default=16.0, help="fringe period, projector pixels")
    parser.add_argument("--rate-hz", type=float, default=30.0, help="patterns per second")
    parser.add_argument("--patterns", type=int, help="end after this number of patterns")
    parser.add_argument("--start", action="store_true", help="request the start of the scan")
    parser.add_argument("--record", metavar="FILE", help="request a recording; an empty FILE means a default name")
    parser.add_argument("--mark", metavar="TEXT", help="write a mark into the recording")
    parser.add_argument("--stop", action="store_true", help="request the stop of the scan at the end")
    return parser.parse_args()


def main() -> None:
    args = arguments()
    config_file = args.config_file or runtime_dir() / f"{args.name}.iceoryx2.toml"
    if not config_file.exists():
        sys.exit(f"{config_file} does not exist; start the instance first")
    stop_signals = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop_signals.append(True))
    try:
        instance = Instance(config_file)
        driver = Driver(instance, args.steps, args.period_px, args.rate_hz)
    except iox2.PublishSubscribeOpenError as error:
        sys.exit(f"the channels cannot be opened ({error}); start the instance first")
    if args.record is not None:
        instance.request(COMMAND_RECORD_START, args.record)
    if args.start:
        instance.request(COMMAND_START)
    if args.mark is not None:
        instance.request(COMMAND_MARK, args.mark)
    driver.run(lambda: bool(stop_signals), args.patterns)
    if args.stop:
        instance.request(COMMAND_STOP)
    print(f"{driver.sequence} patterns announced")


if __name__ == "__main__":
    main()
