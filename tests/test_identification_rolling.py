"""caster_gym.identification.rolling: the wheels' angles along a simulated path."""

import numpy as np
from numpy.testing import assert_allclose

from caster_gym.engines.numpy_model import Model
from caster_gym.identification.rolling import rolled_along
from caster_gym.robot import load_robot


def test_angles_are_the_integral_of_rates_over_far_finer_steps():
    model, fine = Model(load_robot("tidybot2")), 50
    torque = np.tile([0.8, -0.2, 0.5, 0.3, -0.4, 0.1, 0.6, -0.3], 1)
    start = np.array([0.0, 0.0, 0.3, 0.1, -0.1, 0.4, 0.2, -0.5, 1.0, 2.0])
    path = model.simulate(start, torque, 4e-3, 50)
    finer = model.simulate(start, torque, 4e-3 / fine, 50 * fine)
    rates = model.rates(finer[:, 6:], finer[:, 3:6])[1]
    sums = np.concatenate([np.zeros((1, 4)), np.cumsum(0.5 * 4e-3 / fine * (rates[1:] + rates[:-1]), axis=0)])[::fine]
    found = rolled_along(model, path, torque, 4e-3)
    assert_allclose(found, sums, atol=1e-4 * np.abs(sums).max())  # of the path itself, RK4 at 4 ms
    assert np.abs(sums).max() > 0.05
