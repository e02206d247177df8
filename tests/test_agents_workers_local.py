"""caster_gym.agents.workers.local: every call ends once, whoever is killed, and nobody outlives its parent."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from caster_gym.agents.workers.calls import ATTEMPTS, Call, Finished, Reported
from caster_gym.agents.workers.local import LocalWorkers

PATIENCE = 60.0  # [s] for what takes a fraction of one on a machine at rest


def double(number, report):
    report(f"doubling {number}")
    return 2 * number


def process(report):
    return os.getpid()


def fail(report):
    raise ValueError("there is nothing to do")


class OddError(Exception):
    """An error that cannot be made of its message."""

    def __init__(self, first, second):
        super().__init__(f"{first} and {second}")


def fail_oddly(report):
    raise OddError("one", "two")


def die(folder, times, report):
    """Is killed so many times before it is done."""
    begun = len(list(folder.iterdir()))
    (folder / str(begun)).touch()
    if begun < times:
        os.kill(os.getpid(), signal.SIGKILL)
    return begun


def linger(folder, name, report):
    """Runs until it is interrupted, and then leaves a file."""
    try:
        (folder / f"{name} began").touch()
        report("begun")
        while True:
            signal.pause()
    except KeyboardInterrupt:
        (folder / f"{name} kept").touch()
        raise


@pytest.fixture(scope="module")
def heard():
    """Two processes that work off five calls, of which two are submitted when the first ones are finished."""
    events, added = [], iter([3, 4])
    with LocalWorkers(2) as workers:
        numbers = [workers.submit(Call(f"{i}", double, (i,))) for i in range(3)]
        for event in workers.events():
            events.append(event)
            if isinstance(event, Finished) and (more := next(added, None)):
                numbers.append(workers.submit(Call(f"{more}", double, (more,))))
    return numbers, events


def test_every_call_reports_and_ends_once(heard):
    numbers, events = heard
    assert numbers == [0, 1, 2, 3, 4]
    assert sorted(event for event in events if isinstance(event, Finished)) == [Finished(i, 2 * i) for i in range(5)]
    reports = [event for event in events if isinstance(event, Reported)]
    assert sorted(reports) == [Reported(i, f"doubling {i}") for i in range(5)]


def test_a_call_reports_before_it_ends(heard):
    events = heard[1]
    for i in range(5):
        kinds = [type(event) for event in events if event.number == i]
        assert kinds == [Reported, Finished]


def test_processes_are_used_again_and_gone_afterwards():
    with LocalWorkers(1) as workers:
        for _ in range(3):
            workers.submit(Call("process", process, ()))
        pids = {event.result for event in workers.events() if isinstance(event, Finished)}
    (pid,) = pids
    assert pid != os.getpid()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


def test_nothing_to_do_is_no_work():
    with LocalWorkers(2) as workers:
        assert list(workers.events()) == []


def test_errors_name_the_call_and_the_line():
    with pytest.raises(ValueError, match=r"^ppo seed 3: there is nothing to do$") as caught, LocalWorkers(1) as workers:
        workers.submit(Call("ppo seed 3", fail, ()))
        list(workers.events())
    assert caught.type is ValueError
    with pytest.raises(RuntimeError, match="OddError: one and two") as odd, LocalWorkers(1) as workers:
        workers.submit(Call("ppo seed 4", fail_oddly, ()))
        list(workers.events())
    assert "in fail_oddly" in odd.value.__notes__[0]
    assert odd.value.__notes__[1] == "in ppo seed 4"


def test_the_call_of_a_killed_process_is_taken_up_by_another(tmp_path):
    with LocalWorkers(1) as workers:
        workers.submit(Call("killed twice", die, (tmp_path, 2)))
        workers.submit(Call("after it", double, (4,)))
        ended = [event for event in workers.events() if isinstance(event, Finished)]
    assert ended == [Finished(0, 2), Finished(1, 8)]


def test_a_call_that_is_always_killed_is_given_up(tmp_path):
    given_up = pytest.raises(ChildProcessError, match=r"mine: its process has ended 5 times .* with exit code -9")
    with given_up, LocalWorkers(1) as workers:
        workers.submit(Call("mine", die, (tmp_path, 100)))
        list(workers.events())
    assert len(list(tmp_path.iterdir())) == ATTEMPTS


def test_running_calls_are_interrupted_once_and_keep_what_they_have(tmp_path):
    """Whatever goes wrong meanwhile; one that waits is not begun."""
    with pytest.raises(ValueError, match="enough"), LocalWorkers(2) as workers:
        for name in ("a", "b", "c"):
            workers.submit(Call(name, linger, (tmp_path, name)))
        for begun, _ in enumerate(workers.events()):
            if begun == 1:
                raise ValueError("enough")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a began", "a kept", "b began", "b kept"]


def end_otherwise(how, report):
    """Makes something else of an interrupt, as where nothing can be saved any more."""
    report("begun")
    try:
        while True:
            signal.pause()
    except KeyboardInterrupt:
        if how == "error":
            raise OSError("no space left") from None
        return how


STUBBORN = """
import sys
from tests.test_agents_workers_local import Call, LocalWorkers, end_otherwise
if __name__ == "__main__":
    with LocalWorkers(1) as workers:
        workers.submit(Call("a", end_otherwise, (sys.argv[1],)))
        for event in workers.events():
            raise ValueError("enough")
"""


@pytest.mark.parametrize("how", ["error", "result"])
def test_calls_that_make_something_else_of_an_interrupt_end_too(tmp_path, how):
    script = tmp_path / "stubborn.py"
    script.write_text(STUBBORN, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    ended = subprocess.run(
        [sys.executable, script, how], env=environment, capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert ended.stderr.splitlines()[-1] == "ValueError: enough"


PARENT = """
import sys
from pathlib import Path
from tests.test_agents_workers_local import Call, LocalWorkers, linger
if __name__ == "__main__":
    with LocalWorkers(2) as workers:
        for name in "ab":
            workers.submit(Call(name, linger, (Path(sys.argv[1]), name)))
        for event in workers.events():
            print(event.content, flush=True)
"""


@pytest.fixture
def parent(tmp_path):
    """A process whose two workers are busy."""
    script, folder = tmp_path / "parent.py", tmp_path / "left"
    script.write_text(PARENT, encoding="utf-8")
    folder.mkdir()
    begun = subprocess.Popen(
        [sys.executable, script, folder],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    with begun:
        assert begun.stdout is not None
        assert [begun.stdout.readline() for _ in "ab"] == [b"begun\n"] * 2
        yield begun
        begun.kill()


def test_children_of_a_killed_process_end(parent):
    """Its output ends when the last of those has ended to which it has left it."""
    parent.kill()
    assert parent.communicate(timeout=PATIENCE) == (b"", None)


def test_ctrl_c_at_a_terminal_interrupts_each_call_once(parent, tmp_path):
    """A terminal sends it to all processes."""
    os.killpg(parent.pid, signal.SIGINT)
    assert parent.communicate(timeout=PATIENCE) == (b"", None)
    assert sorted(one.name for one in (tmp_path / "left").glob("*kept")) == ["a kept", "b kept"]
