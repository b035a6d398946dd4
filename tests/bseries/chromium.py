"""Chromium without a window, driven by its own protocol over two pipes: no package but the browser is needed."""

from __future__ import annotations

import base64
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Any

ARGUMENTS = ("--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--no-first-run", "--hide-scrollbars")
PIPES = 'exec "$0" "$@" 3<&{} 4>&{}'
"""The browser reads commands at 3 and writes answers to 4."""
KEYS = {
    "Tab": (9, ""), "Enter": (13, "\r"), "Space": (32, " "), "PageUp": (33, ""), "PageDown": (34, ""), "End": (35, ""),
    "ArrowLeft": (37, ""), "ArrowRight": (39, ""),
}  # fmt: skip
"""The number of a key, and the text that it writes."""


class Browser:
    """A browser, from its start until `close`."""

    def __init__(self, program: str, folder: Path):
        (theirs, commands), (answers, out) = os.pipe(), os.pipe()
        arguments = [program, *ARGUMENTS, f"--user-data-dir={folder}", "about:blank"]
        self._process = subprocess.Popen(
            ["bash", "-c", PIPES.format(theirs, out), *arguments], pass_fds=(theirs, out), stderr=subprocess.DEVNULL
        )
        os.close(theirs)
        os.close(out)
        self._commands, self._answers, self._rest, self._count = commands, answers, b"", 0
        self._results: dict[int, Any] = {}
        self._pages: dict[str, Page] = {}

    def new_page(self, width: int = 1280, height: int = 900) -> Page:
        """An empty page."""
        target = self.ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        session = self.ask("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        page = self._pages[session] = Page(self, session, target)
        for name in ("Page", "Runtime", "Network", "Log"):
            page.ask(f"{name}.enable")
        page.resize(width, height)
        return page

    def ask(self, method: str, arguments: dict[str, Any] | None = None, session: str = "", seconds: float = 120) -> Any:
        """The result of a command."""
        self._count = number = self._count + 1
        message = {"id": number, "method": method, "params": arguments or {}}
        text = json.dumps(message | ({"sessionId": session} if session else {})).encode() + b"\0"
        while text:
            text = text[os.write(self._commands, text) :]
        end = time.monotonic() + seconds
        while number not in self._results:
            self.listen(end - time.monotonic())
        answer = self._results.pop(number)
        assert "error" not in answer, (method, answer["error"])
        return answer["result"]

    def listen(self, seconds: float) -> None:
        """Read what the browser says next."""
        assert select.select([self._answers], [], [], max(seconds, 0))[0], "the browser gave no answer"
        piece = os.read(self._answers, 2**20)
        assert piece, "the browser has ended"
        *messages, self._rest = (self._rest + piece).split(b"\0")
        for message in map(json.loads, messages):
            if "id" in message:
                self._results[message["id"]] = message
            elif message.get("sessionId") in self._pages:
                self._pages[message["sessionId"]].hear(message["method"], message["params"])

    def close(self) -> None:
        """End the browser."""
        self.ask("Browser.close")
        self._process.wait(30)
        os.close(self._commands)
        os.close(self._answers)


class Page:
    """A page, with the errors that it wrote and the addresses that it asked for."""

    def __init__(self, browser: Browser, session: str, target: str):
        self._browser, self._session, self._target = browser, session, target
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.frames: list[tuple[float, int]] = []  # time and size of each message of a web socket that came in

    def ask(self, method: str, **arguments: Any) -> Any:
        """The result of a command for the page."""
        return self._browser.ask(method, arguments, self._session)

    def hear(self, method: str, said: dict[str, Any]) -> None:
        """Keep what a test may ask for."""
        if method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(" ".join(str(part.get("value", part.get("description"))) for part in said["args"]))
        elif method == "Runtime.exceptionThrown":
            self.errors.append(str(said["exceptionDetails"]))
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(said["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Network.webSocketFrameReceived":
            self.frames.append((said["timestamp"], len(said["response"]["payloadData"])))

    def evaluate(self, code: str) -> Any:
        """The value of an expression in the page, or what its promise gives."""
        found = self.ask("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True, userGesture=True)
        assert "exceptionDetails" not in found, (code, found["exceptionDetails"])
        return found["result"].get("value")

    def wait_for(self, code: str, seconds: float = 60) -> None:
        """Wait until an expression is true; while another page loads it is not."""
        end = time.monotonic() + seconds
        while not self.evaluate(f"!!({code})"):
            assert time.monotonic() < end, code
            time.sleep(0.02)

    def goto(self, address: str) -> None:
        """Load a page; it may have more to do afterwards."""
        self.ask("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete' && location.href !== 'about:blank'")

    def resize(self, width: int, height: int) -> None:
        """Give the page another size."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.ask("Emulation.setDeviceMetricsOverride", **size)

    def press(self, key: str) -> None:
        """Press a key where the focus is."""
        code, text = KEYS[key]
        pressed = {"key": " " if key == "Space" else key, "code": key, "windowsVirtualKeyCode": code}
        self.ask("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **pressed)
        self.ask("Input.dispatchKeyEvent", type="keyUp", **pressed)

    def click(self, element: str) -> None:
        """Click at the middle of the first element of a CSS selector."""
        code = f"(e => (e.scrollIntoView(), e.getBoundingClientRect().toJSON()))(document.querySelector({element!r}))"
        box = self.evaluate(code)
        place = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        for kind in ("mousePressed", "mouseReleased"):
            self.ask("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)

    def fill(self, element: str, text: str) -> None:
        """Write into the first element of a CSS selector."""
        said = "e.dispatchEvent(new Event('input', {bubbles: true}))"
        self.evaluate(f"(e => {{ e.value = {json.dumps(text)}; {said} }})(document.querySelector({element!r}))")

    def screenshot(self, path: Path | str) -> None:
        """Write a picture of the whole page."""
        picture = self.ask("Page.captureScreenshot", captureBeyondViewport=True)
        Path(path).write_bytes(base64.b64decode(picture["data"]))

    def close(self) -> None:
        """Close the page."""
        self._browser.ask("Target.closeTarget", {"targetId": self._target})
