"""Serves the explorer to this machine: `python -m explorer`."""

from __future__ import annotations

import argparse
import json
import sys
import webbrowser
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from explorer import answers
from explorer.training import Training

_PAGE = Path(__file__).with_name("page.html")
_MOST_BYTES = 1_000_000


class Server(ThreadingHTTPServer):
    """Answers the page; bound to this machine."""

    daemon_threads = False  # an answer in the making ends before the process does

    def __init__(self, port: int) -> None:
        self.training = Training()
        super().__init__(("127.0.0.1", port), Handler)

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self.server_port}/"

    def server_close(self) -> None:
        """Ends training, then waits for answers in the making."""
        self.training.stop()
        super().server_close()

    def reply(self, path: str, asked: dict[str, Any]) -> Any:
        """The answer to one question of the page.

        Raises:
          ValueError: naming the field, the value and what is allowed.
        """
        if path == "/start":
            return answers.start(asked["environment"])
        if path == "/toml":
            return answers.of_toml(asked["text"])
        if path == "/solve":
            return answers.answer(asked["description"])
        if path == "/picture":
            return {"png": answers.picture(asked["description"], asked["state"], asked["action"], asked["seed"])}
        if path == "/train":
            params = answers.environment(asked["description"])
            self.training.start(params, asked["learners"], asked["seeds"], asked["episodes"])
            return {}
        if path == "/progress":
            return self.training.progress()
        raise ValueError(f"path: {path!r} is unknown")


class Handler(BaseHTTPRequestHandler):
    """One request. Only the page itself asks: other sites' pages have another host or origin."""

    server: Server

    def do_GET(self) -> None:
        """The page."""
        if self._is_ours() and self.path == "/":
            self._send(200, _PAGE.read_bytes(), "text/html; charset=utf-8")
        else:
            self._send(404, b"", "text/plain")

    def do_POST(self) -> None:
        """A question as JSON, answered as JSON; what is refused is status 400 with the reason."""
        length = int(self.headers.get("Content-Length") or 0)
        if not self._is_ours() or length > _MOST_BYTES:
            self._send(403, b"{}", "application/json")
            return
        try:
            status, answer = 200, self.server.reply(self.path, json.loads(self.rfile.read(length) or b"{}"))
        except (ValueError, KeyError, TypeError) as error:
            status, answer = 400, {"error": str(error)}
        self._send(status, json.dumps(answer, allow_nan=False).encode(), "application/json")

    def _is_ours(self) -> bool:
        hosts = {f"127.0.0.1:{self.server.server_port}", f"localhost:{self.server.server_port}"}
        origin = self.headers.get("Origin")
        return self.headers.get("Host") in hosts and (origin is None or origin.removeprefix("http://") in hosts)

    def _send(self, status: int, content: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Says nothing of each request."""


def main(args: list[str] | None = None) -> int:
    """Entry point; serves until it is interrupted."""
    parser = argparse.ArgumentParser(prog="python -m explorer", description=__doc__)
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1; any free one by default")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    options = parser.parse_args(args)
    try:
        server = Server(options.port)
    except (OSError, OverflowError) as error:
        print(f"error: port {options.port}: {error}", file=sys.stderr)
        return 2
    print(f"the explorer is at {server.address} (Ctrl-C ends it)", flush=True)
    if not options.no_browser:
        webbrowser.open(server.address)
    try:
        server.serve_forever()
    except KeyboardInterrupt:
        server.server_close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
