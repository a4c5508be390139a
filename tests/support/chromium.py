"""Drives a headless Chromium over its debugging pipe, with Python's own library only.

    with Chromium() as browser:
        browser.size(1280, 800)
        browser.open("/some/page.html")
        assert browser.value("1 + 1") == 2
        assert not browser.complaints

A pipe instead of a port: nothing listens anywhere, and a browser whose test died ends by itself.
"""
import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

PROGRAMS = ["chromium", "chromium-headless-shell", "google-chrome"]
ANSWER_S = 120.0  # [s] a browser that says nothing for so long is broken


def program():
    """The path of an installed browser, or None."""
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


class Chromium:
    """One browser with one page. complaints: console errors, exceptions, and loads that failed."""

    def __init__(self):
        self.complaints, self.requests = [], []
        self.number, self.rest, self.events = 0, b"", []
        self.profile = tempfile.TemporaryDirectory(prefix="verge-chromium-")
        command_read, self.writer = os.pipe()
        self.reader, answer_write = os.pipe()
        # The browser reads descriptor 3 and writes 4; a shell puts ours there.
        script = f'exec 3<&{command_read} 4>&{answer_write}; exec "$@"'
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe",
                   "--hide-scrollbars", "--disable-dev-shm-usage", "--no-first-run",
                   "--disable-background-networking", f"--user-data-dir={self.profile.name}"]
        self.process = subprocess.Popen(
            ["bash", "-c", script, "chromium", program(), *options, "about:blank"],
            pass_fds=(command_read, answer_write), stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": self.profile.name})
        os.close(command_read)
        os.close(answer_write)
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target,
                                 flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.session = None
            self.call("Browser.close")
            self.process.wait(timeout=20)
        except (OSError, RuntimeError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        os.close(self.reader)
        os.close(self.writer)
        self.profile.cleanup()

    def call(self, method, **parameters):
        """One command and its answer; what the browser reports meanwhile is kept."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        text = json.dumps(message).encode() + b"\0"
        while text:
            text = text[os.write(self.writer, text):]
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.note(answer)

    def receive(self):
        while b"\0" not in self.rest:
            if not select.select([self.reader], [], [], ANSWER_S)[0]:
                raise RuntimeError(f"the browser says nothing for {ANSWER_S:g} s")
            more = os.read(self.reader, 1 << 20)
            if not more:
                raise RuntimeError("the browser ended")
            self.rest += more
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def note(self, event):
        method, what = event.get("method"), event.get("params", {})
        self.events.append(method)
        if method == "Runtime.exceptionThrown":
            thrown = what["exceptionDetails"]
            self.complaints.append(thrown.get("exception", {}).get("description", thrown["text"]))
        elif method == "Runtime.consoleAPICalled" and what["type"] in ("error", "assert"):
            self.complaints.append(str([a.get("value") for a in what["args"]]))
        elif method == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning"):
            self.complaints.append(what["entry"]["text"])
        elif method == "Network.requestWillBeSent":
            self.requests.append(what["request"]["url"])

    def size(self, width, height, ratio=1, touch=False):
        """The window [CSS px], and whether it is a phone's."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height,
                  deviceScaleFactor=ratio, mobile=touch)
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)

    def dark(self, on):
        self.call("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if on else "light"}])

    def open(self, path):
        """Opens a file and waits until it is loaded."""
        self.events = []
        self.call("Page.navigate", url="about:blank")
        address, _, fragment = path.partition("#")
        self.events = []
        self.call("Page.navigate", url=f"file://{os.path.abspath(address)}"
                  + (f"#{fragment}" if fragment else ""))
        while "Page.loadEventFired" not in self.events:
            self.note(self.receive())
        self.settle()

    def value(self, expression):
        """What an expression of JavaScript gives; a promise is waited for."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True,
                           awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def settle(self):
        """Until what was changed has been drawn: two frames."""
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, expression, seconds=60.0):
        """Waits until an expression is true; the time only bounds a failure."""
        end = time.monotonic() + seconds
        while not self.value(expression):
            if time.monotonic() > end:
                raise AssertionError(f"never became true: {expression}")
            time.sleep(0.02)

    def key(self, key, code=None, shift=False):
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key,
                      modifiers=8 if shift else 0, **(text if kind == "keyDown" else {}))
        self.settle()

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, button="left", buttons=int(kind == "mousePressed"), clickCount=1)
        self.settle()

    def picture(self, path, whole_page=False):
        data = self.call("Page.captureScreenshot", format="png",
                         captureBeyondViewport=whole_page)["data"]
        with open(path, "wb") as out:
            out.write(base64.b64decode(data))
