import numpy as np
from scipy.optimize import linprog

from punnet.movement.path_speed import fastest_motion


def test_straight_line_is_a_trapezoid():
    first, second = np.tile([1.0, 0.5], (401, 1)), np.zeros((401, 2))
    motion = fastest_motion(first, second, 2.0 / 400, np.array([1.0, 1.0]), np.array([2.0, 2.0]))
    np.testing.assert_allclose(motion.x[-1], 2.0 / 1.0 + 1.0 / 2.0, rtol=1e-3)
    np.testing.assert_allclose(motion(motion.x), np.linspace(0.0, 2.0, 401), atol=1e-12)


def test_agrees_with_a_linear_programme():
    """The largest Σ b subject to the same constraints, by an independent solver."""
    count = 120
    x = np.linspace(0.0, 1.0, count + 1)
    step = x[1]
    phase = 4.0 * x[:, None] + np.array([0.0, 1.0, 2.0])
    first, second = 4 * np.cos(phase), -16 * np.sin(phase)
    velocity, acceleration = np.array([2.0, 2.0, 2.5]), np.array([7.0, 9.0, 12.0])
    motion = fastest_motion(first, second, step, velocity, acceleration)
    speed = motion(motion.x[:-1], nu=1)

    rows, bounds = [], []
    for sign in (1.0, -1.0):
        for joint in range(3):
            rows_of_joint = np.zeros((count, count + 1))
            i = np.arange(count)
            rows_of_joint[i, i] = sign * (second[:-1, joint] - first[:-1, joint] / (2 * step))
            rows_of_joint[i, i + 1] = sign * first[:-1, joint] / (2 * step)
            rows.append(rows_of_joint)
            bounds.append(np.full(count, acceleration[joint]))
    ceiling = np.square(velocity / np.abs(first)).min(axis=1)
    ceiling[[0, -1]] = 0.0
    best = linprog(
        -np.ones(count + 1), np.concatenate(rows), np.concatenate(bounds), bounds=[(0, b) for b in ceiling]
    )
    np.testing.assert_allclose(np.square(speed), best.x[:-1], atol=1e-6 + 0.02 * best.x.max())
    optimal = np.sqrt(best.x)
    np.testing.assert_allclose(motion.x[-1], (2 * step / (optimal[1:] + optimal[:-1])).sum(), rtol=0.01)
