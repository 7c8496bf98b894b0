"""A headless Chromium, driven through its debugging protocol with what the tests have anyway."""

import asyncio
import base64
import json
import re
import shutil
import subprocess
import time

from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import websocket_connect

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


class Browser:
    """One page. All waiting has a limit, after which it fails."""

    def __init__(self, profile, width=1280, height=1600):
        options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--no-first-run"]
        size = f"--window-size={width},{height}"
        command = [CHROMIUM, *options, size, f"--user-data-dir={profile}", "about:blank"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        self.loop, self.number = asyncio.new_event_loop(), 0
        for line in self.process.stderr:
            if found := re.search(r"ws://([\d.:]+)/", line):
                self.host = found[1]
                break
        self.socket = self.loop.run_until_complete(self._connect())

    async def _connect(self):
        pages = json.loads((await AsyncHTTPClient().fetch(f"http://{self.host}/json")).body)
        address = next(page["webSocketDebuggerUrl"] for page in pages if page["type"] == "page")
        return await websocket_connect(address, max_message_size=2**26)

    def call(self, method, **params):
        self.number += 1
        return self.loop.run_until_complete(asyncio.wait_for(self._call(self.number, method, params), 60))

    async def _call(self, number, method, params):
        await self.socket.write_message(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            said = json.loads(await self.socket.read_message())
            if said.get("id") == number:
                return said["result"]

    def run(self, script):
        """The value of a JavaScript expression."""
        done = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in done, done
        return done["result"].get("value")

    def wait(self, script, limit=90):
        """Waits until a JavaScript expression is true, and returns it."""
        end = time.monotonic() + limit
        while not (value := self.run(script)):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.1)
        return value

    def resize(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def picture(self, path):
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def close(self):
        self.socket.close()
        self.loop.close()
        self.process.kill()
        self.process.wait()
        self.process.stderr.close()
