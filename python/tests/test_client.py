"""The client against a living service."""

import signal
import socket
import ssl
import subprocess
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import kort
import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def client(kort_program: str) -> Iterator[kort.Client]:
    # Not pytest's own folder: shared memory wants a short path.
    with tempfile.TemporaryDirectory(prefix="kort-") as folder:
        yield from service_in(Path(folder), kort_program)


@pytest.fixture(scope="module")
def secured(kort_program: str) -> Iterator[tuple[kort.Client, Path]]:
    """A service that wants TLS and a token, and its folder."""
    with tempfile.TemporaryDirectory(prefix="kort-") as name:
        folder = Path(name)
        for client in service_in(folder, kort_program, secure=True):
            yield client, folder


def service_in(folder: Path, kort_program: str, *, secure: bool = False) -> Iterator[kort.Client]:
    """A service on the simulated stand, until the tests are done with it."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    (folder / "kort.toml").write_text(
        f'[gateway]\nbind = "127.0.0.1:{port}"\nrecordings = "recordings"\nevents = "events"\ntokens = "tokens.toml"\n'
        + ('require_tokens = true\ntls = { certificate = "cert.pem", key = "key.pem", self_signed = true }\n' if secure else "")
        + f'[thrusters.t1]\nrig = "{ROOT}/config/thrusters/whitcomb-yoerger-1999.toml"\namplifier = "simulated"\n'
        'servo = { rate_hz = 500 }\ncontroller = { rate_hz = 10, law = "velocity_servo" }\n'
    )
    token = made_token(kort_program, folder, "bench", "pilot") if secure else None
    arguments = [kort_program, "up", "--config", str(folder / "kort.toml"), "--root", str(folder / "shm")]
    with open(folder / "log", "wb") as log:
        service = subprocess.Popen(arguments, cwd=folder, stdout=log, stderr=log)
    context = None
    try:
        if secure:
            wait((folder / "cert.pem").exists, (folder / "log").read_text)
            context = ssl.create_default_context(cafile=folder / "cert.pem")
        client = kort.Client(f"{'https' if secure else 'http'}://127.0.0.1:{port}", token=token, context=context)
        wait(lambda: client.state("t1").controller is not None, (folder / "log").read_text)
        yield client
    finally:
        service.send_signal(signal.SIGINT)
        try:
            service.wait(30)
        except subprocess.TimeoutExpired:
            service.kill()
            raise


def made_token(kort_program: str, folder: Path, name: str, role: str) -> str:
    """A token as an operator makes one: it is printed once."""
    command = [kort_program, "token", "new", name, "--role", role, "--config", str(folder / "kort.toml")]
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.split()[-1]


def wait(done: object, said: object = str) -> None:
    """Until something is so, for half a minute of a busy machine."""
    assert callable(done) and callable(said)
    end = time.monotonic() + 30.0
    while True:
        try:
            if done():
                return
        except OSError:
            pass
        except kort.Answer as refused:
            if refused.status < 500:
                raise
        assert time.monotonic() < end, said()
        time.sleep(0.05)


def test_command_record_and_read_back(client: kort.Client) -> None:
    name = client.record("t1", "bench", rate_hz=100, tags=["dry"])
    client.tag(name, ["bollard", "dry"])
    assert [one["name"] for one in client.recordings("bollard")] == [name] and client.recordings("tow") == []
    with client.command("t1", "test", ttl_ms=60_000) as command:
        command.arm()
        wait(lambda: client.state("t1").armed)
        command.thrust(60.0)
        wait(lambda: (client.state("t1").measured["thrust_n"] or 0.0) > 40.0)
        assert client.state("t1").setpoint == kort.Setpoint(thrust_n=60.0)
        with pytest.raises(kort.Answer) as refused:
            client.command("t1", "another")
        assert refused.value.status == 409 and "test" in str(refused.value)
        tuned = client.controller_file("t1").replace("phase_margin_deg = 56.0", "phase_margin_deg = 61.0")
        assert "law = \"velocity_servo\"" in tuned and "61.0" in tuned
        command.load_controller(tuned)
        wait(lambda: client.controller_file("t1").split("\n", 1)[1] == tuned.split("\n", 1)[1])
        command.disarm()
    client.end_recording(name)
    recording = client.recording(name)
    assert recording["thrust_n"].max() > 40.0 and "[propeller]" in recording.about["rig"]
    assert client.state("t1").lease is None


def test_the_service_fits_what_it_drove(client: kort.Client) -> None:
    with client.command("t1", "test", ttl_ms=60_000) as command:
        command.arm()
        wait(lambda: client.state("t1").armed)
        for thrust_n in (60.0, -60.0, 100.0, 20.0, -80.0, 40.0):
            command.thrust(thrust_n)
            time.sleep(1.2)
        command.disarm()
    started, fit = client.fit("t1", last_s=60.0, timeout_s=300.0)
    assert started.startswith("t1-") and fit.schema == "kort.fit/1" and fit.channels["shaft_speed_rad_s"]
    assert "[propeller]" in fit.rig_toml and fit.document["model"] == fit.model


def test_the_stream_gives_states(client: kort.Client) -> None:
    with client.stream("t1", hz=20) as stream:
        states = [state for state, _ in zip(stream, range(3))]
    assert len(states) == 3 and states[0].time_s < states[2].time_s and states[0].id == "t1"


def test_an_iteration_that_paused_goes_on_with_what_is(client: kort.Client) -> None:
    with client.stream("t1", hz=10) as stream:
        states = iter(stream)
        next(states)
        time.sleep(2.5)
        times = [next(states).time_s]
        while len(times) < 2 or times[-1] - times[-2] < 0.3:
            times.append(next(states).time_s)
    assert times[-2] - times[0] < 0.6, times


def test_a_closed_stream_has_ended(client: kort.Client) -> None:
    stream = client.stream("t1", hz=20)
    states = iter(stream)
    next(states)
    with ThreadPoolExecutor(1) as reader:
        rest = reader.submit(lambda: list(states))
        time.sleep(0.2)
        stream.close()
        assert all(state.id == "t1" for state in rest.result(timeout=10))
    assert list(stream) == []
    with pytest.raises(ConnectionError, match="closed"):
        stream.thrust("nobody", 10.0)
    stream.close()


def test_a_refusal_is_the_problem_document(client: kort.Client) -> None:
    with pytest.raises(kort.Answer) as refused:
        client.state("t9")
    assert refused.value.status == 404 and "t9" in str(refused.value)
    assert [state.id for state in client.thrusters()] == ["t1"]


def test_nobody_there_is_an_oserror() -> None:
    with pytest.raises(OSError):
        kort.Client("http://127.0.0.1:9").thrusters()


def test_tls_and_a_token(secured: tuple[kort.Client, Path], kort_program: str) -> None:
    client, folder = secured
    with client.command("t1", "test", ttl_ms=60_000) as command:
        command.arm()
        wait(lambda: client.state("t1").armed)
        command.thrust(30.0)
        with client.stream("t1", hz=20) as stream:
            assert next(iter(stream)).setpoint == kort.Setpoint(thrust_n=30.0)
        # One thread reads while another commands.
        with client.stream("t1", hz=50) as stream, ThreadPoolExecutor(1) as pilot:
            sent = pilot.submit(lambda: [stream.thrust(command.lease_id, float(n)) for n in range(50)])
            assert len([state for state, _ in zip(stream, range(50))]) == 50
            sent.result()
            assert any(state.setpoint == kort.Setpoint(thrust_n=49.0) for state, _ in zip(stream, range(50)))
        command.disarm()
    trusted = client._context
    with pytest.raises(kort.Answer) as nobody:
        kort.Client(client.url, context=trusted).thrusters()
    assert nobody.value.status == 401 and "token" in str(nobody.value)
    with pytest.raises(kort.Answer) as wrong:
        kort.Client(client.url, token="wrong", context=trusted).thrusters()
    assert wrong.value.status == 401
    viewer = kort.Client(client.url, token=made_token(kort_program, folder, "wall", "viewer"), context=trusted)
    assert [state.id for state in viewer.thrusters()] == ["t1"]
    with pytest.raises(kort.Answer) as refused:
        viewer.command("t1", "wall")
    assert refused.value.status == 403 and "viewer" in str(refused.value)
    # A certificate that nobody vouches for is not talked to.
    with pytest.raises(OSError, match="CERTIFICATE_VERIFY_FAILED"):
        kort.Client(client.url, token="any").thrusters()


def test_events_and_stop(client: kort.Client) -> None:
    client.stop()
    assert "stop" in str(client.events()).lower()


def test_paths_are_of_the_thruster(tmp_path: Path) -> None:
    assert "%2F" in kort.client._of("a/b")
