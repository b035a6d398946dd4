"""The server: sentences for bad requests, limits, and a server that lives on."""

from __future__ import annotations

import asyncio
import errno
import html
import logging
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlencode, urlsplit

import psutil
import pytest

import bseries as bs
from bseries.explorer import server
from bseries.explorer.reading import Request
from bseries.explorer.server import Frame, frame_answer, read_arguments
from bseries.explorer.workers import NotComputed, Worker, Workers

pytestmark = pytest.mark.minimum

pytest.importorskip("bokeh")


def page(address: str, query: str = "", seconds: float = 120.0, **arguments: str) -> str:
    """The page, once it is computed."""
    end = time.monotonic() + seconds
    while True:
        with urllib.request.urlopen(f"{address}?{query or urlencode(arguments)}", timeout=60) as answer:
            text = answer.read().decode()
        if 'http-equiv="refresh"' not in text:
            return html.unescape(text)
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_page_of_a_method_and_a_scene(address):
    text = page(address, method="heun2", scene="pendulum", order="3")
    assert "heun2: order 2" in text
    assert "heun2 on pendulum" in text
    assert "4 of 4" not in text.partition("<script>")[0]  # counted in the browser
    assert text.count("data-zero=") == 4
    assert 'role="alert"' not in text.partition("<script>")[0]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"method": "0 0; 1/2 0"}, "method must be a tableau with a row for each stage and then the weights"),
        ({"method": "rk5000"}, "name must be a method of the catalogue, but was 'rk5000'"),
        ({"method": '{"A": 1}'}, "method"),
        ({"method": "<script>alert(1)</script>"}, "name must be a method of the catalogue"),
        ({"method": "x" * 5000}, "method must have at most 4,000 characters, but had 5,000"),
        ({"method": ""}, "method must be a name such as rk4 or a tableau, but was empty"),
        ({"order": "40"}, "order must be"),
        ({"scene": "__import__('os').system('true')"}, "must"),
        ({"scene": "p^2/2 + 1/q", "start": "p=0;q=0"}, "must make q other than zero"),
        ({"start": "p"}, "start must be values by block"),
        ({"span": "-1"}, "span must be more than 0"),
        ({"scene": "outer-solar-system"}, "scene must have at most 24 variables to explore"),
        ({"method": "sdirk2"}, "gamma"),
    ],
)
def test_bad_requests_get_a_sentence(address, arguments, sentence):
    text = page(address, **arguments)
    head = text.partition('role="alert">')[2].partition("</p>")[0]
    assert sentence in head
    assert head.endswith(".")
    assert "heun2: order 2" in page(address, method="heun2", order="3")


def test_malformed_addresses(address):
    assert "method must be given once, as UTF-8" in page(address, query="method=%ff%fe")
    assert "method must be given once, as UTF-8" in page(address, query="method=rk4&method=rk4")
    for path in ("../../etc/passwd", "ws", "static/js/nothing.js", "%00"):
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(f"{address}{path}", timeout=10)
    host, port = urlsplit(address).hostname, urlsplit(address).port
    for nonsense in (b"\x00\xff\r\n\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n", b"GET"):
        with socket.create_connection((host, port), timeout=10) as connection:
            connection.sendall(nonsense)
    assert "heun2: order 2" in page(address, method="heun2", scene="pendulum", order="3")


@pytest.mark.slow
def test_requests_at_once_and_clients_that_go_away(address):
    host, port = urlsplit(address).hostname, urlsplit(address).port
    with socket.create_connection((host, port), timeout=10) as connection:
        connection.sendall(b"GET /?method=gauss2&order=7 HTTP/1.1\r\nHost: localhost\r\n\r\n")
    names = ["kutta3", "ralston3", "heun3", "ssprk33"]
    with ThreadPoolExecutor(4) as pool:
        pages = list(pool.map(lambda name: page(address, method=name, scene="riccati", order="3"), names))
    for name, text in zip(names, pages, strict=True):
        assert f"{name}: order 3" in text


def test_only_this_machine_is_served(address):
    assert urlsplit(address).hostname == "127.0.0.1"


def status(address: str, host: str, path: str = "/?method=heun2", **headers: str) -> int:
    """The status of the answer to a request for a host."""
    place = urlsplit(address)
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}", *(f"{key}: {value}" for key, value in headers.items()), "", ""]
    with socket.create_connection((place.hostname, place.port), timeout=60) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.makefile("rb").readline().split()[1])


def test_only_names_of_this_machine_are_answered(address):
    """Pages of a host whose name is made to lead here must not read answers, nor open a websocket."""
    port = urlsplit(address).port
    hosts = f"127.0.0.1:{port}", f"LocalHost:{port}", f"evil.com:{port}", "localhost", f"127.0.0.1:{port + 1}"
    assert [status(address, host) for host in hosts] == [200, 200, 404, 404, 404]
    socket_of = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    for host, refusal in ((f"evil.com:{port}", 404), (f"127.0.0.1:{port}", 403)):  # the second: of another origin
        headers = {**socket_of, "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Origin": f"http://evil.com:{port}"}
        assert status(address, host, "/ws", **headers) == refusal


def test_a_port_is_served_once(address):
    port = urlsplit(address).port
    assert port is not None
    with pytest.raises(bs.SeriesError, match=f"port must be free, but {port} was not: "):
        server.serve(port, print)


def test_without_file_descriptors_connections_wait(monkeypatch):
    def exhausted(self):
        raise OSError(code, "no more")

    with server.Listener(0) as listener:
        monkeypatch.setattr(socket.socket, "accept", exhausted)
        code = errno.EMFILE
        with pytest.raises(BlockingIOError):  # the server comes again, and logs nothing
            listener.accept()
        code = errno.EINVAL
        with pytest.raises(OSError, match="no more"):
            listener.accept()


def test_logs_have_one_line_for_each_record():
    try:
        raise ValueError("one\ntwo\x1b")
    except ValueError:
        record = logging.makeLogRecord({"levelname": "ERROR", "msg": "message\nmore", "exc_info": sys.exc_info()})
    assert server.OneLine().format(record) == "bseries: error: message: ValueError: one two\\x1b"


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "delay"), [(2, 0.3), (2, 1), (2, 2), (2, None), (15, None), (9, None)])
def test_servers_end_whenever_they_are_told_to(number, delay):
    """Without a hang, a traceback, or workers that are left: SIGINT at any time, SIGTERM and SIGKILL while serving."""
    with subprocess.Popen(
        [sys.executable, "-c", "from bseries_command import main; main()", "explore", "--port", "0", "--no-open"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"}, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as job:  # fmt: skip
        if delay is None:
            assert job.stdout is not None
            job.stdout.readline()
        else:
            time.sleep(delay)
        workers = psutil.Process(job.pid).children()
        (os.killpg if number == signal.SIGINT else os.kill)(job.pid, number)
        _, err = job.communicate(timeout=60)
    assert err == ""
    assert job.returncode in ({0, 130} if number == signal.SIGINT else {-number})
    assert not psutil.wait_procs(workers, timeout=20)[1]


def test_a_worker_is_replaced_after_its_time_or_its_end():
    worker = Worker()
    try:
        with pytest.raises(bs.SeriesError, match=r"request must take at most 0.5 s, but took longer"):
            worker.ask(time.sleep, 60, seconds=0.5)
        with pytest.raises(bs.SeriesError, match="request must not end its process, but did"):
            worker.ask(os._exit, 1)
        with pytest.raises(bs.SeriesError, match=r"request must need less memory than there is"):
            worker.ask(bytearray, 2**40)
        with pytest.raises(bs.SeriesError, match=r"request could not be computed \(TypeError"):
            worker.ask(len, 3)
        assert worker.ask(len, "abc") == 3
    finally:
        worker.stop()


def test_workers_are_shared():
    async def many() -> list[int]:
        return await asyncio.gather(*(workers.ask(k, len, "x" * k) for k in range(20)))

    workers = Workers(2)
    try:
        assert asyncio.run(many()) == list(range(20))
    finally:
        workers.close()


@pytest.mark.parametrize(
    ("frame", "sentence"),
    [
        (Frame(("numerical",), 0.0, 1.0, 3), "h must be a number greater than 0"),
        (Frame(("numerical",), float("nan"), 1.0, 3), "h must be a number greater than 0"),
        (Frame(("modified",), 0.1, 1.0, 10**9), "factor and terms must be 0.2 to 1.6 and 1 to 6"),
        (Frame(("exact",), 0.1, float("inf"), 3), "factor and terms must be"),
        (Frame(("exact",), 1e-9, 1.0, 3), "h must be at least"),
        (Frame(("modified",), 0.1, 1.0, float("nan")), "factor and terms must be"),
        (Frame(("modified",), 0.1, 1.0, 2.5), "factor and terms must be"),
    ],
)
def test_values_that_no_slider_has(frame, sentence):
    with pytest.raises(bs.SeriesError, match=sentence):
        frame_answer(Request(), frame)


def test_unknown_arguments_are_ignored():
    assert read_arguments({"method": [b"rk4"], "other": [b"x", b"\xff"]}) == Request()


def test_failures_that_may_pass_are_asked_again(monkeypatch):
    asked = []

    class Failing:
        async def ask(self, key, function, request):
            asked.append(function)
            if len(asked) == 1:
                raise NotComputed("server must be free, but was busy")
            raise OSError("no process") if len(asked) == 2 else bs.SeriesError("method must be one")

    async def sentences():
        explorer, request = server.Explorer(Failing()), Request()
        found = []
        for _ in range(4):
            found.append((await explorer.answer(request)).sentences[0])
            await asyncio.sleep(0.01)
        return found

    monkeypatch.setattr(server, "SEEN", 0)
    busy, broken, *last = asyncio.run(sentences())
    assert (busy, broken) == ("server must be free, but was busy.", "request could not be computed: no process.")
    assert last == ["method must be one."] * 2
    assert len(asked) == 3  # the last answer was kept
