"""SIGTERM is treated like Ctrl-C, and no worker outlives its parent, with real processes and signals."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from caster_gym.processes import Terminated, exit_code, interruptible
from tests.kills import LONGEST, on_linux, session_of, wait_until

COMMAND = """
import time, typer
from caster_gym.agents.commands.command_line import plain_errors

def main():
    with plain_errors():
        try:
            print("working", flush=True)
            time.sleep(600.0)
        finally:
            print("saved", flush=True)

typer.run(main)
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_command_that_is_interrupted_says_so(number, code):
    with subprocess.Popen(
        [sys.executable, "-c", COMMAND], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as command:
        assert command.stdout is not None and command.stdout.readline() == "working\n"
        command.send_signal(number)
        said = "caster-gym: interrupted; what was finished is kept\n"
        assert command.communicate(timeout=LONGEST) == ("saved\n", said)
    assert command.returncode == code


WORKERS = """
import multiprocessing, time
from caster_gym.processes import end_with_parent

def work(how):
    end_with_parent()
    print("working", flush=True)
    while how == "busy":
        pass
    time.sleep(600.0)

if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    for how in ("busy", "asleep"):
        context.Process(target=work, args=(how,)).start()
"""


@on_linux
def test_a_parent_that_is_killed_leaves_no_workers(tmp_path):
    (tmp_path / "workers.py").write_text(WORKERS, encoding="utf-8")
    command = [sys.executable, str(tmp_path / "workers.py")]
    with subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE, text=True) as parent:
        try:
            assert parent.stdout is not None
            assert [parent.stdout.readline() for _ in range(2)] == 2 * ["working\n"]
            assert len(session_of(parent)) >= 3
            parent.kill()
            wait_until(lambda: session_of(parent) == [])
        finally:
            for one in session_of(parent):
                os.kill(one, signal.SIGKILL)


def test_sigterm_interrupts_once():
    """What is learned has still to be saved: a second one, as a group of processes may get it, does not stop that."""
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt) as caught, interruptible():
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
    assert exit_code(caught.value) == 143 and isinstance(caught.value, Terminated)
    with pytest.raises(KeyboardInterrupt) as caught, interruptible():
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGTERM)
    assert exit_code(caught.value) == 130 and not isinstance(caught.value, Terminated)
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before


def test_sigterm_stays_sigterm_where_a_library_makes_ctrl_c_of_it():
    """Ray does, while it waits."""
    with pytest.raises(Terminated), interruptible():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise KeyboardInterrupt from None


def test_signals_that_are_ignored_stay_ignored():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with interruptible():
            signal.raise_signal(signal.SIGTERM)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)


def test_other_threads_leave_signals_alone():
    seen = []

    def look():
        with interruptible():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGTERM)]
