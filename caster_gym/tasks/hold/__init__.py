"""Go to a pose and hold it."""

from caster_gym.tasks.hold.metrics import METRICS
from caster_gym.tasks.hold.parameters import HoldParameters
from caster_gym.tasks.hold.reference import Poses, lay_out
from caster_gym.tasks.hold.reward import HoldTerms, HoldWeights, reward
from caster_gym.tasks.task import Pictures, Task
from caster_gym.tasks.track.reference import fetch

TASK = Task(
    name="hold",
    environment="caster_gym.tasks.hold.environment:CasterHold",
    purpose="go to a pose and hold it",
    parameters=HoldParameters,
    default_path="random_paths",
    short_path={"shape": "circle", "radius": 0.5, "duration": 60.0},
    preview_unit="s",
    source=Poses,
    lay_out=lay_out,
    fetch=fetch,
    weights=HoldWeights,
    terms=HoldTerms,
    reward=reward,
    metrics=METRICS,
    pictures=Pictures(path="pose to hold", around=0.4),
)
