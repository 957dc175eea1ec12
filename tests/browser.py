"""A real browser, asked over its debugging pipe what a page does: requests, errors, pictures."""

import base64
import fcntl
import json
import os
import shutil
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium")

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost",
    "--remote-debugging-pipe",
)


@dataclass
class Visit:
    """What happened on a page: addresses requested, complaints of the browser, the size of each picture."""

    requests: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    pictures: list[list[int]] = field(default_factory=list)
    width: list[int] = field(default_factory=list)
    title: str = ""


class Browser:
    """Headless Chromium with a profile of its own."""

    def __init__(self, profile: Path) -> None:
        read_end, self._to = os.pipe()
        self._from, write_end = os.pipe()
        # the browser reads from descriptor 3 and writes to 4
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in (read_end, write_end)]
        command = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{ends[0]} 4>&{ends[1]}', "browser", *command],
            pass_fds=ends,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in (*ends, read_end, write_end):
            os.close(end)
        self._rest, self._number, self._session = b"", 0, ""
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> "Browser":
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Network", "Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        return self

    def __exit__(self, *error: object) -> None:
        self._process.terminate()
        self._process.wait(20)
        os.close(self._to)
        os.close(self._from)

    def visit(self, address: str, screenshot: Path | None = None, width: int = 1200) -> Visit:
        """Open a page and wait until it has loaded."""
        self.events.clear()
        self.resize(width)
        self._call("Page.navigate", url=address)
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self._message())
        seen = self.seen()
        if screenshot is not None:
            self.picture(screenshot)
        return seen

    def resize(self, width: int) -> None:
        """Make the window as wide as that."""
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)

    def media(self, kind: str) -> None:
        """Show pages as on paper ("print") or as usual ("")."""
        self._call("Emulation.setEmulatedMedia", media=kind)

    def motion(self, wanted: str) -> None:
        """Say how much motion the user wants: "reduce", or "no-preference"."""
        self._call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": wanted}])

    def seen(self) -> Visit:
        """What has happened on the page until now."""
        seen = Visit()
        for event in self.events:
            given = event.get("params", {})
            if event["method"] == "Network.requestWillBeSent":
                seen.requests.append(given["request"]["url"])
            elif event["method"] == "Runtime.exceptionThrown":
                seen.complaints.append(str(given["exceptionDetails"]))
            elif event["method"] == "Log.entryAdded":
                seen.complaints.append(str(given["entry"]))
        seen.pictures = self.value("Array.from(document.images, i => [i.naturalWidth, i.naturalHeight])")
        seen.width = self.value("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        seen.title = self.value("document.title")
        return seen

    def picture(self, path: Path) -> None:
        """Save the whole page as PNG."""
        taken = self._call("Page.captureScreenshot", captureBeyondViewport=True, clip=self._whole_page())
        path.write_bytes(base64.b64decode(taken["data"]))

    def wait(self, expression: str, seconds: float = 180.0) -> Any:
        """Value of a JavaScript expression as soon as it is true."""
        end = time.monotonic() + seconds
        while not (value := self.value(expression)):
            assert time.monotonic() < end, f"waited {seconds:g} s for {expression}"
            time.sleep(0.05)
        return value

    def drag(self, place: tuple[float, float], across: float, steps: int = 8) -> None:
        """Press the mouse at a place of the window, move it across, and release it."""
        x, y = place
        self._mouse("mousePressed", x, y)
        for step in range(1, steps + 1):
            self._mouse("mouseMoved", x + across * step / steps, y)
        self._mouse("mouseReleased", x + across, y)

    def click(self, place: tuple[float, float]) -> None:
        """Click at a place of the window."""
        self.drag(place, 0.0, 0)

    def _mouse(self, kind: str, x: float, y: float) -> None:
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def _whole_page(self) -> dict[str, float]:
        size = self._call("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def value(self, expression: str) -> Any:
        """Value of a JavaScript expression; None if it has none."""
        return self._call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            more = os.read(self._from, 1 << 20)
            assert more, "the browser has gone"
            self._rest += more
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)
