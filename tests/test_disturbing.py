"""scripts.disturbing: real processes are killed, and writes fail, and nothing is lost."""

import errno
import random
import shutil
import sys

import pytest

from scripts import disturbing
from scripts.disturbing import (
    Work,
    build_library,
    content_of,
    differing,
    fail_a_write,
    kill,
    run_undisturbed,
    write_settings,
)


def test_only_columns_that_tell_the_time_are_left_out(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    (run / "validation.csv").write_text("steps,seconds,failures\n1,0.5,2\n", encoding="utf-8")
    (run / "run.yaml").write_text("seed: 1\n", encoding="utf-8")
    (run / "weights.safetensors").write_bytes(b"\x00\x01")
    content = content_of(run)
    assert content == {"validation.csv": b"1,2\r\n", "weights.safetensors": b"\x00\x01"}
    work = Work("train", (), 1.0, content)
    assert differing(work, tmp_path) == []
    (run / "weights.safetensors").write_bytes(b"\x00\x02")
    (run / "more.csv").write_text("", encoding="utf-8")
    assert differing(work, tmp_path) == ["weights.safetensors", "more.csv"]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked for as Linux has them")
def test_a_training_that_is_disturbed_ends_as_one_that_is_not(tmp_path, monkeypatch):
    """Killed somewhere, then with a full disk, then with a broken one, where a C compiler is there."""
    monkeypatch.setitem(disturbing.AGENTS, "shac", {**disturbing.AGENTS["shac"], "n_timesteps": 320})
    commands = write_settings(tmp_path)
    work = run_undisturbed("train shac", commands["train shac"], tmp_path)
    assert kill(work, tmp_path, 0.8 * work.seconds) is not None
    library = build_library(tmp_path)
    if library is not None:
        number = random.Random(0)
        for error in (errno.ENOSPC, errno.EIO):
            met = fail_a_write(work, tmp_path, library, number.randrange(1, 40), error)
            assert met is None or met.how == errno.errorcode[error]
    assert kill(work, tmp_path, 600.0) is None
    assert differing(work, tmp_path) == []
    shutil.rmtree(tmp_path / "run")
