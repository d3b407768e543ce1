"""Long calls: progress, interruption, the interpreter's lock, warnings."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import cube

import radiosity as rd


def blocks(n: int, subdivide: int) -> rd.Model:
    """A room full of blocks, whose form factors take a while."""
    vertices, faces = [], []
    inside = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [1, 5, 7, 3], [3, 7, 6, 2], [2, 6, 4, 0]]
    boxes = [((-1.0, -1.0, -1.0), (n + 1.0, n + 1.0, n + 1.0), True)]
    for k in range(n**3):
        x, y, z = k % n, k // n % n, k // n**2
        boxes.append(((x + 0.3, y + 0.25, z + 0.2), (x + 0.8, y + 0.7, z + 0.75), False))
    for low, high, is_room in boxes:
        at = len(vertices)
        vertices += [[(low, high)[i][0], (low, high)[j][1], (low, high)[m][2]] for m in (0, 1) for j in (0, 1) for i in (0, 1)]
        faces += [[at + c for c in (face if is_room else face[::-1])] for face in inside]
    return rd.Model(vertices, faces, surfaces=["all"] * len(faces), subdivide=subdivide)


def test_progress_is_told() -> None:
    told: list[tuple[str, int, int]] = []
    blocks(2, 2).form_factors(progress=lambda stage, done, total: told.append((stage, done, total)))
    assert told, "a call of more than a beat tells its progress"
    assert all(isinstance(stage, str) and done >= 0 and total >= 0 for stage, done, total in told)


def test_errors_of_the_callback_end_the_call() -> None:
    class Enough(Exception):
        pass

    def stop(stage: str, done: int, total: int) -> None:
        raise Enough

    with pytest.raises(Enough):
        blocks(3, 4).form_factors(tolerance=1e-9, progress=stop)


def test_other_threads_go_on() -> None:
    counted = 0
    ended = threading.Event()

    def count() -> None:
        nonlocal counted
        while not ended.wait(0.005):
            counted += 1

    thread = threading.Thread(target=count)
    thread.start()
    begun = time.monotonic()
    blocks(2, 2).form_factors()
    seconds = time.monotonic() - begun
    ended.set()
    thread.join()
    assert seconds > 0.1 and counted > 5


def test_two_threads_use_one_model() -> None:
    model = cube(subdivide=3, exitance=1.0)
    ff = model.form_factors()
    found: list[np.ndarray] = []  # type: ignore[type-arg]
    threads = [threading.Thread(target=lambda: found.append(model.solve(ff).radiosity)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


SLOW = """
import sys
sys.path.insert(0, sys.argv[1])
from test_calls import blocks
model = blocks(3, 6)
print("ready", flush=True)
try:
    model.form_factors(tolerance=1e-12)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(7)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_a_long_call() -> None:
    folder = __file__.rpartition("/")[0]
    # A shell starts background jobs with SIGINT ignored, and Python then leaves it so.
    child = subprocess.Popen(
        [sys.executable, "-c", SLOW, folder],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.5)
        begun = time.monotonic()
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=30) == 7
        assert child.stdout.read() == "interrupted\n"
        assert time.monotonic() - begun < 10.0
    finally:
        child.kill()


def test_a_bar_is_shown_where_it_is_wanted(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radiosity._progress.QUICK", 0.0)
    blocks(2, 2).form_factors(progress=True)
    shown = capfd.readouterr().err
    assert "form" in shown and "\r" in shown
    cube().form_factors(progress=False)
    assert capfd.readouterr().err == ""


def test_warnings_may_be_errors() -> None:
    model = cube(subdivide=2, reflectance=0.99, exitance={"ceiling": 1.0, "*": 0.0})
    with pytest.raises(rd.RadiosityWarning, match="pass"):
        model.solve(solver="jacobi", max_passes=2)
