"""Features as they are written in YAML and Python."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeAlias, get_args

from pydantic import Field

from caster_gym.configuration import ConfigurationError, parse
from caster_gym.paths.naming import unknown_name
from caster_gym.wrappers.commands import JointSpeeds, ResidualTorque, TwistCommands
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

AnyFeature: TypeAlias = (
    Potential
    | Tolerance
    | Effort
    | Smoothness
    | TractionUse
    | Impact
    | ResidualTorque
    | TwistCommands
    | JointSpeeds
    | ActionDelay
    | MotorLag
    | SensorNoise
    | SteeringOffset
    | Odometry
    | DroppedPackets
    | MotorFailure
    | History
    | Payload
    | Friction
    | WheelErrors
    | Pushes
)
FeatureSpecification: TypeAlias = Annotated[AnyFeature, Field(discriminator="kind")]
"""A feature as a type for models of others."""

_KINDS: dict[str, type[AnyFeature]] = {one.model_fields["kind"].default: one for one in get_args(AnyFeature)}


def read_features(features: Sequence[str | Mapping[str, Any] | Feature]) -> tuple[Feature, ...]:
    """Checked features from their kinds, from mappings with kind and fields, or from features, in their order.

    Raises ConfigurationError that names the feature, the key and the value.

    >>> from caster_gym.wrappers import read_features
    >>> [type(one).__name__ for one in read_features(["payload", {"kind": "action_delay", "periods": [0, 2]}])]
    ['Payload', 'ActionDelay']
    """
    if isinstance(features, str | Mapping) or not isinstance(features, Sequence):
        raise ConfigurationError(f"features should be a list, got {features!r}")
    return tuple(_read(feature, f"feature {number}") for number, feature in enumerate(features, start=1))


def _read(feature: Any, source: str) -> Feature:
    if isinstance(feature, Feature):
        return feature
    if not isinstance(feature, str | Mapping):
        raise ConfigurationError(f"{source} should be a kind or a mapping with a kind, got {feature!r}")
    content = {"kind": feature} if isinstance(feature, str) else feature
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ConfigurationError(f"{source}: {unknown_name('kind', kind, _KINDS)}")
    return parse(_KINDS[kind], content, f"{source} {kind!r}")
