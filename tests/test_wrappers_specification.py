"""caster_gym.wrappers.specification: reading features."""

import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

import caster_gym.wrappers as wrappers
from caster_gym.configuration import ConfigurationError, parse_yaml
from caster_gym.wrappers import ActionDelay, Feature, FeatureSpecification, Payload, Potential, Pushes, read_features

KINDS = [
    one for one in vars(wrappers).values() if inspect.isclass(one) and issubclass(one, Feature) and one is not Feature
]
PAGE = (Path(__file__).parent.parent / "docs" / "wrappers.md").read_text(encoding="utf-8")
NEEDED: dict[str, dict[str, Any]] = {
    "potential": {"quantity": "position_error", "margin": 0.5, "discount": 0.97},
    "tolerance": {"quantity": "power"},
    "residual_torque": {"agent": type("Idle", (), {"act": lambda self, observations: observations})()},
}


@pytest.mark.parametrize("kind", [one.model_fields["kind"].default for one in KINDS])
def test_every_feature_can_be_read_by_its_kind(kind):
    (feature,) = read_features([{"kind": kind, **NEEDED.get(kind, {})}])
    assert feature.model_dump()["kind"] == kind
    assert read_features([feature]) == (feature,)
    if kind not in NEEDED:
        assert read_features([kind]) == (feature,)


def test_features_keep_their_order_and_are_read_from_yaml():
    text = """
    - {kind: action_delay, periods: [0, 2]}
    - pushes
    - {kind: payload, mass: [0, 1e0], x: 0.1}
    - {kind: potential, quantity: position_error, margin: 0.5, discount: 0.97}
    """
    assert read_features(parse_yaml(text, "features")) == (
        ActionDelay(periods=(0, 2)),
        Pushes(),
        Payload(mass=(0.0, 1.0), x=0.1),
        Potential(quantity="position_error", margin=0.5, discount=0.97),
    )


def test_features_survive_a_dump_and_are_hashable():
    features = read_features([{"kind": kind, **NEEDED[kind]} for kind in ("potential", "tolerance")] + ["pushes"])
    assert read_features([feature.model_dump(mode="json") for feature in features]) == features
    assert len(set(features)) == 3


def test_a_feature_is_a_type_for_models_of_others():
    read = TypeAdapter(tuple[FeatureSpecification, ...]).validate_python([{"kind": "payload", "mass": 2}])
    assert read == (Payload(mass=2.0),)


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ("payload", "features should be a list, got 'payload'"),
        ({"kind": "payload"}, "features should be a list, got"),
        ([3], "feature 1 should be a kind or a mapping with a kind, got 3"),
        (["pushes", "action_dely"], "feature 2: unknown kind 'action_dely'; did you mean 'action_delay'"),
        ([{"periods": 2}], "feature 1: 'kind' is missing; known are action_delay"),
        ([{"kind": ["pushes"]}], "feature 1: unknown kind"),
        ([{"kind": "payload", "mas": 2}], "feature 1 'payload': unknown key 'mas'; did you mean 'mass'"),
        ([{"kind": "payload", "mass": True}], "feature 1 'payload': 'mass' should be a number, got True"),
        ([{"kind": "payload", "mass": [1, 2, 3]}], "'mass' should"),
        ([{"kind": "payload", "mass": float("nan")}], "'mass' should"),
    ],
)
def test_what_is_no_feature_is_refused_by_name(features, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features(features)


def test_the_page_names_every_kind_and_every_field():
    for kind in KINDS:
        assert f"`{kind.model_fields['kind'].default}`" in PAGE
        for field in set(kind.model_fields) - {"kind"}:
            assert f"`{field}`" in PAGE, (kind.__name__, field)


def test_the_example_of_the_page_runs(capsys):
    exec(PAGE.split("```python\n")[1].split("```")[0], {})
    assert len(capsys.readouterr().out.split()) == 2


def test_importing_wrappers_leaves_scipy_alone():
    command = "import sys, caster_gym.wrappers; print('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command], capture_output=True, text=True).stdout.strip() == "False"
