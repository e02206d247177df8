"""Features of an environment, for one robot or a batch: other rewards, actions, sensors and plants.

>>> import gymnasium
>>> from caster_gym.wrappers import ActionDelay, SensorNoise, wrap
>>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0"), ActionDelay(periods=1), SensorNoise(position=0.002))
>>> observation, info = env.reset(seed=0)
>>> batch = wrap(gymnasium.make_vec("caster_gym:CasterTrack-v0", num_envs=16), *env.features)  # the same for a batch
"""

from caster_gym.wrappers.commands import JointSpeeds, ResidualTorque, TwistCommands
from caster_gym.wrappers.environment import FeatureEnv, FeatureVectorEnv, wrap
from caster_gym.wrappers.failures import MotorFailure
from caster_gym.wrappers.feature import Feature
from caster_gym.wrappers.history import History
from caster_gym.wrappers.latency import ActionDelay, MotorLag
from caster_gym.wrappers.odometry import Odometry
from caster_gym.wrappers.packets import DroppedPackets
from caster_gym.wrappers.plants import Friction, Payload, WheelErrors
from caster_gym.wrappers.pushes import Pushes
from caster_gym.wrappers.rewards import Effort, Impact, Potential, Smoothness, Tolerance, TractionUse
from caster_gym.wrappers.sensors import SensorNoise, SteeringOffset
from caster_gym.wrappers.specification import FeatureSpecification, read_features

__all__ = [
    "ActionDelay",
    "DroppedPackets",
    "Effort",
    "Feature",
    "FeatureEnv",
    "FeatureSpecification",
    "FeatureVectorEnv",
    "Friction",
    "History",
    "Impact",
    "JointSpeeds",
    "MotorFailure",
    "MotorLag",
    "Odometry",
    "Payload",
    "Potential",
    "Pushes",
    "ResidualTorque",
    "SensorNoise",
    "Smoothness",
    "SteeringOffset",
    "Tolerance",
    "TractionUse",
    "TwistCommands",
    "WheelErrors",
    "read_features",
    "wrap",
]
