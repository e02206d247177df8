"""Follow a timed trajectory."""

from caster_gym.tasks.task import Pictures, Task
from caster_gym.tasks.track.metrics import METRICS
from caster_gym.tasks.track.parameters import TrackParameters
from caster_gym.tasks.track.reference import Timetable, fetch, lay_out
from caster_gym.tasks.track.reward import TrackTerms, TrackWeights, reward

TASK = Task(
    name="track",
    environment="caster_gym.tasks.track.environment:CasterTrack",
    purpose="follow a timetable",
    parameters=TrackParameters,
    default_path="random_paths",
    short_path={"shape": "circle", "radius": 0.5, "duration": 60.0},
    preview_unit="s",
    source=Timetable,
    lay_out=lay_out,
    fetch=fetch,
    weights=TrackWeights,
    terms=TrackTerms,
    reward=reward,
    metrics=METRICS,
    pictures=Pictures(path="reference", magnified=20.0),
)
