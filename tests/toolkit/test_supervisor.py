"""Ctrl-C, signals and kills at any moment: the exit code, and that nothing is left behind."""

import os
import signal
import subprocess
import sys
import time
from importlib.machinery import ExtensionFileLoader
from pathlib import Path

import pytest
import trimesh
from autophyx_tet.toolkit.asset.guard import on_interrupt

SOON = 2.0  # s that a command may take to end, where no other waits for a core
# Commands that begin to write a file and then do not hear: every interrupt is swallowed, or the
# interpreter is kept by native code; or that end by a signal, or by an exit code.
COMMANDS = {
    "swallows": "while True:\n  try: time.sleep(60)\n  except KeyboardInterrupt: pass",
    "deaf": "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}); time.sleep(60)",
    "hears": "time.sleep(60)",
    "crashes": "os.kill(os.getpid(), signal.SIGSEGV)",
    "ends": "raise SystemExit(5)",
}
FAKE = """
import os, signal, sys, tempfile, time
from pathlib import Path
from autophyx_tet.converters.files import alone, writing
from autophyx_tet.toolkit.cli import main, supervisor

def command():
    work = tempfile.mkdtemp()
    with alone("made/out"), writing("out.msh") as unfinished:
        unfinished.write_text("half")
        Path("ready").touch()
        {body}
main.main = command
sys.exit(supervisor.main())
"""
REAL = """
import sys
from autophyx_tet.toolkit.cli import supervisor
sys.argv[1:] = {arguments}
sys.exit(supervisor.main())
"""


def started(code, folder, **more):
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | {"TMPDIR": str(temporary)},
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **more,
    )


def fake(kind, folder):
    body = COMMANDS[kind].replace("\n", "\n        ")
    process = started(FAKE.format(body=body), folder)
    while not (folder / "ready").exists():
        time.sleep(0.01)
    return process


def ended(process):
    crowd = max(1.0, os.getloadavg()[0] / os.cpu_count())  # a busy machine is no error
    began = time.monotonic()
    _, err = process.communicate(timeout=30)
    assert time.monotonic() - began < SOON * crowd, err
    return process.returncode, err


def nothing_left(folder):
    """Nothing but what the test itself has made."""
    left = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
    assert left <= {"tmp", "ready", "box.obj"}, left


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["swallows", "deaf", "hears"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_ends_within_two_seconds_of_a_signal(tmp_path, kind, number):
    """Exit 130 of Ctrl-C, 143 of SIGTERM, one line, and no file, folder or process is left."""
    process = fake(kind, tmp_path)
    process.send_signal(number)
    code, err = ended(process)
    assert code == 128 + number
    assert err == "autophyx-tet: interrupted; nothing half-written was left\n"
    nothing_left(tmp_path)


@pytest.mark.slow
def test_other_ends_are_told_as_they_are(tmp_path):
    """A crash of native code: one line that names the signal; an exit code: itself."""
    code, err = ended(fake("crashes", tmp_path))
    assert (code, err.count("\n")) == (128 + signal.SIGSEGV, 1)
    assert "SIGSEGV" in err
    nothing_left(tmp_path)
    assert ended(fake("ends", tmp_path)) == (5, "")
    nothing_left(tmp_path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_words_that_cannot_be_written_are_no_success(tmp_path, monkeypatch):
    """A full disk takes what was printed only at the end: one line and exit code 3."""
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    code = REAL.format(arguments=["--version"])
    with open("/dev/full", "w") as full:
        process = started(code, tmp_path, stdout=full)
        assert process.wait() == 3
    assert process.stderr.read().count("could not be written") == 1


def test_a_killed_command_leaves_nothing(tmp_path):
    """SIGKILL to the command itself, by hand or for memory: 137, one line, no file, no folder."""
    process = fake("hears", tmp_path)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(int(children[0]), signal.SIGKILL)
    code, err = ended(process)
    assert (len(children), code, err.count("\n")) == (1, 128 + signal.SIGKILL, 1)
    assert "SIGKILL" in err
    nothing_left(tmp_path)


@pytest.mark.slow
def test_what_a_killed_supervisor_leaves_the_next_one_removes(tmp_path):
    """SIGKILL to the supervisor: the command dies too; its files go with the next command's."""
    process = fake("hears", tmp_path)
    process.kill()
    process.communicate()
    (folder,) = (tmp_path / "tmp").iterdir()
    os.utime(folder, (time.time() - 3600,) * 2)
    assert list(tmp_path.glob(".tmp-*"))
    assert ended(fake("ends", tmp_path)) == (5, "")
    nothing_left(tmp_path)


@pytest.mark.slow
def test_a_folder_in_use_stays(tmp_path):
    """An old folder of a command that still works is locked: others leave it alone."""
    process = fake("hears", tmp_path)
    (folder,) = (tmp_path / "tmp").iterdir()
    os.utime(folder, (time.time() - 3600,) * 2)
    ended(fake("ends", tmp_path))
    assert folder.exists()
    process.send_signal(signal.SIGINT)
    assert ended(process)[0] == 130
    nothing_left(tmp_path)


@pytest.mark.slow
def test_what_is_to_be_ignored_is_ignored(tmp_path):
    """Under nohup the end of the terminal ends nothing."""
    code = "import signal\nsignal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
    process = started(code + FAKE.format(body="time.sleep(1)"), tmp_path)
    while not (tmp_path / "ready").exists():
        time.sleep(0.01)
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=30)
    assert "interrupted" not in err
    assert (tmp_path / "out.msh").read_text() == "half"


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.15, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0])
def test_ctrl_c_at_ten_moments_of_a_real_run(tmp_path, seconds):
    """Start-up, import, tetrahedraliser, solver, pictures: exit 130 within 2 s, no trace, no file.

    The body is large enough that the run is still at work at the last moment.
    """
    trimesh.creation.icosphere(4).export(tmp_path / "box.obj")
    options = ["--text", "steel", "--edge-length-rel", "0.03", "--no-cache", "-o", "out"]
    process = started(REAL.format(arguments=["run", "box.obj", *options]), tmp_path)
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    code, err = ended(process)
    if code != -signal.SIGINT:  # before Python has come to our first line; 130 to a shell
        assert code == 130, err
        assert err == "autophyx-tet: interrupted; nothing half-written was left\n"
    nothing_left(tmp_path)


def test_an_interrupt_waits_for_the_loading_of_machine_code():
    """Some extensions end the process where Python raises while they are loaded."""

    class Slow(ExtensionFileLoader):
        def exec_module(self, module):
            time.sleep(0.01)
            signal.raise_signal(signal.SIGINT)
            self.loaded = True

    loader, before = Slow("slow", "slow.so"), signal.signal(signal.SIGINT, on_interrupt)
    try:
        loader.exec_module(None)
        with pytest.raises(KeyboardInterrupt):
            time.sleep(5.0)
    finally:
        signal.signal(signal.SIGINT, before)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert loader.loaded
