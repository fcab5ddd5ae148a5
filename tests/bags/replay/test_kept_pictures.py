"""Pictures of a bag are kept for seconds, and no more than a fixed size of them."""

from cfnav_ros.bags.files.events import Picture
from cfnav_ros.bags.replay.kept_pictures import KEEP_NS, MOST_BYTES, KeptPictures

S = 1_000_000_000


def test_pictures_are_kept_for_seconds_and_within_bytes():
    def picture(k, size=100):
        return Picture(t_ns=k * S, data=bytes(size), decode=lambda: None)

    kept = KeptPictures()
    for k in range(30):
        kept.add(picture(k), k * S)
    assert kept.get(18 * S) is None
    assert kept.get(20 * S) is not None
    assert kept.newest[1].t_ns == 29 * S
    big = KeptPictures()
    for k in range(4):
        big.add(picture(k, MOST_BYTES // 2), k)
    assert [big.get(k * S) is not None for k in range(4)] == [False, False, True, True]
    again = KeptPictures()
    again.add(picture(1), 0)
    again.add(picture(1), 1)
    again.add(picture(2), KEEP_NS + 5)
    assert again.get(S) is None
