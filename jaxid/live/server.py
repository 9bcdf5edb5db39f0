"""The web server of a live view: for this machine alone, and in it for this page alone.

It listens on the loopback address. A page of somebody else's in the same browser could still ask it, under a name of its own
that leads here (DNS rebinding) or by a form (cross-site requests); so every request must name this server as its host, and come
from this server's page or from no page at all.
"""

import base64
import hashlib
import json
import re
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import unquote_to_bytes, urlsplit

from ..report.document import package_text
from .board import PARTS, Board
from .folder import ENDINGS, LogFolder, Refused
from .parts import live_page

_FILES = {
    "/page.css": ("report/page.css", "text/css"),
    "/live.css": ("live/live.css", "text/css"),
    "/page.js": ("report/page.js", "text/javascript"),
    "/live.js": ("live/live.js", "text/javascript"),
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a page of the server may do: run its own two scripts, ask this server, and nothing else."""
_SECONDS = 30.0
"""How long a sender may be silent."""
_PULSE = 10.0


class Server(ThreadingHTTPServer):
    """The server of one folder. `port` 0 takes any that is free."""

    daemon_threads = True

    def __init__(self, folder: LogFolder, board: Board, title: str, port: int = 0):
        self.folder, self.board = folder, board
        super().__init__(("127.0.0.1", port), _Handler)
        self.page = live_page(title, str(folder.path), folder.largest, ENDINGS)
        self.hosts = frozenset(f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost"))

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://127.0.0.1:{self.server_port}/"

    def close(self) -> None:
        """Let everybody who waits go, and end."""
        self.board.close()
        self.server_close()

    def handle_error(self, request: object, client_address: object) -> None:
        """A browser that goes away in the middle of an answer is nothing to tell."""


class _Handler(BaseHTTPRequestHandler):
    server: Server  # type: ignore[assignment]
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "jaxid", ""
    timeout = _SECONDS

    def log_message(self, format: str, *args: object) -> None:
        """The terminal is for what people must know."""

    # -- who may ask ---------------------------------------------------------------------------------------------------
    def _check(self) -> None:
        hosts = self.headers.get_all("Host") or []
        if len(hosts) != 1 or hosts[0].lower() not in self.server.hosts:
            raise Refused(403, f"This server answers to {self.server.address} alone.")
        for origin in self.headers.get_all("Origin") or []:
            if origin not in {f"http://{host}" for host in self.server.hosts}:
                raise Refused(403, "Pages of other servers are not answered.")
        if (self.headers.get("Sec-Fetch-Site") or "none") not in ("same-origin", "none"):
            raise Refused(403, "Pages of other servers are not answered.")

    # -- answers -------------------------------------------------------------------------------------------------------
    def _answer(self, status: int, body: str, kind: str = "text/plain", policy: str = _POLICY) -> None:
        data = body.encode()
        self.send_response(status)
        self._headers(kind, policy)
        self.send_header("Content-Length", str(len(data)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(data)

    def _headers(self, kind: str, policy: str) -> None:
        for name, value in (
            ("Content-Type", f"{kind}; charset=utf-8"),
            ("Content-Security-Policy", policy),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)

    def _refuse(self, refused: Refused) -> None:
        self.close_connection = True  # what else the sender has to say is not read
        self._answer(refused.status, str(refused))

    def do_GET(self) -> None:
        try:
            self._check()
            self._get(urlsplit(self.path).path)
        except Refused as refused:
            self._refuse(refused)

    def _get(self, path: str) -> None:
        board, (kind, _, name) = self.server.board, path.lstrip("/").partition("/")
        if path == "/":
            self._answer(200, self.server.page, "text/html")
        elif path in _FILES:
            file, content = _FILES[path]
            self._answer(200, package_text(file), content)
        elif path == "/events":
            self._events()
        elif kind == "part" and name in PARTS:
            self._answer(200, board.html(name), "text/html")
        elif kind == "report" and name in PARTS and board.report(name):
            page = board.report(name)
            self._answer(200, page, "text/html", _POLICY.replace("script-src 'self'", f"script-src {_hash(page)}"))
        else:
            raise Refused(404, "There is nothing here.")

    def _events(self) -> None:
        """What there is to see, whenever it changes, as server-sent events."""
        self.close_connection = True
        self.send_response(200)
        self._headers("text/event-stream", _POLICY)
        self.send_header("Connection", "close")
        self.end_headers()
        version, board = -1, self.server.board
        while not board.closed:
            seen = board.seen(version, _PULSE)
            version = version if seen is None else seen["version"]
            text = ": still here\n\n" if seen is None else f"data: {json.dumps(seen)}\n\n"
            self.wfile.write(text.encode())
            self.wfile.flush()

    def do_POST(self) -> None:
        try:
            self._check()
            # No form and no simple request of another page can bring this header.
            if self.headers.get("X-Jaxid") != "1":
                raise Refused(403, "Logs are taken from the page alone; copy this one into the folder.")
            name = self.server.folder.store(_log_in(self.path), self.rfile, self._length())
            self._answer(201, name)
        except Refused as refused:
            self._refuse(refused)
        except TimeoutError:
            self._refuse(Refused(408, f"Nothing came for {_SECONDS:g} s; send the log again."))

    def _length(self) -> int:
        given = self.headers.get_all("Content-Length") or []
        if len(given) != 1 or not re.fullmatch(r"[0-9]{1,15}", given[0]) or "Transfer-Encoding" in self.headers:
            raise Refused(411, "The length of the log is missing; send it with its Content-Length.")
        return int(given[0])


def _log_in(path: str) -> str:
    """The name in /logs/NAME. Raises `Refused` for any other address."""
    before, _, quoted = path.partition("/logs/")
    if before or not quoted or not path.startswith("/logs/"):
        raise Refused(404, "There is nothing here.")
    try:
        return unquote_to_bytes(quoted).decode("utf-8")
    except UnicodeDecodeError:
        raise Refused(400, "The log's name is no UTF-8; give it another.") from None


def _hash(page: str) -> str:
    """The one script that a report holds, as a policy names it."""
    script = re.search(r"<script>(.*?)</script>", page, re.S)
    digest = hashlib.sha256((script[1] if script else "").encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
