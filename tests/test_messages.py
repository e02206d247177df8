"""What all messages of the package have in common: the names that they quote exist, and their promises are tried."""

import ast
import inspect
import pkgutil
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Literal, get_args, get_origin

import pytest
from pydantic import BaseModel
from typer.main import get_command

import caster_gym
import caster_gym.agents
from caster_gym.agents.commands.cli import app
from caster_gym.configuration import Frozen
from caster_gym.tasks.follow.environment import CasterFollowEnv
from caster_gym.tasks.track.environment import CasterTrackEnv

TESTS = Path(__file__).parent
FOLDERS = {"caster_gym": Path(caster_gym.__path__[0]), "agents": Path(caster_gym.agents.__path__[0])}
COMMANDS = get_command(app).commands  # type: ignore[attr-defined]
OPTIONS = {option for command in COMMANDS.values() for one in command.params for option in one.opts}
STARTS = {"path", "time", "progress", "pose", "twist", "steering", "reset_mask"}  # of reset(options=…)
OTHERS = {
    "psi": "a column of angles",
    "caster_gym": "the package itself",
    "made_of": "a part of saved states",
    "constants": "of runtimes",
}

# each sentence that says what "would suffice", by the file that says it, and the test that does it
PROMISES = {
    "caster_gym/design/command.py": [
        "design_sizing::test_motors_of_exactly_the_required_size_drive_the_paths_and_smaller_ones_do_not"
    ],
    "caster_gym/design/search.py": ["design_search::test_motors_that_are_too_slow_for_every_design_are_refused"],
    "caster_gym/arena/beside.py": [
        "arena_beside::test_where_there_is_no_room_the_path_is_named_and_so_many_as_are_told_fit"
    ],
    "caster_gym/engines/free_wheels.py": [
        "engines_free_wheels::test_a_step_that_throws_light_wheels_beyond_their_top_speed_is_refused_with_one_that_does_not"
    ],
    "caster_gym/engines/time_step.py": [
        "engines_time_step::test_the_number_of_substeps_that_a_refusal_names_would_do",
        "engines_time_step::test_where_no_number_of_substeps_would_do_something_else_is_named_that_does",
    ],
    "caster_gym/paths/arc_length.py": ["paths_advice::test_a_spacing_that_was_asked_for_is_replaced_by_one_that_does"],
    "caster_gym/paths/course.py": ["paths_advice::test_a_course_is_made_once_its_message_is_followed"],
    "caster_gym/paths/feasibility.py": [
        "paths_feasibility::test_viscous_friction_falls_with_speed_and_the_slow_path_that_is_offered_is_driven"
    ],
    "caster_gym/paths/motor_limits.py": [
        "paths_time_law::test_friction_beyond_the_motors_is_refused_with_path_place_and_joint"
    ],
    "caster_gym/paths/specification.py": ["paths_advice::test_a_trajectory_is_accepted_once_its_message_is_followed"],
    "caster_gym/paths/splines.py": ["paths_advice::test_a_value_that_a_check_names_passes_the_check"],
    "caster_gym/paths/trajectory.py": [
        "paths_advice::test_a_path_of_too_many_steps_is_accepted_once_it_is_as_short_as_its_message_says"
    ],
}


def sentences() -> Iterator[tuple[str, str]]:
    """The file and the text of every string with a blank in it that is no docstring."""
    for base, folder in FOLDERS.items():
        for file in sorted(folder.rglob("*.py")):
            name = f"{base}/{file.relative_to(folder)}"
            if "papers/" in name:  # pages about others' papers
                continue
            tree = ast.parse(file.read_text(encoding="utf-8"))
            bare = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            strings = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and id(node) not in bare)
            for node in strings:
                if isinstance(node.value, str) and " " in node.value:
                    yield name, node.value


def models(base: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for one in base.__subclasses__():
        yield one
        yield from models(one)


def words_of(annotation: object) -> Iterator[object]:
    """All values that an annotation's literals allow."""
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    else:
        for part in get_args(annotation):
            yield from words_of(part)


@pytest.fixture(scope="module")
def known():
    """Fields and words of configuration, arguments of environments, options of their resets."""
    for package in (caster_gym, caster_gym.agents):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                import_module(module.name)
    fields = {name: field for model in models(Frozen) for name, field in model.model_fields.items()}
    words = {
        word for model in models(Frozen) for one in model.model_fields.values() for word in words_of(one.annotation)
    }
    arguments = {name for env in (CasterTrackEnv, CasterFollowEnv) for name in inspect.signature(env).parameters}
    return {*fields, *words, *arguments, *STARTS, *OTHERS}


def test_every_name_that_a_message_quotes_is_one_that_can_be_given(known):
    """A quoted word that stands in the text itself, as 'substeps', is no value of the reader's: it must exist."""
    for file, text in sentences():
        for quoted in re.findall(r"'([a-z][a-z_.]*)'", text):
            assert set(quoted.split(".")) <= known, (file, text)


def test_every_option_and_command_that_a_message_names_exists():
    for file, text in sentences():
        assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text)) <= OPTIONS, (file, text)
        assert set(re.findall(r"`caster-gym (\w+)", text)) <= COMMANDS.keys(), (file, text)


def test_every_promise_of_what_would_do_has_a_test_that_does_it():
    made: dict[str, int] = {}
    for file, text in sentences():
        made[file] = made.get(file, 0) + text.count("would suffice")
    assert {file: count for file, count in made.items() if count} == {one: len(them) for one, them in PROMISES.items()}
    for tests in PROMISES.values():
        for place in tests:
            module, name = place.split("::")
            assert f"\ndef {name}(" in (TESTS / f"test_{module}.py").read_text(encoding="utf-8"), place
