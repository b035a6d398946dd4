"""The explorer as a local server: a page for each request, and pictures that follow its sliders."""

from __future__ import annotations

import asyncio
import errno
import logging
import math
import os
import signal
import socket
import time
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import cache, lru_cache, partial
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from bseries.explorer.flows import MOST_SPAN, NOTHING, SPAN, SceneFlows, SceneShape, View
from bseries.explorer.flows import SCALES as FACTORS
from bseries.explorer.method_facts import MOST_TREES, MethodFacts, StabilityShapes, method_facts, region_of
from bseries.explorer.plots import ScenePlots, flow_numbers, page_parts, template
from bseries.explorer.reading import Request, read_integer, read_method, read_positive, read_scene
from bseries.explorer.workers import NotComputed, Workers
from bseries_base.errors import as_sentence, plain
from bseries_base.extras import optional_module
from integrators import catalogue, scene_catalogue

if TYPE_CHECKING:
    from bokeh.application.application import SessionContext
    from bokeh.application.handlers import Handler
    from bokeh.document import Document
    from tornado.httputil import HTTPServerRequest
    from tornado.ioloop import IOLoop
    from tornado.routing import Router
    from tornado.web import Application

ADDRESS = "127.0.0.1"
"""Nobody else reaches the server."""
PATIENCE = 0.7
"""Seconds before a page says that it is computing."""
SEEN = 60
"""Seconds after which an answer is forgotten that may be another one next time."""
KEPT, KEPT_SCENES = 32, 4
"""Answers of the server, and scenes of a worker with their compiled functions."""
MOST_PAGES = 32
"""With pictures of a scene, open at the same time."""
LIFETIME = 10_000
"""Milliseconds until a page is forgotten that no browser is connected to."""
MOST_BYTES = 2**20
"""Of a message from a browser."""
EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}
"""Errors of a process, or a machine, that can have no more connections."""
STEPS, SCALES = 200, (*FACTORS, 0.02)
"""Of the sliders of h, and of the factor of the start."""
CURVES, ORBITS = ("numerical", "exact", "modified"), ("orbits",)
"""The flows that pictures compare, which are shown together, so that each picture is drawn once; and many orbits."""
MOMENT = 0.06  # seconds that pictures wait for many orbits, to be shown together


class Frame(NamedTuple):
    """Values of the sliders, and the flows that are wanted."""

    flows: tuple[str, ...]
    h: float
    scale: float
    terms: float


def method_answer(request: Request) -> tuple[MethodFacts, StabilityShapes | str]:
    """The method of a request, and its stability region.

    Example:
        >>> from bseries.explorer.reading import Request
        >>> method_answer(Request(method="heun2", order="3"))[0].order
        2
    """
    method = read_method(request.method)
    nodes = read_integer(request.order, "order", 0, MOST_TREES)
    return method_facts(method, nodes or None), region_of(method)


def scene_answer(request: Request) -> SceneShape:
    """The scene of a request."""
    return _flows(request.method, request.scene, request.start, request.span).shape


def frame_answer(request: Request, frame: Frame) -> tuple[np.ndarray, str]:
    """The numbers of some flows for `plots.FILL`, and a sentence if there is no modified equation.

    Example:
        >>> from bseries.explorer.reading import Request
        >>> numbers, sentence = frame_answer(Request(method="heun2"), Frame(("exact",), 0.1, 1.0, 3))
        >>> len(numbers) == 4 * 151 + 2 * 300 + 2 * 6, sentence
        (True, '')
    """
    flows = _flows(request.method, request.scene, request.start, request.span)
    wanted, h, scale, terms = frame
    if not (FACTORS[0] <= scale <= FACTORS[1] and terms in range(1, flows.terms + 1)):
        raise SeriesError(
            f"factor and terms must be {FACTORS[0]:g} to {FACTORS[1]:g} and 1 to {flows.terms}, but were {scale!r:.60} "
            f"and {terms!r:.60}"
        )
    found, sentence = [], ""
    for flow in wanted:
        if flow == "orbits":
            views = {flow: flows.orbits(h)}
        elif flow == "modified":
            try:
                views = flows.modified(h, scale, int(terms))
            except SeriesError as error:
                views, sentence = NOTHING, as_sentence(error)
        else:
            views = _fixed_view(flows, flow, h, scale)
        found.append(flow_numbers(flow, views))
    return np.concatenate(found), sentence


@lru_cache(2)
def _fixed_view(flows: SceneFlows, flow: str, h: float, scale: float) -> View:
    """A flow that does not depend on the number of terms, kept while only that changes."""
    return flows.exact(h, scale) if flow == "exact" else flows.numerical(h, scale)


@lru_cache(KEPT_SCENES)
def _flows(method: str, scene: str, start: str, span: str) -> SceneFlows:
    return SceneFlows(read_method(method), read_scene(scene, start), read_positive(span, "span", SPAN, MOST_SPAN))


class Answer(NamedTuple):
    """What is known for a request; None for what is not, with sentences that say why."""

    method: tuple[MethodFacts, StabilityShapes | str] | None
    scene: SceneShape | None
    sentences: tuple[str, ...]
    lasts: bool = True


class Explorer:
    """Answers to requests, each computed once, and the pages that show them."""

    def __init__(self, workers: Workers):
        self.workers = workers
        self._answers: OrderedDict[Request, asyncio.Task[Answer]] = OrderedDict()
        self._pages: dict[str, tuple[Request, asyncio.Task[Answer] | None]] = {}

    async def prepare(self, context: Any) -> None:
        """Compute what a new page needs, as far as it takes no longer than a moment."""
        if len(self._pages) >= MOST_PAGES:
            return
        try:
            request = read_arguments(context.request.arguments)
        except SeriesError as error:
            task = asyncio.ensure_future(_refused(error))
            request = Request()
        else:
            task = self.answer(request)
        await asyncio.wait([task], timeout=PATIENCE)
        self._pages[context.id] = request, task

    def forget(self, context: SessionContext) -> None:
        """Forget a page that was closed."""
        self._pages.pop(context.id, None)

    def answer(self, request: Request) -> asyncio.Task[Answer]:
        """The answer to a request, which may be under way; a page that comes again finds it."""
        if request not in self._answers:
            task = self._answers[request] = asyncio.ensure_future(self._compute(request))
            task.add_done_callback(lambda task: self._check(request, task))
            while len(self._answers) > KEPT:
                self._answers.popitem(last=False)
        self._answers.move_to_end(request)
        return self._answers[request]

    def _check(self, request: Request, task: asyncio.Task[Answer]) -> None:
        """Forget an answer that may be another one when it is asked for again, once pages have seen it."""
        if not task.cancelled() and not task.result().lasts:
            asyncio.get_running_loop().call_later(SEEN, self._drop, request, task)

    def _drop(self, request: Request, task: asyncio.Task[Answer]) -> None:
        """Forget an answer, unless the request was asked again in the meantime."""
        if self._answers.get(request) is task:
            del self._answers[request]

    async def _compute(self, request: Request) -> Answer:
        method = None
        try:
            method = await self.workers.ask(request.method, method_answer, request)
            return Answer(method, await self.workers.ask(request.method, scene_answer, request), ())
        except SeriesError as error:
            return Answer(method, None, (as_sentence(error),), lasts=not isinstance(error, NotComputed))
        except Exception as error:  # the page says so, and the server lives on
            return Answer(method, None, (as_sentence(f"request could not be computed: {error}"),), lasts=False)

    def show(self, document: Any) -> None:
        """Fill a page."""
        request, task = self._pages.pop(document.session_context.id, (Request(), None))
        variables: dict[str, object] = {"title": "bseries explore", "request": request, **_choices()}
        if task is None:
            variables["sentences"] = [f"pages must be at most {MOST_PAGES} at a time, but that many are open."]
        elif not task.done():
            variables["waiting"] = True
        else:
            answer = task.result()
            variables["sentences"] = answer.sentences
            if answer.method is not None:
                known, roots, plots = page_parts(*answer.method, answer.scene, STEPS, SCALES)
                variables |= known
                if plots is not None:
                    LivePage(document, self.workers, request, plots)
                    self._pages[document.session_context.id] = request, task
                for root in roots.values():
                    document.add_root(root)
        document.template, document.title = template(), variables["title"]
        document.template_variables.update(variables)


class LivePage:
    """Keeps the pictures of a page at the values of its sliders: whatever moves meanwhile is computed next."""

    def __init__(self, document: Document, workers: Workers, request: Request, plots: ScenePlots):
        self._document, self._workers, self._request, self._plots = document, workers, request, plots
        self._is_wanted = self._is_running = False
        self._orbits_h: float | None = None  # the step size of the orbits that are shown
        self._orbits_seconds = math.inf  # that the answer with the last orbits took
        for slider in (plots.h, plots.scale, plots.terms):
            slider.on_change("value", lambda name, old, new: self._start())
        document.on_event("document_ready", lambda event: self._start())  # a page that loads would miss what it is told

    def _start(self) -> None:
        self._is_wanted = True
        if not self._is_running:
            self._is_running = True
            free = optional_module("bokeh.document", "explore").without_document_lock
            self._document.add_next_tick_callback(free(self._follow))

    async def _follow(self) -> None:
        try:
            while self._is_wanted and self._document.session_context is not None:
                self._is_wanted = False
                await self._update()
        finally:
            self._is_running = False

    async def _update(self) -> None:
        """Compute and show the flows; many orbits only for another step size, and alone if they take long.

        At first the numerical solution comes alone: machine code for the others may have to be compiled.
        """
        plots = self._plots
        h, scale, terms = (float(slider.value) for slider in (plots.h, plots.scale, plots.terms))
        everything = [(*CURVES, *ORBITS)] if self._orbits_seconds < MOMENT else [CURVES, ORBITS]
        first, sentence = [CURVES[:1]] if self._orbits_h is None else [], ""
        for wanted in [CURVES] if h == self._orbits_h else [*first, *everything]:
            if wanted is ORBITS and self._is_wanted:
                return
            begun = time.perf_counter()
            try:
                frame = Frame(wanted, h, scale, terms)
                numbers, said = await self._workers.ask(self._request.method, frame_answer, self._request, frame)
            except SeriesError as error:
                numbers, said = None, as_sentence(error)
            if self._document.session_context is None:  # the page was closed meanwhile
                return
            sentence = said or sentence
            if "orbits" in wanted:
                self._orbits_seconds = time.perf_counter() - begun
            self._document.add_next_tick_callback(partial(self._show, wanted, numbers, sentence))
            if numbers is None:
                return
        self._orbits_h = h

    def _show(self, flows: tuple[str, ...], numbers: np.ndarray | None, sentence: str) -> None:
        self._plots.sentence.text = escape(sentence)
        if numbers is not None:
            self._plots.news.data = {" ".join(flows): numbers}


async def _refused(error: SeriesError) -> Answer:
    return Answer(None, None, (as_sentence(error),))


def read_arguments(arguments: Mapping[str, Sequence[bytes]]) -> Request:
    """The request in the query of an address.

    Raises:
        SeriesError: A text is too long, not UTF-8, or given twice.

    Example:
        >>> read_arguments({"method": [b"heun2"]}).method
        'heun2'
    """
    texts: dict[str, str] = {}
    for name, values in arguments.items():
        if name in Request._fields:
            try:
                (value,) = values
                texts[name] = value if isinstance(value, str) else value.decode("utf-8")
            except ValueError:
                raise SeriesError(f"{name} must be given once, as UTF-8, but was not") from None
    return Request(**texts).checked()


@cache
def _choices() -> dict[str, list[str]]:
    """The names in the form."""
    methods = [f"{entry.name}{entry.least_stages}" if entry.is_family else entry.name for entry in catalogue()]
    return {"methods": methods, "scenes": [entry.name for entry in scene_catalogue()]}


def serve(port: int, ready: Callable[[str], object]) -> None:
    """Serve pages on this machine until interrupted.

    Args:
        port: The port; 0 for any that is free.
        ready: Called with the address once pages are served.

    Raises:
        SeriesError: The port is taken.
        MissingPackage: Bokeh is not installed.
    """
    base_server = optional_module("bokeh.server.server", "explore").BaseServer
    pages = optional_module("bokeh.server.tornado", "explore").BokehTornado
    application = optional_module("bokeh.application", "explore").Application
    http_server = optional_module("tornado.httpserver", "explore").HTTPServer
    loop = optional_module("tornado.ioloop", "explore").IOLoop.current()
    log_in_lines()
    with Listener(port) as listener, _stopped_by_interrupts(loop), closing(Workers()) as workers:
        hosts = [f"{name}:{listener.port}" for name in (ADDRESS, "localhost")]
        explorer = Explorer(workers)
        served = pages(
            {"/": application(_handler(explorer))},
            extra_websocket_origins=hosts,
            websocket_max_message_size_bytes=MOST_BYTES,
            check_unused_sessions_milliseconds=LIFETIME // 5,
            unused_session_lifetime_milliseconds=LIFETIME,
        )
        server = base_server(loop, served, http_server(for_hosts(hosts, served)))
        server._http.add_sockets([listener])
        server.start()
        loop.add_callback(explorer.answer, Request())  # the first page is likely this one
        ready(f"http://{ADDRESS}:{listener.port}/")
        loop.start()
        server.stop()


class OneLine(logging.Formatter):
    """A record of a log as one line, with the error instead of its traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        error = record.exc_info and record.exc_info[1]
        parts = [record.getMessage(), f"{type(error).__name__}: {error}" if error else ""]
        (first, *_), said = parts[0].splitlines() or [""], " ".join(parts[1].split())
        text = f"{first}: {said}" if said and said not in first else first
        return f"bseries: {record.levelname.lower()}: {plain(text):.300}"


def log_in_lines() -> None:
    """Let the server's packages log their warnings and errors on stderr, in one line each."""
    handler = logging.StreamHandler()
    handler.setFormatter(OneLine())
    configure = optional_module("bokeh.util.logconfig", "explore").basicConfig  # which takes Bokeh's own handler away
    configure(level=logging.WARNING, handlers=[handler], force=True)


class Listener(socket.socket):
    """The socket that browsers connect to. Without free file descriptors they wait."""

    def __init__(self, port: int):
        super().__init__(socket.AF_INET, socket.SOCK_STREAM)
        if os.name == "posix":  # elsewhere it would take a port that is in use
            self.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self.bind((ADDRESS, port))
            self.listen()
        except OSError as error:
            self.close()
            raise SeriesError(f"port must be free, but {port} was not: {error.strerror}") from None
        self.setblocking(False)
        self.port: int = self.getsockname()[1]

    def accept(self) -> tuple[socket.socket, tuple[str, int]]:
        """The next connection; the server takes errors but this one for its own."""
        try:
            return super().accept()
        except OSError as error:
            if error.errno not in EXHAUSTED:
                raise
            time.sleep(MOMENT)
            raise BlockingIOError from None


def for_hosts(hosts: Collection[str], served: Application) -> Router:
    """What a server serves to requests for these hosts; others get nothing.

    Names of other hosts may be made to lead to this machine, so that their pages could read answers.
    """
    routing = optional_module("tornado.routing", "explore")

    class OfHosts(routing.Matcher):
        """Matches requests for these hosts."""

        def match(self, request: HTTPServerRequest) -> dict[str, object] | None:
            return {} if request.host.lower() in hosts else None

    return routing.RuleRouter([routing.Rule(OfHosts(), served)])


@contextmanager
def _stopped_by_interrupts(loop: IOLoop) -> Iterator[None]:
    """Let interrupts stop a loop between two of its callbacks, not threads and processes that are being started."""
    before = signal.getsignal(signal.SIGINT)
    if callable(before):  # those that are ignored stay so
        signal.signal(signal.SIGINT, lambda *_: loop.add_callback(loop.stop))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _handler(explorer: Explorer) -> Handler:
    """What Bokeh asks for each page."""
    base = optional_module("bokeh.application.handlers", "explore").Handler

    class PageHandler(base):
        """Prepares a page without blocking the others, fills it, and forgets it."""

        async def on_session_created(self, session_context: SessionContext) -> None:
            await explorer.prepare(session_context)

        def modify_document(self, doc: Document) -> None:
            explorer.show(doc)

        async def on_session_destroyed(self, session_context: SessionContext) -> None:
            explorer.forget(session_context)

    return PageHandler()
