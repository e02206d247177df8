"""scripts.fuzz_files: mutated files become objects or sentences, and a fault is told where there is one."""

import os
from random import Random

import pytest
import torch
from safetensors.torch import save

from scripts.fuzz_files import tallies
from scripts.fuzzing.formats import formats
from scripts.fuzzing.mutators import mutate_bytes, mutate_json, mutate_table, mutate_weights, mutate_yaml
from scripts.fuzzing.page import page
from scripts.fuzzing.trials import OBJECT, SENTENCE, Events, Tally, by_format, outcome_of

INPUTS = 3000  # some seconds
SEED = 1


@pytest.fixture(scope="module")
def total():
    """What became of the inputs, in a process of their own, which alone is listened to."""
    found = Tally()
    for _, tally in tallies(SEED, [range(INPUTS)], workers=1):
        found.add(tally)
    return found


def test_mutated_files_become_objects_or_sentences_and_run_nothing(total):
    assert [fault[1:] for fault in total.faults] == []
    assert sum(total.counts.values()) == INPUTS


def test_all_formats_are_tried_and_most_become_either(total, tmp_path):
    found = by_format(total.counts)
    assert set(found) == set(formats(tmp_path))
    assert all(outcomes[SENTENCE] for outcomes in found.values())
    assert sum(outcomes[OBJECT] > 0 for outcomes in found.values()) >= 12


def test_the_page_counts_what_became_of_the_inputs(total):
    text = page(total, SEED, 60.0, 1)
    objects = sum(count for (_, outcome), count in total.counts.items() if outcome == OBJECT)
    assert f"| **all** | **{objects:,}** |" in text
    assert f"`python -m scripts.fuzz_files --inputs {INPUTS} --seed {SEED}`" in text


def _raise(error):
    raise error


@pytest.mark.parametrize(
    ("fault", "outcome"),
    [
        (lambda path: _raise(TypeError("no")), "other exception"),
        (lambda path: _raise(ValueError("")), "unclear sentence"),
        (lambda path: _raise(ValueError("something is wrong")), "unclear sentence"),
        (lambda path: _raise(ValueError(f"{path}: {'x' * 5000}")), "unclear sentence"),
        (lambda path: _raise(ValueError(f"{path}: wrong")), SENTENCE),
        (lambda path: None, OBJECT),
    ],
)
def test_outcomes_are_told_apart(tmp_path, fault, outcome):
    assert outcome_of(fault, tmp_path / "mutant.yaml")[0] == outcome


@pytest.mark.parametrize(
    ("event", "arguments", "heard"),
    [
        ("exec", (), True),
        ("subprocess.Popen", (), True),
        ("open", ("a", "w", os.O_WRONLY | os.O_CREAT), True),
        ("open", ("a", "r", os.O_RDONLY | os.O_CLOEXEC), False),
        ("import", ("json",), False),
    ],
)
def test_events_that_run_or_write_something_are_heard_while_a_file_is_read(event, arguments, heard):
    events = Events()
    events.hear(event, arguments)
    assert not events.heard
    events.listens = True
    events.hear(event, arguments)
    assert bool(events.heard) == heard


@pytest.mark.parametrize(
    ("mutate", "content"),
    [
        (mutate_bytes, b"shape: circle"),
        (mutate_yaml, b"shape: circle\nlaps: 2\ncentre: [1.0, 2.0]\n"),
        (mutate_json, b'{"samples": [{"t": 0, "x": 1}]}'),
        (mutate_table, b"x,y\n1,2\n3,4\n"),
        (mutate_weights, save({"a": torch.zeros(2, 3)})),
    ],
)
def test_mutants_follow_from_the_seed_and_differ(mutate, content):
    made = [mutate(Random(k), content, [content]) for k in range(200)]
    assert made == [mutate(Random(k), content, [content]) for k in range(200)]
    assert len(set(made)) > 100
    assert sum(one != content for one in made) > 150
