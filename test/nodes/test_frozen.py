"""Frozen sensors are recognised by values that do not change."""

from rsea_ros.nodes._model_inputs import Frozen

PERIOD = 3_571_429


def test_a_value_with_noise_that_stands_still_has_stopped_and_may_go_on():
    ft = Frozen()
    assert not any(ft.take(k * PERIOD, (0.01 * (k % 3),)) for k in range(100))
    assert [ft.take((100 + k) * PERIOD, (1.0,)) for k in range(30)][-1]
    assert not ft.take(130 * PERIOD, (1.1,))


def test_a_joint_at_rest_is_no_fault_until_its_torque_moves():
    joint = Frozen(least=0.3)
    for k in range(100):
        joint.beside(0.02 * (-1) ** k)
        assert not joint.take(k * PERIOD, (0.1, 0.0))
    for k in range(100, 130):
        joint.beside(0.05 * (k - 100))
        stopped = joint.take(k * PERIOD, (0.1, 0.0))
    assert stopped


def test_a_few_equal_samples_are_chance():
    ft = Frozen()
    assert not any(ft.take(k * PERIOD, (float(k // 8),)) for k in range(200))
