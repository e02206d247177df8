"""caster_gym.engines.native.cores: what containers, schedulers and people allow a process to use."""

import os
import subprocess
import sys
import warnings

import pytest

from caster_gym.engines.native import cores
from caster_gym.engines.native.cores import default_threads, learning_threads, usable_cores


@pytest.fixture
def eight(monkeypatch):
    """A process that may run on eight cores, of which nobody has said anything."""
    monkeypatch.setattr(cores, "_affinity", lambda: 8)
    for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)


def unified(root, path, limits):
    """Control groups of version 2 in a file system: the process's own, and the cpu.max of some groups."""
    (root / "proc/self").mkdir(parents=True)
    (root / "proc/self/cgroup").write_text(f"0::{path}\n")
    for group, text in limits.items():
        folder = root / "sys/fs/cgroup" / group
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cpu.max").write_text(text)
    return root


def test_without_control_groups_the_affinity_counts(eight, tmp_path):
    assert usable_cores(tmp_path) == 8


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("max 100000\n", 8),
        ("100000 100000\n", 1),
        ("150000 100000\n", 2),  # one core could not use up one and a half
        ("20000 100000\n", 1),
        ("6400000 100000\n", 8),
        ("nonsense\n", 8),
        ("100000 0\n", 8),
    ],
)
def test_a_container_of_version_2(eight, tmp_path, text, count):
    assert usable_cores(unified(tmp_path, "/", {"": text})) == count


def test_the_tightest_group_on_the_way_up_decides(eight, tmp_path):
    """As in a pod: the container may use four cores, the pod around it three."""
    limits = {"kube": "max 100000\n", "kube/pod": "300000 100000\n", "kube/pod/box": "400000 100000\n"}
    assert usable_cores(unified(tmp_path, "/kube/pod/box", limits)) == 3


@pytest.mark.parametrize("path", ["/docker/0123", "/"])
@pytest.mark.parametrize("mount", ["cpu,cpuacct", "cpu"])
def test_a_container_of_version_1(eight, tmp_path, path, mount):
    """Its path is often that of the host, which the container does not see: the group is then the root."""
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text(f"12:devices:/x\n4:cpu,cpuacct:{path}\n1:name=systemd:/\n")
    folder = tmp_path / "sys/fs/cgroup" / mount
    folder.mkdir(parents=True)
    (folder / "cpu.cfs_period_us").write_text("50000\n")
    (folder / "cpu.cfs_quota_us").write_text("-1\n")
    assert usable_cores(tmp_path) == 8
    (folder / "cpu.cfs_quota_us").write_text("100000\n")
    assert usable_cores(tmp_path) == 2


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinities")
def test_a_process_bound_to_one_core_uses_one_thread():
    """As a scheduler binds it, before or after it starts."""
    code = "import os; from caster_gym.engines.native.threads import get_threads; {} print(get_threads())"
    bind = f"os.sched_setaffinity(0, {{{min(os.sched_getaffinity(0))}}});"
    names = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "PYTHON_CPU_COUNT")
    free = {name: value for name, value in os.environ.items() if name not in names}
    done = subprocess.run([sys.executable, "-c", code.format(bind)], env=free, check=True, capture_output=True)
    assert done.stdout.strip() == b"1"


@pytest.mark.parametrize(
    ("numba", "openmp", "count"),
    [
        (None, None, 8),
        (None, "1", 1),
        (None, " 4 ", 4),
        (None, "4,2", 4),
        (None, "64", 8),
        ("3", None, 3),
        ("3", "1", 3),
        ("16", None, 16),  # meant for compiled code alone, so somebody wants it
        ("", "", 8),
    ],
)
def test_the_environment_chooses_the_number_of_threads(eight, tmp_path, monkeypatch, numba, openmp, count):
    for name, value in (("NUMBA_NUM_THREADS", numba), ("OMP_NUM_THREADS", openmp)):
        if value is not None:
            monkeypatch.setenv(name, value)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert default_threads(tmp_path) == count


@pytest.mark.parametrize("name", ["NUMBA_NUM_THREADS", "OMP_NUM_THREADS"])
@pytest.mark.parametrize("value", ["abc", "0", "-2", "2.5", ",2", "²"])
def test_what_is_no_number_of_threads_is_ignored_aloud(eight, tmp_path, monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    with pytest.warns(RuntimeWarning, match=rf"{name} must be a number of threads such as 4, got '{value}'.* 8 may be"):
        assert default_threads(tmp_path) == 8


def test_a_quota_comes_before_openmp(eight, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    assert default_threads(unified(tmp_path, "/", {"": "200000 100000\n"})) == 2


@pytest.mark.parametrize(("openmp", "count"), [(None, 1), ("1", 1), ("3", 3), ("4,2", 4), ("", 1)])
def test_learning_takes_one_thread_unless_the_environment_says_otherwise(eight, monkeypatch, openmp, count):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if openmp is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", openmp)
    assert learning_threads() == count
