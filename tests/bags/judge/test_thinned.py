"""What is kept of a long series."""

from cfnav_ros.bags.judge.thinned import Thinned


def test_hours_fit_into_little_memory():
    kept = Thinned(lambda a, b, spacing: b - a >= spacing, most=100)
    for i in range(100_000):
        kept.take(float(i), pin=i == 777)
    found = kept.all()
    assert len(found) < 105
    assert {0.0, 776.0, 777.0, 99_999.0} <= set(found)
    assert found == sorted(found)
