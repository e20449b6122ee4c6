"""The client against a living service."""

import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import kort
import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def client(kort_program: str) -> Iterator[kort.Client]:
    # Not pytest's own folder: shared memory wants a short path.
    with tempfile.TemporaryDirectory(prefix="kort-") as folder:
        yield from service_in(Path(folder), kort_program)


def service_in(folder: Path, kort_program: str) -> Iterator[kort.Client]:
    """A service on the simulated stand, until the tests are done with it."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    (folder / "kort.toml").write_text(
        f'[gateway]\nbind = "127.0.0.1:{port}"\nrecordings = "recordings"\nevents = "events"\ntokens = "tokens.toml"\n'
        f'[thrusters.t1]\nrig = "{ROOT}/config/thrusters/whitcomb-yoerger-1999.toml"\namplifier = "simulated"\n'
        'servo = { rate_hz = 500 }\ncontroller = { rate_hz = 10, law = "velocity_servo" }\n'
    )
    arguments = [kort_program, "up", "--config", str(folder / "kort.toml"), "--root", str(folder / "shm")]
    with open(folder / "log", "wb") as log:
        service = subprocess.Popen(arguments, cwd=folder, stdout=log, stderr=log)
    client = kort.Client(f"http://127.0.0.1:{port}")
    try:
        wait(lambda: client.state("t1").controller is not None, (folder / "log").read_text)
        yield client
    finally:
        service.send_signal(signal.SIGINT)
        try:
            service.wait(30)
        except subprocess.TimeoutExpired:
            service.kill()
            raise


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
    name = client.record("t1", "bench", rate_hz=100)
    with client.command("t1", "test", ttl_ms=60_000) as command:
        command.arm()
        wait(lambda: client.state("t1").armed)
        command.thrust(60.0)
        wait(lambda: (client.state("t1").measured["thrust_n"] or 0.0) > 40.0)
        assert client.state("t1").setpoint == kort.Setpoint(thrust_n=60.0)
        with pytest.raises(kort.Answer) as refused:
            client.command("t1", "another")
        assert refused.value.status == 409 and "test" in str(refused.value)
        command.disarm()
    client.end_recording(name)
    recording = client.recording(name)
    assert recording["thrust_n"].max() > 40.0 and "[propeller]" in recording.about["rig"]
    assert client.state("t1").lease is None


def test_the_stream_gives_states(client: kort.Client) -> None:
    with client.stream("t1", hz=20) as stream:
        states = [state for state, _ in zip(stream, range(3))]
    assert len(states) == 3 and states[0].time_s < states[2].time_s and states[0].id == "t1"


def test_a_refusal_is_the_problem_document(client: kort.Client) -> None:
    with pytest.raises(kort.Answer) as refused:
        client.state("t9")
    assert refused.value.status == 404 and "t9" in str(refused.value)
    assert [state.id for state in client.thrusters()] == ["t1"]


def test_nobody_there_is_an_oserror() -> None:
    with pytest.raises(OSError):
        kort.Client("http://127.0.0.1:9").thrusters()


def test_events_and_stop(client: kort.Client) -> None:
    client.stop()
    assert "stop" in str(client.events()).lower()


def test_paths_are_of_the_thruster(tmp_path: Path) -> None:
    assert "%2F" in kort.client._of("a/b")
