"""The set of three steering joints: what it can and cannot do."""

import numpy as np

from caster_gym import Model
from papers.kim2001.isotropy_search import ROBOT
from papers.kim2001.steering_only import JOINTS, STEPS, SWING, one_round, steady_value, workspace_check


def test_steady_motions_are_singular():
    """Trailing casters steer no more, so that rows of their steering joints do not feel the twist."""
    assert steady_value() < 1e-12  # rounding
    straight = Model(ROBOT).jacobian(np.zeros(3), JOINTS) @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(straight, 0.0, atol=1e-15)


def test_a_round_without_singularity_leads_elsewhere():
    """A closed way of the steering angles is not one of the platform; the same steps backwards lead back."""
    pose, least = one_round()
    assert least > 0.1
    assert 1e-3 < np.hypot(pose[0], pose[1]) < ROBOT.casters[0].trail
    assert abs(pose[2]) > 1e-2


def test_the_round_does_not_depend_on_its_steps(monkeypatch):
    coarse, _ = one_round()
    monkeypatch.setattr("papers.kim2001.steering_only.STEPS", 2 * STEPS)
    fine, _ = one_round()
    np.testing.assert_allclose(coarse, fine, atol=(2.0 * SWING / STEPS) ** 2)  # of second order


def test_the_statement_is_true_as_far_as_it_goes():
    assert workspace_check().agrees
