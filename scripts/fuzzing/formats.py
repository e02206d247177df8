"""The formats of files that are read, what is mutated of each, and how it is read."""

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import torch

from caster_gym.agents.commands.benchmark import BenchmarkSettings
from caster_gym.agents.commands.command_line import changes_of
from caster_gym.agents.commands.selection import task_of_run
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import read_history
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import DESCRIPTION, WEIGHTS, Bundle, PolicyDescription, load_policy, save_bundle
from caster_gym.agents.registry import read_agent
from caster_gym.agents.sweep.settings import SweepSettings, read_sweep
from caster_gym.arena.arena import read_arena
from caster_gym.design import read_design
from caster_gym.envs.observation import ObservationLayout
from caster_gym.identification import read_recording, record, write_recording
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.specification import read_paths
from caster_gym.robot import load_robot
from caster_gym.shipped_files import find, names_of, read_settings
from caster_gym.tasks.track.metrics import TrackVerdict
from caster_gym.tasks.track.parameters import TrackParameters
from scripts.fuzzing.mutators import Mutator, mutate_bytes, mutate_json, mutate_table, mutate_weights, mutate_yaml

_LATE = (  # what readers import when they first need it
    *(f"encodings.{name}" for name in ("cp1252", "latin_1", "utf_16")),
    *(f"caster_gym.paths.{name}" for name in ("files", "smoothing", "timed_motion")),
)
STEP = 0.02  # [s] of the trajectories that paths are made into


class Format(NamedTuple):
    """A kind of file."""

    file: str  # its name
    seeds: Sequence[bytes]  # valid files
    mutate: Mutator
    read: Callable[[Path], object]  # what becomes of the file at a path
    share: float  # of the inputs, as a weight


def formats(folder: Path) -> dict[str, Format]:
    """All formats by name. In the folder lies what they need beside a file: a policy, a robot and points."""
    for module in _LATE:  # so that no import happens while a file is read
        importlib.import_module(module)
    robot = load_robot("chung2008")
    policy = folder / "policy"
    _write_policy(policy)
    recording = folder / "recording.csv"
    write_recording(recording, record(robot, seconds=0.4, time_step=0.02, with_rolling=True))
    (folder / "points.csv").write_bytes(_TABLES[0])
    (folder / "robot.yaml").write_bytes(_shipped("robots")[0])
    task = "\n".join(f"  {line}" for line in _shipped("tasks")[0].decode().splitlines())
    run = f"agent: {{algorithm: ppo}}\nseed: 0\ntask:\n{task}\n".encode()
    weights = (policy / WEIGHTS).read_bytes()

    def with_mutated(file: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            path.replace(policy / file)
            return load_policy(policy)

        return read

    return {
        "robot": Format("mutant.yaml", _shipped("robots"), mutate_yaml, load_robot, 4.0),
        "arena": Format("mutant.yaml", _ARENAS, mutate_yaml, read_arena, 2.0),
        "path": Format("mutant.yaml", _PATHS, mutate_yaml, _trajectories, 3.0),
        "table of points or poses": Format("mutant.csv", _TABLES, mutate_table, _trajectories, 3.0),
        "planner's file": Format("mutant.json", _PLANNED, mutate_json, _trajectories, 2.0),
        "recording": Format(
            "mutant.csv", [recording.read_bytes()], mutate_table, lambda path: read_recording(path, robot), 1.0
        ),
        "task": Format(
            "mutant.yaml", _shipped("tasks"), mutate_yaml, lambda path: read_settings(TaskSettings, "tasks", path), 3.0
        ),
        "agent": Format("mutant.yaml", _shipped("agents"), mutate_yaml, read_agent, 4.0),
        "benchmark": Format(
            "mutant.yaml",
            _shipped("benchmarks"),
            mutate_yaml,
            lambda path: read_settings(BenchmarkSettings, "benchmarks", path),
            3.0,
        ),
        "sweep": Format("mutant.yaml", _shipped("sweeps"), mutate_yaml, _sweep, 2.0),
        "design": Format("mutant.yaml", _shipped("designs"), mutate_yaml, read_design, 0.5),
        "policy": Format(
            "mutant.yaml", [(policy / DESCRIPTION).read_bytes()], mutate_yaml, with_mutated(DESCRIPTION), 2.0
        ),
        "weights": Format(WEIGHTS, [weights], mutate_weights, with_mutated(WEIGHTS), 2.0),
        "run": Format("mutant.yaml", [run], mutate_yaml, task_of_run, 2.0),
        "history": Format("mutant.csv", [_history()], mutate_table, lambda path: read_history(path, TrackVerdict), 2.0),
        "--set": Format("mutant.txt", _CHANGES, mutate_bytes, _changes, 2.0),
    }


def _shipped(kind: str) -> list[bytes]:
    return [find(kind, name).read_bytes() for name in names_of(kind)]


def _write_policy(folder: Path) -> None:
    robot, task, hidden = load_robot("chung2008"), TrackParameters(), (4,)
    actor = Actor(ObservationLayout(robot, task.preview).size, hidden, 6, "clip")
    with torch.no_grad():
        for weight in actor.parameters():
            weight.zero_()
    description = PolicyDescription(
        format=1, name="PPO", squash="clip", hidden=hidden, robot=robot, task=task, trained_with={}, versions={}
    )
    save_bundle(folder, Bundle(description, actor))


def _trajectories(path: Path) -> object:
    paths = read_paths(path)
    try:
        firsts = [one.model_copy(update={"count": 1}) if isinstance(one, RandomPaths) else one for one in paths]
        return [one.trajectories(STEP) for one in firsts]
    except ValueError as error:  # which knows no file
        raise ValueError(f"{path}: {error}") from error


def _sweep(path: Path) -> object:
    settings = read_settings(SweepSettings, "sweeps", path)
    try:
        return read_sweep(settings)
    except ValueError as error:  # which knows no file
        raise ValueError(f"{path}: {error}") from error


def _changes(path: Path) -> object:
    return changes_of([path.read_bytes().decode(errors="surrogateescape")])


def _history() -> bytes:
    names: list[object] = ["steps", "seconds", *TrackVerdict._fields]
    rows: list[list[object]] = [[1000 * k, 1.5 * k, *(0.1 * k for _ in TrackVerdict._fields)] for k in range(1, 6)]
    return "\n".join(",".join(map(str, row)) for row in (names, *rows)).encode()


_ARENAS = (
    b"room: [[-2, -2], [2, 2]]\npillars: [{centre: [0, 1.5], radius: 0.1}]\nrestitution: 0.3\n",
    b"walls: [{start: [3, -1], end: [3, 1], thickness: 0.1}]\nhalf_planes: [{point: [0, -3], normal: [0, 1]}]\n"
    b"polygons: [{corners: [[1, 1], [2, 1], [2, 2]]}]\nbeside: {pillars: 3, walls: 2, gap: [0.03, 0.2], seed: 1}\n",
)
_PATHS = (
    b"shape: circle\nradius: 1.0\nduration: 10.0\nlaps: 2\nheading: {kind: spinning, turns: 1.0}\n",
    b"shape: ellipse\nsemi_axes: [1.5, 0.5]\ncentre: [0.5, 0]\nrotation: 0.3\n",
    b"shape: lemniscate\nwidth: 1.8\nheading: {kind: profile, angles: [0, 1, 0], progress: [0, 0.4, 1]}\n",
    b"shape: rounded_square\nside: 1.2\nrounding: 0.4\nheading: fixed\n",
    b"shape: spline\nwaypoints: [[0, 0], [1, 0], [1, 1], [0, 1]]\nclosed: true\ntolerance: 0.01\n",
    b"shape: spline\nwaypoints: [[0, 0, 0], [1, 0, 90], [1, 1, 180]]\nunit: deg\nturns: nearest\n",
    b"shape: spline\nfile: points.csv\n",
    b"shape: timed\nposes: [[0, 0, 0, 0], [3, 1, 0, 0], [5, 1, 0, 0], [9, 1.5, 0.5, 1.57]]\nstretch: 1.2\nends: rest\n",
    b"shape: random_paths\ncount: 2\nseed: 3\nduration: 4.0\nextent: 2.0\nmin_radius: 0.2\nreversing: 0\n",
)
_TABLES = (
    b"x,y,heading\n0,0,0\n0.5,0.1,1.57\n1,0,3.14\n",
    b"# a comment\n"
    b"pos_x [mm]; pos_y [mm]; theta [\xc2\xb0]; battery [V]\n0; 0; 0; 24.1\n500; 100; 90; 24.0\n1000; 0; 180; 2\n",
    b"time,x,y,heading\n0,0,0,0\n3,1,0,0\n5,1,0,0\n9,1.5,0.5,1.57\n",
    b"stamp x_mm y_mm yaw_deg\n1583332205000000000 0 0 0\n1583332205250000000 10 0 2.5\n1583332205500000000 30 1 5.5\n",
    b"# s_m; x_m; y_m; psi_rad; kappa_radpm\n0;0;0;-1.57;0\n1;1;0;-1.37;0\n2;1.98;0.2;-1.17;0\n3;2.9;0.59;-1.17;0\n",
    b"t,x,y\n" + b"".join(b"%.2f,%.3f,%.3f\n" % (0.1 * k, 0.01 * k, 0.0004 * k * k) for k in range(40)),
)
_PLANNED = (
    b'[{"time": 0.0, "pose": {"translation": {"x": 0, "y": 0}, "rotation": {"radians": 0}}},'
    b' {"time": 2.0, "pose": {"translation": {"x": 1, "y": 0.5}, "rotation": {"radians": 0.5}}}]',
    b'{"trajectory": {"samples": [{"t": 0, "x": 0, "y": 0, "heading": 0}, {"t": 2, "x": 1, "y": 0, "heading": 1}]}}',
    b'{"waypoints": [{"anchor": {"x": 0, "y": 0}, "nextControl": {"x": 1, "y": 0}},'
    b' {"anchor": {"x": 2, "y": 1}, "prevControl": {"x": 1, "y": 1}}],'
    b' "rotationTargets": [{"waypointRelativePos": 0.5, "rotationDegrees": 45}], "goalEndState": {"rotation": 90}}',
)
_CHANGES = (
    b"n_timesteps=100000",
    b"robot={name: x, casters: [{x: 1, y: [2, 3]}]}",
    b"net_arch=[64, 64]",
    b"path=circle",
)


def check_seeds(all_formats: dict[str, Format], folder: Path) -> dict[str, Any]:
    """What each format's valid files are read as; that imports all that readers need."""
    made = {}
    for name, one in all_formats.items():
        for seed in one.seeds:
            path = folder / one.file
            path.write_bytes(seed)
            made[name] = one.read(path)
    return made
