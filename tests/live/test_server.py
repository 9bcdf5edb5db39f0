"""jaxid/live/server.py: it answers this machine alone, and there its own page alone."""

import http.client
import json
import socket
import threading
from contextlib import contextmanager

import pytest

from jaxid.live.board import Board
from jaxid.live.folder import LogFolder
from jaxid.live.server import Server


@contextmanager
def serving(folder, largest=1000, title="jaxid serve: axis"):
    board = Board()
    server = Server(LogFolder(folder, largest), board, title)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        board.close()
        server.shutdown()
        server.server_close()
        thread.join(5)


@pytest.fixture
def server(tmp_path):
    (tmp_path / "logs").mkdir()
    (tmp_path / "outside.csv").write_text("kept")
    with serving(tmp_path / "logs") as own:
        yield own


def ask(server, method="GET", path="/", body=b"", **headers):
    """Status, headers and text of an answer; headers by name, _ for -, None to leave one out."""
    given = {"Host": f"127.0.0.1:{server.server_port}"} | {k.replace("_", "-"): v for k, v in headers.items()}
    if method == "POST":
        given = {"Content-Length": str(len(body)), "X-Jaxid": "1"} | given
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=5)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    for name, value in given.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders(body)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, answer.headers, text


def test_it_listens_on_the_loopback_address_alone(server):
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.server_port}/"


def test_the_page_asks_for_nothing_from_elsewhere_and_runs_nothing_else(server):
    status, headers, page = ask(server)
    assert status == 200 and "jaxid serve: axis" in page
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and "script-src 'self';" in policy and "frame-ancestors 'none'" in policy
    assert headers["X-Content-Type-Options"] == "nosniff" and "Access-Control-Allow-Origin" not in headers
    assert "http://" not in page.replace("http://www.w3.org", "") and "https://" not in page
    for path in ("/page.css", "/page.js", "/live.css", "/live.js", "/part/logs"):
        assert ask(server, path=path)[0] == 200, path
    for path in (
        "/part/other",
        "/report/fit",
        "/logs/",
        "/live.js/",
        "/../pyproject.toml",
        "/page.css%00",
        "/favicon.ico",
    ):
        assert ask(server, path=path)[0] == 404, path


@pytest.mark.parametrize("method", ["GET", "POST"])
@pytest.mark.parametrize(
    "headers",
    [{"Host": "evil.example"}, {"Host": "evil.example:{port}"}, {"Host": "127.0.0.1"}, {"Host": None}, {"Host": ""},
     {"Host": "127.0.0.1:{port}.evil.example"}, {"Host": "localhost:{port}", "Origin": "http://evil.example"},
     {"Origin": "null"}, {"Origin": "https://127.0.0.1:{port}"}, {"Origin": "http://127.0.0.1:1"},
     {"Sec_Fetch_Site": "cross-site"}, {"Sec_Fetch_Site": "same-site"}],
    ids=str,
)  # fmt: skip
def test_other_hosts_and_other_peoples_pages_are_refused(server, method, headers):
    headers = {name: value and value.format(port=server.server_port) for name, value in headers.items()}
    status, _, said = ask(server, method, "/" if method == "GET" else "/logs/a.csv", b"t", **headers)
    assert status == 403 and ("alone" in said or "other servers" in said)
    assert list(server.folder.path.iterdir()) == []


def test_this_pages_requests_are_answered(server):
    own = f"127.0.0.1:{server.server_port}", f"localhost:{server.server_port}"
    for host in own:
        headers = {"Host": host, "Origin": f"http://{host}", "Sec_Fetch_Site": "same-origin"}
        assert ask(server, **headers)[0] == 200
    assert ask(server, "POST", "/logs/a%20log.csv", b"t,u\n", Origin=f"http://{own[0]}")[0] == 201
    assert (server.folder.path / "a log.csv").read_bytes() == b"t,u\n"


def test_a_form_of_another_page_cannot_send_a_log(server):
    status, _, said = ask(server, "POST", "/logs/a.csv", b"t", X_Jaxid=None)
    assert status == 403 and "from the page alone" in said and list(server.folder.path.iterdir()) == []


@pytest.mark.parametrize(
    "path",
    ["/logs/../outside.csv", "/logs/..%2foutside.csv", "/logs/%2e%2e/outside.csv", "/logs/%2e%2e%2foutside.csv",
     "/logs/..%5coutside.csv", "/logs/%2ftmp%2fx.csv", "/logs//tmp/x.csv", "/logs/%252e%252e%252fx.csv", "/logs/x%00.csv",
     "/logs/%ff.csv", "/logs/.x.csv", "/x.csv", "/part/../logs/x.csv", "http://127.0.0.1/logs/x.csv", "/logs/x.csv?y"],
)  # fmt: skip
def test_no_address_leads_out_of_the_folder(server, path):
    status, _, _ = ask(server, "POST", path, b"changed")
    assert status in (400, 404)
    assert list(server.folder.path.iterdir()) == []
    assert (server.folder.path.parent / "outside.csv").read_text() == "kept"
    assert len(list(server.folder.path.parent.iterdir())) == 2


def test_what_is_too_large_or_of_no_stated_length_is_refused(server):
    status, _, said = ask(server, "POST", "/logs/a.csv", b"", Content_Length="1001")
    assert status == 413 and said.startswith("a.csv is 0.001001 MB; the page takes logs up to 0.001 MB")
    for length in (None, "-1", "1e3", "0x10", "9" * 30):
        assert ask(server, "POST", "/logs/a.csv", b"t", Content_Length=length)[0] == 411, length
    assert (
        ask(server, "POST", "/logs/a.csv", b"1\r\nt\r\n0\r\n\r\n", Content_Length=None, Transfer_Encoding="chunked")[0]
        == 411
    )
    assert list(server.folder.path.iterdir()) == []


def test_a_sender_who_falls_silent_is_told_so(server, monkeypatch):
    monkeypatch.setattr("jaxid.live.server._Handler.timeout", 0.2)
    status, _, said = ask(server, "POST", "/logs/a.csv", b"half", Content_Length="900")
    assert status == 408 and "send the log again" in said and list(server.folder.path.iterdir()) == []


def test_what_changes_is_told_at_once_and_the_end_ends_it(server):
    address = "127.0.0.1", server.server_port
    with socket.create_connection(address, timeout=5) as line, line.makefile("rb") as said:
        line.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\n\r\n".encode())

        def event():
            while not (text := said.readline()).startswith(b"data: "):
                assert text, "the answer ended"
            return json.loads(text[6:])

        assert event()["parts"]["fit"] == {"number": 0, "state": "waiting", "words": ""}
        server.board.tell("fit", "running", "output error")
        assert event()["parts"]["fit"]["words"] == "output error"
        server.board.tell("fit", "done", "", "<p>Sound</p>")
        assert event()["parts"]["fit"] == {"number": 1, "state": "done", "words": ""}
        assert ask(server, path="/part/fit")[2] == "<p>Sound</p>"
        server.board.close()
        assert said.read().strip() in (b"", b": still here")  # it ends instead of waiting
