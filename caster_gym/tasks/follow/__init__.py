"""Follow a path at the robot's own pace, among obstacles."""

from caster_gym.tasks.follow.metrics import METRICS
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.follow.reference import Courses, facts, fetch, lay_out
from caster_gym.tasks.follow.reward import FollowTerms, FollowWeights, reward
from caster_gym.tasks.task import Pictures, Task

TASK = Task(
    name="follow",
    environment="caster_gym.tasks.follow.environment:CasterFollow",
    purpose="follow a path at its own pace",
    parameters=FollowParameters,
    default_path="rounded_square",
    short_path={"shape": "circle", "radius": 0.5},
    preview_unit="m",
    source=Courses,
    lay_out=lay_out,
    fetch=fetch,
    weights=FollowWeights,
    terms=FollowTerms,
    reward=reward,
    metrics=METRICS,
    facts=facts,
    pictures=Pictures(speeds=True),
)
