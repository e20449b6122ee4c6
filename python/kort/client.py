"""A client of a running service: REST by the standard library, the stream by ``websockets`` (the extra ``stream``)."""

from __future__ import annotations

import asyncio
import json
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Coroutine, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import quote, urlsplit, urlunsplit

from . import _kort
from .diagnosis import Diagnosis
from .fitting import Fit
from .recording import Recording, _taken
from .reports import build

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

_Result = TypeVar("_Result")


class Answer(Exception):
    """A refusal: the problem document (RFC 9457) that the service answered with."""

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        self.status = status
        """HTTP status."""
        self.problem = dict(problem)
        """The document: type, title, detail, hint."""
        words = problem.get("detail") or problem.get("title") or "no reason given"
        hint = problem.get("hint")
        super().__init__(f"{status}: {words}" + (f"\nhint: {hint}" if hint else ""))


@dataclass(frozen=True)
class Setpoint:
    """What is commanded: exactly one of the two."""

    thrust_n: float | None = None
    """Thrust, N; positive pushes ahead."""
    speed_rad_s: float | None = None
    """Shaft speed, rad/s; positive turns ahead."""


@dataclass(frozen=True)
class State:
    """Everything known of one thruster at one instant."""

    id: str
    """Name of the thruster."""
    armed: bool
    """Is the drive armed?"""
    controller: str | None
    """Control law that runs."""
    setpoint: Setpoint
    """Setpoint in force."""
    measured: dict[str, float | None]
    """What the sensors show, by column name (SI, unit last); none where it is not measured."""
    estimated: dict[str, Any]
    """What observer and estimator believe; ``parameters`` is a list."""
    faults: list[dict[str, Any]]
    """Latched faults: code, name, help."""
    limits: list[Any]
    """Limits in force."""
    lease: dict[str, Any] | None
    """Who has command."""
    time_s: float
    """The servo's monotonic time of the measurements, s."""
    document: dict[str, Any] = field(repr=False, default_factory=dict)
    """The JSON document, with everything that has no field here."""


def _state(document: dict[str, Any]) -> State:
    state: State = build(State, {**document, "document": document})
    return state


class Client:
    """A running service.

    ``url`` is the gateway's address, ``token`` a bearer token where it asks for one, ``timeout_s`` how long an answer
    may take, ``context`` the TLS context of a https address. Every method raises :class:`Answer` for a refusal and
    ``OSError`` if nobody answers."""

    def __init__(
        self,
        url: str = "http://127.0.0.1:8080",
        *,
        token: str | None = None,
        timeout_s: float = 10.0,
        context: ssl.SSLContext | None = None,
    ) -> None:
        self.url = url.rstrip("/")
        self._token, self._timeout_s, self._context = token, timeout_s, context

    def request(
        self, method: str, path: str, body: Any = None, *, lease_id: str | None = None
    ) -> tuple[str, bytes]:
        """Any request: content type and bytes of the answer."""
        headers = {"Accept": "*/*"}
        if body is not None:
            headers["Content-Type"] = "application/json"
        if self._token is not None:
            headers["Authorization"] = f"Bearer {self._token}"
        if lease_id is not None:
            headers["Lease-Id"] = lease_id
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data=data, method=method, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=self._timeout_s, context=self._context) as answer:
                return answer.headers.get_content_type(), answer.read()
        except urllib.error.HTTPError as refused:
            raise Answer(refused.code, _problem(refused.read())) from None

    def call(self, method: str, path: str, body: Any = None, *, lease_id: str | None = None) -> Any:
        """Any request: the answer's JSON, none where it has no body."""
        _, bytes_ = self.request(method, path, body, lease_id=lease_id)
        return json.loads(bytes_) if bytes_ else None

    def thrusters(self) -> list[State]:
        """Every thruster's state."""
        return [_state(one) for one in self.call("GET", "/v1/thrusters")]

    def state(self, thruster: str) -> State:
        """One thruster's state."""
        return _state(self.call("GET", _of(thruster)))

    def controller(self, thruster: str) -> dict[str, Any]:
        """The control law that runs and its parameters, with units and ranges."""
        answer: dict[str, Any] = self.call("GET", _of(thruster, "controller"))
        return answer

    def command(self, thruster: str, holder: str, *, ttl_ms: int = 10_000, takeover: bool = False) -> Command:
        """Takes command of a thruster, for ``ttl_ms`` without a command (ms, 60000 at most). Best as a context, which
        gives it up at its end: thrust is then ramped to zero."""
        body = {"holder": holder, "ttl_ms": ttl_ms, "takeover": takeover}
        grant = self.call("POST", _of(thruster, "lease"), body)
        return Command(self, thruster, grant["lease_id"])

    def stop(self) -> None:
        """Every thruster to zero, and disarmed."""
        self.call("POST", "/v1/stop")

    def stream(self, thruster: str, hz: float = 50.0) -> Stream:
        """The thruster's state as it comes, ``hz`` times a second; needs ``websockets``."""
        return Stream(self, thruster, hz)

    def events(self, since: int | str | None = None) -> Any:
        """Who armed, commanded and switched, what tripped and restarted."""
        return self.call("GET", "/v1/events" + ("" if since is None else f"?since={quote(str(since))}"))

    def controller_file(self, thruster: str) -> str:
        """The controller that runs as a TOML file, which :meth:`Command.load_controller`, ``kort.toml`` and
        :func:`kort.soak` take."""
        return self.request("GET", _of(thruster, "controller/file"))[1].decode()

    def record(
        self,
        thruster: str,
        name: str | None = None,
        *,
        rate_hz: float | None = None,
        tags: Iterable[str] = (),
    ) -> str:
        """Starts a recording with at most ``rate_hz`` rows a second (Hz) and words to find it by; its name."""
        body = {"thruster": thruster, "name": name, "rate_hz": rate_hz, "tags": list(tags)}
        started = self.call("POST", "/v1/recordings", {k: v for k, v in body.items() if v is not None})
        return str(started["name"])

    def end_recording(self, name: str) -> None:
        """Stops a running recording."""
        self.call("DELETE", f"/v1/recordings/{quote(name)}")

    def tag(self, name: str, tags: Iterable[str]) -> None:
        """Gives a recording other tags, also while it runs."""
        self.call("PATCH", f"/v1/recordings/{quote(name)}", {"tags": list(tags)})

    def recordings(self, tag: str | None = None) -> Any:
        """Every recording, or those with a tag; oldest first."""
        return self.call("GET", "/v1/recordings" + ("" if tag is None else f"?tag={quote(tag)}"))

    def recording(self, name: str) -> Recording:
        """Fetches a recording. It holds its rig description: :func:`kort.diagnose` needs no other."""
        _, mcap = self.request("GET", f"/v1/recordings/{quote(name)}.mcap")
        return _taken(_kort.decode(name, mcap, None))

    def diagnose(
        self,
        thruster: str,
        *,
        recording: str | None = None,
        last_s: float | None = None,
        timeout_s: float = 600.0,
    ) -> tuple[str, Diagnosis]:
        """Lets the service diagnose a recording, or the last ``last_s`` seconds, and waits ``timeout_s`` (s) for it; its
        id and the report. Raises ``RuntimeError`` if it fails and ``TimeoutError`` if it takes longer."""
        started, report = self._analysed(thruster, "diagnoses", recording, last_s, timeout_s)
        _, page = self.request("GET", _of(thruster, f"diagnoses/{quote(started)}/report"))
        extra = {"document": report, "rig_toml": "", "html": page.decode()}
        diagnosis: Diagnosis = build(Diagnosis, {**report, **extra})
        return started, diagnosis

    def fit(
        self,
        thruster: str,
        *,
        recording: str | None = None,
        last_s: float | None = None,
        timeout_s: float = 600.0,
    ) -> tuple[str, Fit]:
        """Lets the service fit its model to a recording, or to the last ``last_s`` seconds, and waits ``timeout_s`` (s) for
        it; its id and the report. Raises ``RuntimeError`` if it fails and ``TimeoutError`` if it takes longer."""
        started, report = self._analysed(thruster, "fits", recording, last_s, timeout_s)
        _, rig = self.request("GET", _of(thruster, f"fits/{quote(started)}/rig"))
        fitted: Fit = build(Fit, {**report, "document": report, "rig_toml": rig.decode()})
        return started, fitted

    def _analysed(
        self, thruster: str, what: str, recording: str | None, last_s: float | None, timeout_s: float
    ) -> tuple[str, dict[str, Any]]:
        """Id and report of a diagnosis or a fit, once it is done."""
        body = {k: v for k, v in {"recording": recording, "last_s": last_s}.items() if v is not None}
        started = str(self.call("POST", _of(thruster, what), body)["id"])
        end = time.monotonic() + timeout_s
        while True:
            found = self.call("GET", _of(thruster, f"{what}/{quote(started)}"))
            if found["report"] is not None:
                return started, found["report"]
            if found["state"] != "running":
                raise RuntimeError(f"{started}: {found['state']}: {found.get('cause')}")
            if time.monotonic() > end:
                raise TimeoutError(f"{started}: no report after {timeout_s} s; it runs on")
            time.sleep(0.2)


class Command:
    """Command of one thruster, held by a lease that every accepted command renews."""

    def __init__(self, client: Client, thruster: str, lease_id: str) -> None:
        self._client, self._thruster = client, thruster
        self.lease_id = lease_id
        """The lease, for requests of your own."""

    def _call(self, method: str, what: str, body: Any = None) -> Any:
        return self._client.call(method, _of(self._thruster, what), body, lease_id=self.lease_id)

    def __enter__(self) -> Command:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, raised: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.give_up()
        except (Answer, OSError):
            # A lease that ended by itself, or a service that is gone: thrust is zero already.
            if kind is None:
                raise

    def renew(self) -> None:
        """Keeps the lease without commanding anything."""
        self._call("PUT", "lease")

    def give_up(self) -> None:
        """Gives command up; thrust is ramped to zero."""
        self._call("DELETE", "lease")

    def arm(self) -> None:
        """Arms the drive."""
        self._call("POST", "arm")

    def disarm(self) -> None:
        """Disarms the drive: no torque."""
        self._call("POST", "disarm")

    def clear_faults(self) -> None:
        """Clears latched faults."""
        self._call("POST", "clear-faults")

    def thrust(self, thrust_n: float) -> None:
        """Commands thrust, N; positive pushes ahead."""
        self._call("PUT", "setpoint", {"thrust_n": thrust_n})

    def speed(self, speed_rad_s: float) -> None:
        """Commands shaft speed, rad/s; positive turns ahead."""
        self._call("PUT", "setpoint", {"speed_rad_s": speed_rad_s})

    def switch(self, controller: Mapping[str, Any]) -> Any:
        """Puts a control law with its parameters in force, without a bump."""
        return self._call("PUT", "controller", dict(controller))

    def load_controller(self, toml: str) -> Any:
        """Puts a controller file in force, without a bump: law, observer, estimator and every parameter."""
        return self._call("PUT", "controller/file", {"toml": toml})

    def play(self, excitation: Mapping[str, Any]) -> Any:
        """Plays a test signal (``POST …/excitation``; /docs of the service lists the keys)."""
        return self._call("POST", "excitation", dict(excitation))

    def adopt(self, diagnosis: str) -> Any:
        """Puts the rig with what a diagnosis found in force: no stop, no step."""
        return self._call("POST", "rig", {"diagnosis": diagnosis})

    def adopt_fit(self, fit: str) -> Any:
        """Puts the rig with the values of a fit in force: no stop, no step."""
        return self._call("POST", "rig", {"fit": fit})

    def roll_back(self) -> Any:
        """Puts the rig of before in force again."""
        return self._call("POST", "rig/rollback")


class Stream:
    """States as they come; a context and an iterator."""

    def __init__(self, client: Client, thruster: str, hz: float) -> None:
        try:
            from websockets.asyncio.client import connect
        except ImportError as why:
            raise ImportError("the stream needs websockets\nhint: pip install './python[stream]' in a clone of kort") from why
        parts = urlsplit(client.url)
        scheme = "wss" if parts.scheme == "https" else "ws"
        address = urlunsplit((scheme, parts.netloc, parts.path + _of(thruster, "stream"), f"hz={hz}", ""))
        headers = None if client._token is None else {"Authorization": f"Bearer {client._token}"}

        async def opened() -> ClientConnection:
            # What the library has read counts as read: a longer queue keeps old states for an iteration that paused.
            return await connect(
                address,
                additional_headers=headers,
                ssl=client._context if scheme == "wss" else None,
                open_timeout=client._timeout_s,
                max_queue=1,
            )

        with ExitStack() as opening:
            self._loop = opening.enter_context(_Loop())
            self._socket = self._loop.run(opened())
            opening.callback(lambda: self._loop.run(self._socket.close()))
            self._open = opening.pop_all()

    def __enter__(self) -> Stream:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, raised: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends it."""
        self._open.close()

    def __iter__(self) -> Iterator[State]:
        """Ends when the service closes. Raises :class:`Answer` for a setpoint that was refused."""
        from websockets.exceptions import ConnectionClosedOK

        while True:
            try:
                document = json.loads(self._loop.run(self._socket.recv()))
            except (ConnectionClosedOK, _Ended):
                return
            if "id" in document:
                yield _state(document)
            elif "status" in document:
                raise Answer(document["status"], document)

    def thrust(self, lease_id: str, thrust_n: float) -> None:
        """Commands thrust, N, under a lease."""
        self._send({"setpoint": {"thrust_n": thrust_n}, "lease_id": lease_id})

    def speed(self, lease_id: str, speed_rad_s: float) -> None:
        """Commands shaft speed, rad/s, under a lease."""
        self._send({"setpoint": {"speed_rad_s": speed_rad_s}, "lease_id": lease_id})

    def _send(self, message: Mapping[str, Any]) -> None:
        self._loop.run(self._socket.send(json.dumps(message)))


class _Ended(ConnectionError):
    """What is asked of a stream that was closed here."""


class _Loop:
    """One thread that does all reading and writing of a connection.

    One thread that reads a TLS connection while another writes tears it now and then (python/cpython issue 143756);
    ``websockets.sync`` has two.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name="kort-stream", daemon=True)

    def __enter__(self) -> _Loop:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.run(self._rest())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def run(self, work: Coroutine[Any, Any, _Result]) -> _Result:
        """Does it there, and waits for it."""
        if self._loop.is_closed():
            work.close()
            raise _Ended("the stream is closed")
        done = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return done.result()
        except BaseException:
            # Of an interrupt (Ctrl-C) nothing goes on behind our back.
            done.cancel()
            raise

    @staticmethod
    async def _rest() -> None:
        """What another thread still waits for comes to its end first."""
        others = asyncio.all_tasks() - {asyncio.current_task()}
        await asyncio.gather(*others, return_exceptions=True)


def _of(thruster: str, what: str = "") -> str:
    return f"/v1/thrusters/{quote(thruster, safe='')}" + (f"/{what}" if what else "")


def _problem(body: bytes) -> Mapping[str, Any]:
    try:
        found = json.loads(body)
    except ValueError:
        return {"detail": body.decode(errors="replace")[:200]}
    return found if isinstance(found, dict) else {"detail": str(found)}
